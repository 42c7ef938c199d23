"""A method of cheap tasks that fail on demand.

The file ``orders/PASS-NUMBER`` in the scene's folder lists, line by line, the behaviour of each attempt at a
task: ``raise``, ``memory``, ``kill``, ``exit``, ``stop``, ``hang``, ``full``, ``refuse``, ``disk`` (an I/O
error), ``leave`` (a temporary file, then death). Every attempt appends the process number, the paths in
flight and the GPU to ``attempts/PASS-NUMBER``.
"""

from __future__ import annotations

import errno
import os
import signal
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enfilade.errors import NoSpaceError, RunFolderError, SettingsError
from enfilade.files import whole_file
from enfilade.methods.analysis import Analysis
from enfilade.methods.base import FRAMES, Inputs, Method, Output, Pass, Task, TaskId
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Frame, Provenance
from enfilade.renderer import Purpose
from enfilade.settings import Section, TraceSettings, option


@dataclass(frozen=True)
class ToySettings(Section):
    """A section that only this method has."""

    table = "toy"

    gain: float = option(1.0, "Factor of all colours.", least=0.0)


@dataclass(frozen=True, eq=False)
class Light:
    """An image of one number a pixel, (H, W), and a number."""

    value: F32
    count: int


class Toy(Method):
    """Noise (``light``), its mean over a shot (``mean``, behind a barrier), and frames that show both."""

    name = "toy"
    settings = (TraceSettings, ToySettings)
    passes = (
        Pass("light", Light),
        Pass("mean", Light, reads=("light",), is_barrier=True),
        Pass(FRAMES, Frame, reads=("light", "mean")),
    )

    def tasks(self, analysis: Analysis) -> Iterable[Task]:
        for shot, frames in enumerate(analysis.path.shots()):
            yield Task("mean", frames.start, shot)
            for frame in frames:
                yield Task("light", frame, shot)
                yield Task(FRAMES, frame, shot, (TaskId("mean", frames.start), TaskId("light", frame)))

    def run(self, task: Task, inputs: Inputs, walk: Walkthrough) -> Output:
        name = f"{task.pass_name}-{walk.path.numbers[task.frame]}"
        obey(walk.renderer.folder, name, walk.renderer.paths_in_flight)  # type: ignore[attr-defined]
        shot = walk.path.shots()[task.shot]
        match task.pass_name:
            case "light":
                color = walk.trace(task.frame, Purpose.FILL, spp=1, pixel_filter=0).color
                light = np.ascontiguousarray(color[..., 0])
                return Output({task.frame: Light(light, task.frame)}, {"rays": {"camera": light.size}})
            case "mean":
                values = [inputs.record("light", frame).value for frame in shot]
                return Output(
                    {task.frame: Light(np.mean(values, axis=0), len(shot))}, {"mean": np.mean(values)}
                )
        mean = inputs.metadata("mean", shot.start)["mean"]
        value = inputs.record("mean", shot.start).value + inputs.record("light", task.frame).value - mean
        color = np.repeat(value[..., None], 3, axis=2) * np.float32(walk.settings[ToySettings].gain)
        return Output({task.frame: Frame(color, np.full(value.shape, Provenance.REUSED, np.uint8))})


def obey(folder: Path, name: str, paths_in_flight: int) -> None:
    attempts, orders = folder / "attempts" / name, folder / "orders" / name
    attempts.parent.mkdir(exist_ok=True)
    with attempts.open("a") as file:
        file.write(f"{os.getpid()} {paths_in_flight} {os.environ.get('CUDA_VISIBLE_DEVICES')}\n")
    number = len(attempts.read_text().splitlines())
    asked = orders.read_text().splitlines() if orders.exists() else []
    if number <= len(asked):
        misbehave(asked[number - 1], folder)


def misbehave(how: str, folder: Path) -> None:
    match how:
        case "kill":
            os.write(1, b"last words\n")
            os.kill(os.getpid(), signal.SIGKILL)
        case "exit":
            os._exit(7)
        case "stop":
            os.kill(os.getpid(), signal.SIGSTOP)
        case "hang":
            time.sleep(3600)
        case "leave":
            with whole_file(folder / "run" / "light" / "left.exr") as beside:
                beside.write_bytes(b"half")
                os.kill(os.getpid(), signal.SIGKILL)
        case "disk":
            raise RunFolderError("can't read it") from OSError(errno.ESTALE, "Stale file handle")
    if how in ERRORS:
        raise ERRORS[how]


ERRORS = {
    "raise": ZeroDivisionError("by nought"),
    "memory": MemoryError("out of it"),
    "full": NoSpaceError("no room"),
    "refuse": SettingsError("not with this scene"),
}
