"""Small walkthroughs of analytic scenes, rendered from end to end."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import numpy as np
from enfilade.pipeline.job import Job
from enfilade.pipeline.walkthrough import render
from enfilade.store import Run

from enfilade.camera.path import CameraPath
from enfilade.images import read_exr
from enfilade.monitor import Silence
from enfilade.settings import Settings
from support.analytic_scene import AnalyticScene, write_scene

# A screen of 96 x 72 px, 3 cm wide, seen from half a metre: the paper's 28 pixels a degree, so that a
# pixel a frame is 1.07 deg/s. Keyframes every 6 frames, never split unless a test is about that.
RENDERER = "support.analytic:load"
TABLES: dict[str, dict[str, Any]] = {
    "viewing": {"diagonal_m": 0.0375},
    "keyframes": {"spacing": 6},
    "trace": {"spp": 4},
    "masks": {"split_percent": 100.0},
}


def job_of(
    folder: Path, scene: AnalyticScene, path: CameraPath, *, method: str = "paper", **tables: dict[str, Any]
) -> Job:
    file = write_scene(folder / "scene.analytic", scene)
    merged = {name: TABLES.get(name, {}) | tables.get(name, {}) for name in {*TABLES, *tables}}
    return Job(file, path, Settings.from_tables(merged), method, RENDERER)


def rendered(folder: Path, job: Job, name: str = "run", monitor: Any = None) -> tuple[dict[str, Any], Path]:
    """Summary and run folder."""
    return render(job, folder / name, monitor or Silence()), folder / name


def frame_bytes(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in sorted((folder / "frames").glob("*.exr"))}


def colors(folder: Path) -> np.ndarray:
    """All frames, (N, H, W, 3) float64."""
    files = sorted((folder / "frames").glob("*.exr"))
    return np.stack([read_exr(file)["RGB"].astype(float) for file in files])


def units(folder: Path) -> dict[str, dict[str, Any]]:
    """What the ledger says of each unit, but for what it cost."""
    lines = Run.existing(folder).lines()
    return {line["unit"]: {k: v for k, v in line.items() if k != "cost"} for line in lines}


def part_of(path: CameraPath, frames: range) -> CameraPath:
    return CameraPath(
        path.cameras[frames.start : frames.stop], path.numbers[frames.start : frames.stop], path.fps
    )


def with_cut(path: CameraPath, frame: int) -> CameraPath:
    return dataclasses.replace(path, cuts=frozenset({frame}))


class Told:
    """A monitor that keeps what it hears."""

    def __init__(self):
        self.stages, self.said = [], []

    def stage(self, name, _total):
        self.stages.append(name)

    def advance(self, count=1):
        pass

    def extend(self, count):
        pass

    def say(self, text):
        self.said.append(text)


class Watcher(Silence):
    """Notes what is said, and does something after so many units."""

    def __init__(self, after=0, act=lambda: None):
        self.left, self.act, self.said = after, act, []

    def advance(self, count=1):
        if count > 0:  # and nothing is taken back
            self.left -= count
            if self.left == 0:
                self.act()

    def say(self, text):
        self.said.append(text)


def children():
    """Processes of this one; not the one in which Python itself counts what processes share."""
    numbers = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    return [int(n) for n in numbers if b"resource_tracker" not in Path(f"/proc/{n}/cmdline").read_bytes()]
