"""Runs of the toy method (:mod:`support.toy_method`) on the wall (:mod:`support.wall`)."""

from __future__ import annotations

import contextlib
import os
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.scene.opener import Scene
from enfilade.settings import SECTIONS, Settings
from support.toy_method import ToySettings

METHOD = "support.toy_method:Toy"


def slide(frames: int, *, cuts: tuple[int, ...] = (), size: tuple[int, int] = (8, 6)) -> CameraPath:
    """A camera that moves to the right."""
    cameras = []
    for frame in range(frames):
        pose = np.eye(4)
        pose[:3, 3] = 0.01 * frame, 0.0, 4.0
        cameras.append(Camera(pose, 50.0, *size))
    return CameraPath(tuple(cameras), tuple(range(1, frames + 1)), 24.0, frozenset(cuts))


def toy_job(
    folder: Path, frames: int = 4, *, method: str = METHOD, path: CameraPath | None = None, **tables: Any
) -> Job:
    """A walkthrough of a few cheap frames; the scene file lies in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.txt").write_text("a wall")
    tables = {"video": {"codec": "ffv1"}, **tables}
    settings = Settings.from_tables(tables, [*SECTIONS, ToySettings])
    scene = Scene(folder / "scene.txt", renderer="support.wall:load")
    return Job(scene, path or slide(frames), settings, method)


def order(folder: Path, **attempts: str) -> None:
    """Let tasks fail: ``order(folder, light_2="kill raise")``."""
    for task, how in attempts.items():
        file = folder / "orders" / task.replace("_", "-")
        file.parent.mkdir(exist_ok=True)
        file.write_text(how.replace(" ", "\n"))


def attempts(folder: Path) -> Counter[str]:
    """Number of attempts at each task."""
    files = (folder / "attempts").glob("*")
    return Counter({file.name: len(file.read_text().splitlines()) for file in files})


def digest(folder: Path) -> str:
    """Checksum of the results of a run."""
    return RunFolder.read(folder).digest()


def flip(file: Path, place: int = -1) -> None:
    """Flip a bit of a file."""
    data = bytearray(file.read_bytes())
    data[place] ^= 4
    file.write_bytes(data)


def wait_for(condition: Callable[[], object]) -> None:
    """Wait until a condition holds."""
    until = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < until, "it does not come"
        time.sleep(0.02)


def is_alive(pid: int) -> bool:
    """Whether a process has not ended."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def command(folder: Path, executor: str, workers: int | None = None) -> list[str]:
    """A command line that renders the toy run of a folder; messages come on stdout."""
    code = "import sys; from support.toys import main; main(*sys.argv[1:])"
    return [sys.executable, "-c", code, str(folder), executor, str(workers or 0)]


def environment() -> dict[str, str]:
    """Of such a command."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def main(folder: str, executor: str, workers: str) -> None:
    """The command of :func:`command`."""
    from enfilade.device import activate

    activate("cpu")
    from enfilade.runs.executor import Workers
    from enfilade.runs.render import render

    monitor = Recorder()
    try:
        render(toy_job(Path(folder)), Path(folder) / "run", monitor, Workers(executor, int(workers) or None))
    finally:
        print("\n".join(monitor.said), flush=True)  # noqa: T201


class Recorder:
    """A monitor that keeps its messages, and acts when a number of tasks are done."""

    def __init__(self, after: int = 0, act: Callable[[], object] = lambda: None) -> None:
        self.said: list[str] = []
        self.done: list[str] = []
        self.counts: dict[str, int] = {}
        self._after, self._act = after, act

    def progress(self, name: str, done: int, total: int) -> None:
        assert 0 <= done <= total
        is_task = done > self.counts.get(name, done)  # at first the beginning of a pass is shown
        self.counts[name] = done
        if is_task:
            self.done.append(name)
        if is_task and len(self.done) == self._after:
            self._act()

    def message(self, text: str) -> None:
        self.said.append(text)


@contextlib.contextmanager
def little_room(size: int) -> Iterator[None]:
    """Let no file grow beyond a bound, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
