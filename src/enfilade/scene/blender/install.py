"""Installation of the module bpy, which is Blender, in an environment of its own."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from enfilade.errors import EnfiladeError
from enfilade.scene.blender.find import Blender, environment_folder, find_blender

RECIPES = {  # packages by the version of Python, of which each bpy has wheels for one alone
    "3.11": ("bpy==4.5.*", "numpy<2"),
    "3.13": ("bpy==5.2.*",),
}
STAMP = ".ready"  # in a finished environment


def install(say: Callable[[str], object]) -> Blender:
    """Create the environment of the module bpy, unless it is there.

    Parameters
    ----------
    say
        Shows a line of progress.

    Raises
    ------
    EnfiladeError
        There is no Python of the right version, or pip failed.
    SceneError
        What was installed does not work.
    """
    folder = environment_folder()
    program = folder / "bin" / "python"
    if (folder / STAMP).is_file():
        say(f"Blender is installed in {folder}")
        return find_blender(str(program))
    python, packages = _recipe()
    say(f"installing {packages[0]} in {folder}: 374 MB to load, 950 MB on the disk, some minutes")
    folder.parent.mkdir(parents=True, exist_ok=True)
    _run([python, "-m", "venv", "--clear", str(folder)])
    _run([str(program), "-m", "pip", "install", "--disable-pip-version-check", "--no-compile", *packages])
    found = find_blender(str(program))
    (folder / STAMP).write_text(f"{found.version}\n")
    say(f"installed Blender {found.version}")
    return found


def _recipe() -> tuple[str, tuple[str, ...]]:
    """The first Python of a version for which there is a bpy, and the packages to install."""
    for version, packages in RECIPES.items():
        base = Path(sys.base_prefix) / "bin" / f"python{version}"
        found = str(base) if base.is_file() else shutil.which(f"python{version}")
        if found is not None:
            return found, packages
    raise EnfiladeError(
        f"the module bpy needs Python {' or '.join(RECIPES)}, which is not here; install it (such as sudo "
        "apt-get install python3.11 python3.11-venv), or install Blender 4.2 or newer (blender.org) and "
        "put `blender` on PATH"
    )


def _run(line: list[str]) -> None:
    """Run a step; its output goes to stderr."""
    done = subprocess.run(line, stdout=sys.stderr, check=False)  # noqa: S603
    if done.returncode:
        raise EnfiladeError(f"`{' '.join(line)}` failed with exit code {done.returncode}: see above")
