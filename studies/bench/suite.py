"""The bench on several scenes and sizes: scenes, frames and configurations of each."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade.camera import load_path
from enfilade.errors import EnfiladeError, SceneError
from studies.bench.configurations import LARGE_PX
from studies.bench.ratios import mean_ratio
from studies.bench.splits import UNLISTED, split_of
from studies.scenes import SCENES

PIXEL_M = 0.25 / 800.0  # pitch of the paper's screen, 640x480 on 25 cm: 28 pixels per degree at 0.5 m
FIRST_FRAME = 11  # of the measured ones, where the path is long enough
QUICK = ("denoised-4", "denoised-16", "denoised-64", "decoupled-60", "decoupled-10")


@dataclass(frozen=True)
class Case:
    """A scene with its path.

    Attributes
    ----------
    name : str
    scene, path : Path
    split : str
        See :func:`studies.bench.splits.split_of`.
    """

    name: str
    scene: Path
    path: Path
    split: str


def generated(names: Iterable[str], size: str, folder: Path) -> list[Case]:
    """Write generated scenes (preset small) with paths for images of a size."""
    cases = []
    for name in names:
        files = folder / f"{name}-{size}"
        command = ["scene", name, "--preset", "small", "--size", size, "--out", str(files)]
        done = subprocess.run(
            [sys.executable, "-m", "studies", *command], check=False, stdout=subprocess.DEVNULL
        )
        if done.returncode:
            raise EnfiladeError(f"the generated scene {name} could not be written")
        cases.append(Case(name, files / "scene.xml", files / "camera_path.json", split_of(name)))
    return cases


def found_in(folder: Path) -> list[Case]:
    """Scenes of a folder: subfolders with `camera_path.json`, and `scene.xml` beside it or one level below.

    Raises
    ------
    SceneError
        There is none, or a subfolder has several.
    """
    cases = []
    for path in sorted(folder.glob("*/camera_path.json")):
        home = path.parent
        scenes = [home / "scene.xml"] if (home / "scene.xml").is_file() else sorted(home.glob("*/scene.xml"))
        if len(scenes) != 1:
            raise SceneError(f"{home} has {len(scenes)} files scene.xml; it must have one")
        split = UNLISTED if home.name in SCENES else split_of(home.name)  # not the generated one of that name
        cases.append(Case(home.name, scenes[0], path, split))
    if not cases:
        raise SceneError(f"{folder} has no subfolder with camera_path.json and scene.xml")
    return cases


def run_case(
    case: Case,
    size: str,
    frames: int,
    measured: int,
    only: Iterable[str],
    out: Path,
    options: list[str],
) -> dict[str, Any]:
    """Run or continue the bench of a scene in a process of its own; return its results.

    Parameters
    ----------
    case
    size
        Such as ``320x180``.
    frames
        Of the walkthrough, from the first one; all frames where the path has fewer.
    measured
        Number of consecutive frames that are measured.
    only
        Names of configurations; empty: those of the size.
    out
        Folder of the benches.
    options
        Further options of the command.

    Raises
    ------
    EnfiladeError
        It failed; its message is on the screen.
    """
    width, height = map(int, size.split("x"))
    length = len(load_path(case.path, size=None, frames=None, fps=None))
    frames = min(frames, length)
    last = min(FIRST_FRAME + measured - 1, frames)
    folder = out / f"{case.name}-{size}-{frames}"
    command = [
        sys.executable, "-m", "studies", "bench", str(case.scene), "--path", str(case.path),
        "--out", str(folder),
        "--size", size, "--walkthrough", f"1-{frames}", "--frames", f"{max(last - measured + 1, 1)}-{last}",
        "--set", f"viewing.diagonal_m={math.hypot(width, height) * PIXEL_M}",
        *(word for name in only for word in ("--only", name)), *options,
    ]  # fmt: skip
    if subprocess.run(command, check=False).returncode:
        raise EnfiladeError(f"the bench of {case.name} at {size} failed; the same command continues")
    found: dict[str, Any] = json.loads((folder / "bench.json").read_text())
    return found | {"scene": case.name, "split": case.split}


def is_large_size(size: str) -> bool:
    """Whether images of a size, such as ``1280x720``, have few configurations."""
    width, height = map(int, size.split("x"))
    return width * height >= LARGE_PX


def summary(benches: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Geometric means of the ratios over the scenes of a size and split, by configuration.

    Returns
    -------
    list of dict
        ``size``, ``split``, ``configuration``, ``scenes`` and ``ratios`` by measure, as `ratios.mean_ratio`.
    """
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for found in benches:
        size = "x".join(map(str, found["size"]))
        for name, by_measure in found["ratios"].items():
            groups.setdefault((size, found["split"], name), []).append(
                {"scene": found["scene"], **by_measure}
            )
    return [
        {
            "size": size,
            "split": split,
            "configuration": name,
            "scenes": [one["scene"] for one in members],
            "ratios": {
                measure: mean_ratio([one[measure] for one in members])
                for measure in members[0]
                if measure != "scene" and all(measure in one for one in members)
            },
        }
        for (size, split, name), members in sorted(groups.items())
    ]


GENERATED = SCENES
LARGE_SCENES = ("courtyard",)
QUICK_SCENES = ("room", "courtyard")  # one of each split
