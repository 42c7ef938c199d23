"""How much of a difference a viewer sees between two sequences, frame by frame (§3)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from enfilade.comparison.motion import FlowChoice, Moved, open_motion
from enfilade.comparison.pairs import Pair, open_pairs
from enfilade.comparison.verdict import Band, FrameDifference, Part, SequenceDifference
from enfilade.errors import ImageError, InputError
from enfilade.kernels.tone import srgb_encode
from enfilade.metric import Comparison, MetricOptions, Pursuit, SequenceAqm
from enfilade.monitor import Monitor
from enfilade.records import F32
from enfilade.settings import MetricSettings, ViewingSettings
from enfilade.viewing import Display, Viewing

__all__ = ["JudgedFrame", "Terms", "compare", "kernels_serve", "metric_options"]


@dataclass(frozen=True, eq=False)
class JudgedFrame:
    """One frame as it is judged, for heat maps.

    Attributes
    ----------
    index : int
        From 0.
    difference : FrameDifference
    jnd : (H, W) float32
        The map.
    reference_relative : (H, W) float32
        Luminance of the reference, 1 = white.
    """

    index: int
    difference: FrameDifference
    jnd: F32
    reference_relative: F32

    @property
    def grey(self) -> F32:
        """The reference, encoded for a screen, (H, W) float32, 0..1."""
        return srgb_encode(self.reference_relative)


Show = Callable[[Iterator[JudgedFrame], Viewing], object]


@dataclass(frozen=True)
class Terms:
    """What a comparison assumes.

    Attributes
    ----------
    viewing, metric
        Of `viewing` the exposure does not count; of `metric` the slope of masking counts where the
        transducer is off.
    display
        In place of the screen of `viewing`, which an image fills whatever its size.
    options
        Departures from the paper; by default all of them.
    flow
        Where image flow comes from.
    fps
        Frames per second shown; by default the reference's, the test's, or 30.
    exposure_ev
        Stops, of OpenEXR frames alone: others are as shown. By default those of the run folders, or 0.
    has_kernels
        Whether the modern mode's per-pixel part runs in Dr.Jit kernels, on the device that is active; see
        :func:`kernels_serve`.
    layers
        Of the test's and of the reference's OpenEXR frames: the layer or part that is the picture.
    """

    viewing: ViewingSettings = field(default_factory=ViewingSettings)
    metric: MetricSettings = field(default_factory=MetricSettings)
    display: Display | None = None
    options: MetricOptions = field(default_factory=MetricOptions.modern)
    flow: FlowChoice = FlowChoice.AUTO
    fps: float | None = None
    exposure_ev: float | None = None
    has_kernels: bool = False
    layers: tuple[str | None, str | None] = (None, None)

    def conditions(self, size: tuple[int, int], fps: float) -> Viewing:
        """Viewing conditions of an image of a size."""
        if self.display is not None:
            return self.display.viewing(*size, fps)
        return Viewing(
            *size,
            diagonal_m=self.viewing.diagonal_m,
            distance_m=self.viewing.distance_m,
            fps=fps,
            peak_cd_m2=self.viewing.peak_cd_m2,
            black_cd_m2=self.viewing.black_cd_m2,
            persistence=self.viewing.persistence,
        )


def compare(
    test: Path | str,
    reference: Path | str,
    terms: Terms,
    monitor: Monitor,
    *,
    show: Show | None = None,
) -> SequenceDifference:
    """Judge two image sequences, videos or run folders with the animation quality metric.

    Frames are read and judged one after another, each once: memory does not grow with their number.

    Parameters
    ----------
    test, reference
        Whatever :func:`enfilade.images.open_sequence` reads.
    terms
    monitor
    show
        Takes the judged frames as they come, and the viewing conditions. It must take all of them.

    Raises
    ------
    ImageError
        A sequence can't be read, the two differ in length, size or frame rate, they are runs of other
        frames, or pixels are NaN or infinite. The message names the frame.
    """
    pairs = open_pairs(test, reference, fps=terms.fps, exposure_ev=terms.exposure_ev, layers=terms.layers)
    conditions = terms.conditions(pairs.size, pairs.fps)
    motion = open_motion(pairs.test, pairs.reference, terms.flow, pairs.starts)
    monitor.say(motion.text)
    for note in filter(None, (pairs.note, *dict.fromkeys((pairs.test.note, pairs.reference.note)))):
        monitor.say(note)
    if pairs.exposure_ev:
        monitor.say(f"exposure: OpenEXR frames are shown at {pairs.exposure_ev:+g} stops")
    if terms.display is None:
        monitor.say(
            f"screen: the image fills a diagonal of {conditions.diagonal_m:g} m, seen from "
            f"{conditions.distance_m:g} m: {conditions.pixels_per_degree:.0f} pixels per degree; "
            "--display names others"
        )
    judge = _Judge(conditions, terms)
    found: list[FrameDifference] = []

    def judged() -> Iterator[JudgedFrame]:
        for pair, moved in motion.follow(pairs.shown(conditions, monitor)):
            frame = judge.frame(pair, moved)
            found.append(frame.difference)
            yield frame
            monitor.progress("compare", len(found), len(pairs))

    if show is None:
        deque(judged(), maxlen=0)
    else:
        show(judged(), conditions)
    return SequenceDifference(tuple(found), conditions, judge.bands, terms.options, motion.kind)


def metric_options(mode: str, *, include: Iterable[str] = (), leave_out: Iterable[str] = ()) -> MetricOptions:
    """Departures from the paper, by names.

    Parameters
    ----------
    mode
        ``paper`` or ``modern``.
    include, leave_out
        Departures to add to those of the mode, and to take away.

    Raises
    ------
    InputError
        An unknown mode or departure; the message lists the known ones.
    """
    modern = MetricOptions.modern()
    if mode not in ("paper", "modern"):
        raise InputError(f"unknown mode {mode!r} of the metric; choose paper or modern")
    options = modern if mode == "modern" else MetricOptions.paper()
    for name in include:
        modern.without(name)  # which refuses an unknown one
        options = replace(options, **{name: getattr(modern, name)})
    for name in leave_out:
        options = options.without(name)
    return options


def kernels_serve(options: MetricOptions) -> bool:
    """Whether there is a part of the metric that the kernels can run, with some departures from the paper.

    Parameters
    ----------
    options
        Without the transducer or without spatial pooling all runs in NumPy.
    """
    return options.transducer and options.spatial_pooling


class _Judge:
    def __init__(self, viewing: Viewing, terms: Terms) -> None:
        self._viewing = viewing
        self._aqm = SequenceAqm(
            viewing,
            options=terms.options,
            pursuit=Pursuit(terms.metric.metering.value),
            mask_slope=terms.metric.mask_slope,
            has_kernels=terms.has_kernels,
        )
        density = viewing.pixels_per_degree
        self.bands = tuple(
            Band(band.low_cpp * density, band.high_cpp * density) for band in self._aqm.aqm.cortex.bands
        )

    def frame(self, pair: Pair, moved: Moved) -> JudgedFrame:
        velocity = None if moved.motion is None else self._viewing.velocity_deg_s(moved.motion)
        try:
            found = self._aqm.judge(
                pair.test,
                pair.reference,
                velocity=velocity,
                backward_flow_px=moved.backward,
                is_cut=moved.is_cut,
            )
        except InputError as error:
            raise ImageError(f"{pair.name} can't be judged: {error}") from error
        speed = 0.0 if velocity is None else float(np.hypot(velocity[..., 0], velocity[..., 1]).mean())
        difference = _difference(pair, found, speed)
        return JudgedFrame(pair.index, difference, found.jnd, pair.reference_relative)


def _difference(pair: Pair, found: Comparison, speed_deg_s: float) -> FrameDifference:
    steady, transient = (Part(part.score, part.band_jnd) for part in (found.steady, found.transient))
    return FrameDifference(
        pair.name,
        pair.number,
        found.percent_visible,
        found.score,
        steady,
        transient,
        pair.squared_error,
        speed_deg_s,
        largest_jnd=float(found.jnd.max()),
    )
