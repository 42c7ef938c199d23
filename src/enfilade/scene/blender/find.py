"""Where Blender is: a program, or the module bpy in an environment of its own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from enfilade.errors import SceneError

PACKAGES = Path(__file__).resolve().parents[3]  # `src` of a checkout, or site-packages
SCRIPT = PACKAGES / "enfilade_blender" / "__main__.py"
LEAST_VERSION = (4, 2)
ANSWER_S = 120.0  # of `blender --version` on a slow disk
VERSION = re.compile(r"^Blender (\d+)\.(\d+)(\S*)", re.MULTILINE)
MODULE_VERSION = "import importlib.metadata; print('Blender', importlib.metadata.version('bpy'))"
COLOR_CONFIG = "datafiles/colormanagement/config.ocio"
KEPT = ("PATH", "LANG", "LC_ALL", "LC_CTYPE", "LD_LIBRARY_PATH")  # of the environment
INSTALL = (
    "install it and put `blender` on PATH, give it by --set blender.program=PATH, or let `enfilade doctor "
    "--install-blender` install the module bpy (374 MB)"
)


@dataclass(frozen=True)
class Blender:
    """A program that runs scripts inside Blender.

    Attributes
    ----------
    program : Path
        Blender, or a Python that has the module bpy.
    version : str
    is_module : bool
        Whether it is a Python.
    note : str
        Programs that were found first, and are not used; empty where there are none.
    """

    program: Path
    version: str
    is_module: bool
    note: str = ""

    def command(self, script: Path, job: Path) -> list[str]:
        """Command line that runs a script with a job file; files' own scripts are disabled."""
        if self.is_module:
            return [str(self.program), "-I", str(script), str(job)]
        flags = ["--background", "--factory-startup", "--disable-autoexec", "--python-exit-code", "3"]
        return [str(self.program), *flags, "--python", str(script), "--", str(job)]

    def color_config(self) -> Path | None:
        """Its configuration of OpenColorIO; None where it is not in one of the usual places."""
        real = self.program.resolve().parent
        folders = (
            [self.program.parents[1] / "lib"] if self.is_module else [real, real.parent / "share" / "blender"]
        )
        start = "python3*/site-packages/bpy/*" if self.is_module else "[0-9]*"
        found = [file for folder in folders for file in folder.glob(f"{start}/{COLOR_CONFIG}")]
        return max(found, default=None)


def environment_folder() -> Path:
    """The environment of the module bpy that `make blender` and `enfilade doctor --install-blender` create.

    In a checkout ``.venv-blender``; otherwise ``enfilade/blender`` in the user's data folder
    (``XDG_DATA_HOME``).
    """
    if (PACKAGES.parent / "pyproject.toml").is_file() and PACKAGES.name == "src":
        return PACKAGES.parent / ".venv-blender"
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "enfilade" / "blender"


def clean_environment() -> dict[str, str]:
    """Environment variables for Blender: none of Python, of Blender or of OpenColorIO."""
    return {name: os.environ[name] for name in KEPT if name in os.environ}


def find_blender(program: str = "") -> Blender:
    """Find Blender: the given program, else ``blender`` on PATH, else the environment of the module bpy.

    A program that is given must work; one on PATH that does not, or is too old, is passed over.

    Parameters
    ----------
    program
        Blender, a Python with the module bpy, or the folder of either. Empty: look for it.

    Raises
    ------
    SceneError
        There is none, or the given one does not work.
    """
    if program:
        place = Path(program)
        found = _asked(_in_folder(place if place.exists() else Path(shutil.which(program) or place)))
        if isinstance(found, str):
            raise SceneError(f"{program} can't import scenes: {found}; {INSTALL}")
        return found
    passed_over: list[str] = []
    on_path = shutil.which("blender")
    places = [Path(on_path)] if on_path else []
    for place in (*places, environment_folder() / "bin" / "python"):
        if place.exists():
            found = _asked(place)
            if isinstance(found, Blender):
                return Blender(found.program, found.version, found.is_module, "; ".join(passed_over))
            passed_over.append(f"{place} is not used: {found}")
    raise SceneError(f"found no Blender to import the file with{_listed(passed_over)}; {INSTALL}")


def _listed(passed_over: list[str]) -> str:
    return f" ({'; '.join(passed_over)})" if passed_over else ""


def _in_folder(place: Path) -> Path:
    """The program in a folder; a program itself."""
    inside = (place / "blender", place / "bin" / "python")
    return next((file for file in inside if file.is_file()), place) if place.is_dir() else place


def _asked(program: Path) -> Blender | str:
    """The Blender that a program is, or why it is none."""
    answer = _output([str(program), "--version"])
    is_module = answer.startswith("Python ")
    if is_module:
        answer = _output([str(program), "-I", "-c", MODULE_VERSION])
    found = VERSION.search(answer)
    if found is None:
        return "it has no module bpy" if is_module else "it doesn't answer --version as Blender does"
    blender = Blender(program.absolute(), f"{found[1]}.{found[2]}{found[3]}", is_module)
    if (int(found[1]), int(found[2])) >= LEAST_VERSION:
        return blender
    return f"it is Blender {blender.version}, older than {'.'.join(map(str, LEAST_VERSION))}"


def _output(line: list[str]) -> str:
    try:
        done = subprocess.run(  # noqa: S603
            line, capture_output=True, text=True, errors="replace", check=False, timeout=ANSWER_S,
            env=clean_environment(), stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout
