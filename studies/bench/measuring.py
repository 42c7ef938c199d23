"""Measurement of a configuration's frames against the references, in the windows of a bench."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import scipy.ndimage

from enfilade.camera.path import CameraPath
from enfilade.comparison.measures import display_pair
from enfilade.errors import SettingsError
from enfilade.images import read_exr
from enfilade.methods.base import FRAMES
from enfilade.monitor import Monitor
from enfilade.records import F32
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.settings import MetricSettings, SampleFilter, ViewingSettings
from enfilade.viewing import Viewing
from studies.bench import colorvideovdp
from studies.bench.measures import QUALITIES, WindowPair, open_measure
from studies.bench.references import ReferenceFrame, References
from studies.bench.windows import Window

FLIP_IS_MISSING = "FLIP is left out; install it with: pip install flip-evaluator"
# Of each axis. Variances, square pixels: 1/12 of a box, .2433 of the Gaussian that ends at three deviations.
GAUSSIAN_OF_BOX = (0.08, 0.84, 0.08)


def available(requested: Sequence[str], job: Job) -> tuple[list[str], list[str]]:
    """Names of the measures that are available for a path, and the reasons why others are not.

    Raises
    ------
    SettingsError
        A requested measure is missing, or all are.
    """
    path = job.path
    reasons = dict.fromkeys(QUALITIES, "")
    reasons["cvvdp"] = colorvideovdp.why_missing()
    if find_spec("flip_evaluator") is None:
        reasons["flip"] = FLIP_IS_MISSING
    if not any(path.neighbours(frame)[0] for frame in range(len(path))):
        reasons["flicker"] = "flicker is left out: it needs consecutive frames"
    for name in requested:
        if why := reasons.get(name, f"there is no measure {name!r}; known are: {', '.join(QUALITIES)}"):
            raise SettingsError(why)
    names = list(dict.fromkeys(requested)) or [name for name, why in reasons.items() if not why]
    return names, [] if requested else [why for why in reasons.values() if why]


Source = Callable[[int], Sequence[F32]]  # from a frame to its windows, (S, S, 3) linear


def frame_of_run(run: RunFolder, number: int, *, is_filtered: bool) -> F32:
    """A frame, (H, W, 3) linear; a box-filtered one may be filtered to a Gaussian."""
    image = np.asarray(read_exr(run.file_of(FRAMES, number))["RGB"], np.float32)
    return gaussian_of_box(image) if is_filtered else image


def gaussian_of_box(image: F32) -> F32:
    """An image of box-filtered pixels (H, W, 3), filtered to the variance of the Gaussian pixel filter."""
    for axis in (0, 1):
        image = scipy.ndimage.convolve1d(image, GAUSSIAN_OF_BOX, axis=axis, mode="nearest")
    return image


def windows_of_run(run: Path, path: CameraPath, windows: Sequence[Window], *, is_filtered: bool) -> Source:
    """The windows of the frames of a run folder; see :func:`frame_of_run`."""
    held = RunFolder.read(run)

    def read(frame: int) -> list[F32]:
        image = frame_of_run(held, path.numbers[frame], is_filtered=is_filtered)
        return [np.ascontiguousarray(window.crop(image)) for window in windows]

    return read


def measure(
    source: Source | None,
    references: References,
    windows: Sequence[Window],
    job: Job,
    names: Sequence[str],
    monitor: Monitor,
    *,
    pixel_filter: SampleFilter = SampleFilter.GAUSSIAN,
) -> dict[str, list[float]]:
    """Measure frames in all windows, each frame read once.

    Parameters
    ----------
    source
        The windows of each frame; None for the first half of the references, denoised, against the second.
    references, windows
    job
        Camera path and viewing conditions.
    names
        Names of measures.
    monitor
    pixel_filter
        Of the references.

    Returns
    -------
    dict
        Values of the windows by measure.
    """
    pursuit = job.settings[MetricSettings].pursuit
    viewing = job.viewing.cropped(windows[0].side, windows[0].side)
    exposure_ev = job.settings[ViewingSettings].exposure_ev
    others = [name for name in names if name != "cvvdp"]
    opened = [{name: open_measure(name, viewing, pursuit) for name in others} for _ in windows]
    kept: list[list[colorvideovdp.Pair]] = [[] for _ in windows]
    for frame in range(len(job.path)):
        monitor.progress("measures", frame, len(job.path))
        reference = references.read(frame)
        tests = None if source is None else source(frame)
        for index, pair in enumerate(_pairs(tests, reference, pixel_filter, viewing, exposure_ev)):
            for one in opened[index].values():
                one.add(pair)
            if "cvvdp" in names:
                kept[index].append((pair.test.astype(np.float16), pair.reference.astype(np.float16)))
    values = {name: [of[name].value() for of in opened] for name in others}
    if "cvvdp" in names:
        values["cvvdp"] = colorvideovdp.predict_jod(kept, viewing)
    monitor.progress("measures", len(job.path), len(job.path))
    return {name: values[name] for name in names}


def _pairs(
    tests: Sequence[F32] | None,
    reference: ReferenceFrame,
    pixel_filter: SampleFilter,
    viewing: Viewing,
    exposure_ev: float,
) -> Iterator[WindowPair]:
    """The windows of a frame, each with its reference."""
    halves, denoised = (of[pixel_filter] for of in (reference.halves, reference.denoised))
    for index, flow in enumerate(reference.flows):
        test, wanted = denoised[:2, index] if tests is None else (tests[index], denoised[2, index])
        pair = display_pair(test, wanted, viewing, exposure_ev=exposure_ev)
        first, second = halves[:, index]
        shown = display_pair(first, second, viewing, exposure_ev=exposure_ev)
        yield WindowPair(
            **vars(pair),
            linear=test,
            linear_reference=wanted,
            linear_halves=(first, second),
            halves=(shown.test, shown.reference),
            flow=flow,
        )
