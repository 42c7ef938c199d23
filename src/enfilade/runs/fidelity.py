"""Frames of an imported scene by Cycles, and by path tracing of what was imported."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from enfilade.camera import CameraPath, load_path
from enfilade.errors import SceneError
from enfilade.files import read_json, scratch_folder
from enfilade.images import read_exr
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, U32
from enfilade.renderer import PixelFilter, Purpose
from enfilade.scene.blender.find import Blender
from enfilade.scene.blender.imported import ImportedScene
from enfilade.scene.blender.importer import job_table
from enfilade.scene.blender.process import CYCLES_FILE, cpu_of_children_s, run_job
from enfilade.scene.blender.source import Choices
from enfilade.scene.opener import Scene
from enfilade.settings import LimitSettings, Settings, TraceSettings

T = TypeVar("T")
WIDEST_PX = 480  # of a checked frame
HALVES = (0, 1)  # seeds of two images with independent noise
FRAMES = 3  # checked by default


@dataclass(frozen=True)
class Cost:
    """Time of a renderer for all frames.

    Attributes
    ----------
    wall_s, cpu_s : float
    """

    wall_s: float
    cpu_s: float


@dataclass(frozen=True, eq=False)
class CheckedFrame:
    """A frame by both renderers, each in two halves of independent noise.

    Attributes
    ----------
    number : int
    cycles, imported : tuple of two (H, W, 3) float32
        Linear Rec.709.
    shape_index : (H, W) uint32
    """

    number: int
    cycles: tuple[F32, F32]
    imported: tuple[F32, F32]
    shape_index: U32


@dataclass(frozen=True, eq=False)
class ImportCheck:
    """Frames of an imported scene by Cycles and by Mitsuba.

    Attributes
    ----------
    frames : tuple of CheckedFrame
    names : tuple of str
        Of shapes 1, 2, ...
    spp : int
        Paths a pixel of each renderer, both halves together.
    cycles, imported : Cost
    """

    frames: tuple[CheckedFrame, ...]
    names: tuple[str, ...]
    spp: int
    cycles: Cost
    imported: Cost


def checked_numbers(path: CameraPath) -> tuple[int, ...]:
    """Numbers of the frames that are checked by default, evenly from the first to the last."""
    indices = np.linspace(0, len(path) - 1, min(FRAMES, len(path))).round().astype(int)
    return tuple(path.numbers[i] for i in indices)


def check_import(
    imported: ImportedScene,
    source: Path,
    blender: Blender,
    choices: Choices,
    limits: LimitSettings,
    monitor: Monitor,
    *,
    numbers: tuple[int, ...] | None = None,
    spp: int = 64,
) -> ImportCheck:
    """Render some frames of the file by Cycles, and of the imported scene by path tracing.

    Both have pixels of a box filter and no denoising; Cycles has none of its clamping. Frames are at most 480
    pixels wide.

    Parameters
    ----------
    imported
    source
        The file that was imported.
    blender
    choices
        With which it was imported.
    limits
        Of the process of Cycles.
    monitor
    numbers
        Of the frames; None: the first, the middle and the last one.
    spp
        Paths a pixel, in two halves.

    Raises
    ------
    InputError
        The file has no camera, a frame is not on its path, or Blender can't render it.
    DeviceError
    """
    file = imported.checked_path()
    numbers = numbers or checked_numbers(load_path(file))
    path = load_path(file, size=_small(imported.size), frames=numbers)
    half = max(spp // len(HALVES), 1)
    choices = replace(choices, size=(path.width, path.height), frames=None)
    job = {**job_table("cycles", source, Path(), choices, limits), "frame_list": list(numbers), "spp": half}
    by_cycles, cycles_cost = _timed(lambda: [_cycles(blender, job, seed, limits, monitor) for seed in HALVES])

    scene = Scene(imported.scene_file)
    renderer = scene.open(Settings(limits))
    walks = [Walkthrough(path, Settings(TraceSettings(seed=seed), limits), renderer) for seed in HALVES]
    traced, cost = _timed(lambda: [_traced(walk, half, monitor) for walk in walks])
    frames = tuple(
        CheckedFrame(
            number,
            (by_cycles[0][i], by_cycles[1][i]),
            (traced[0][i], traced[1][i]),
            walks[0].view(i).geometry.shape_index,
        )
        for i, number in enumerate(numbers)
    )
    return ImportCheck(frames, renderer.describe().shapes, half * len(HALVES), cycles_cost, cost)


def _small(size: tuple[int, int]) -> tuple[int, int]:
    """A size of the same aspect that is quickly rendered; even sides."""
    factor = min(1.0, WIDEST_PX / size[0])
    width, height = (max(2, round(side * factor / 2.0) * 2) for side in size)
    return (width, height) if factor < 1.0 else size


def _cycles(
    blender: Blender, job: dict[str, object], seed: int, limits: LimitSettings, monitor: Monitor
) -> list[F32]:
    """Frames by Cycles, in the order of the job."""
    with scratch_folder("enfilade-cycles") as folder:
        run_job(blender, {**job, "out": str(folder), "seed": seed, "unbiased": True}, limits, monitor)
        listed = read_json(folder / CYCLES_FILE)["frames"]
        images = [read_exr(folder / f"cycles-{number:04d}.exr").get("RGB") for number in listed]
    found = [image.astype(np.float32) for image in images if image is not None]
    if listed != job["frame_list"] or len(found) != len(listed):
        raise SceneError(f"{job['source']}: Cycles did not render the frames {job['frame_list']}")
    return found


def _traced(walk: Walkthrough, spp: int, monitor: Monitor) -> list[F32]:
    """Frames by path tracing."""
    images = []
    for frame in range(len(walk.path)):
        shading = walk.trace(frame, Purpose.REFERENCE, spp=spp, pixel_filter=PixelFilter.BOX)
        images.append(shading.color)
        monitor.progress("path tracing", frame + 1, len(walk.path))
    return images


def _timed(work: Callable[[], T]) -> tuple[T, Cost]:
    """A result, with the time that this process and its children took for it."""
    began, cpu_began = time.monotonic(), time.process_time() + cpu_of_children_s()
    result = work()
    cpu_s = time.process_time() + cpu_of_children_s() - cpu_began
    return result, Cost(time.monotonic() - began, cpu_s)
