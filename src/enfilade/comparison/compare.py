"""The visible difference between two sequences, frame by frame (§3)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, TypeAlias, get_args

import numpy as np

from enfilade.comparison.measures import Measure, open_measure
from enfilade.comparison.motion import FlowChoice, Moved, open_motion
from enfilade.comparison.noise import NoiseEstimate, NoiseFloor
from enfilade.comparison.noise_estimate import NoiseEstimator
from enfilade.comparison.pairs import Pair, open_pairs
from enfilade.comparison.result import FrameDifference, SequenceDifference
from enfilade.errors import ImageError, InputError, SettingsError
from enfilade.metric import Aqm, Comparison, SequenceAqm
from enfilade.monitor import Monitor
from enfilade.records import F32
from enfilade.settings import MetricSettings, ViewingSettings
from enfilade.viewing import Viewing, display_named

Mode: TypeAlias = Literal["modern", "paper"]


@dataclass(frozen=True, eq=False)
class ComparedFrame:
    """A compared frame, for heat maps.

    Attributes
    ----------
    difference : FrameDifference
    jnd : (H, W) float32
        Map of visible differences.
    grey : (H, W) float32
        Luminance of the reference, encoded for an sRGB display, 0..1.
    """

    difference: FrameDifference
    jnd: F32
    grey: F32


Show = Callable[[Iterator[ComparedFrame], Viewing], object]


@dataclass(frozen=True)
class CompareOptions:
    """Options of a comparison: viewing conditions, mode of the metric, and inputs.

    Attributes
    ----------
    viewing
        Viewing conditions of an image that fills the display; its exposure is not used.
    metric
        Eye movements, and the slope of masking in the paper's mode.
    display
        Replaces `viewing`: a screen, of whose pixels each shows one of the image; or its name, as of
        ``enfilade compare --display``.
    mode
        Of the metric: ``modern`` or ``paper``.
    flow
        Origin of the motion vectors: ``auto``, ``layers``, ``estimate`` or ``none``.
    fps
        Frames per second shown; by default the reference's, the test's, or 30.
    exposure_ev
        Of OpenEXR frames, stops; by default that of the run folders, or 0.
    layers
        Layer or part of the test's and the reference's OpenEXR frames that is compared.
    measures
        Further measures: ``psnr``, ``flip``, ``cvvdp``, or a :class:`~enfilade.comparison.measures.Measure`
        of your own.

    Raises
    ------
    SettingsError
        There is no such mode or flow.
    InputError
        There is no such display.
    """

    viewing: ViewingSettings = field(default_factory=ViewingSettings)
    metric: MetricSettings = field(default_factory=MetricSettings)
    display: Viewing | str | None = None
    mode: Mode = "modern"
    flow: FlowChoice = "auto"
    fps: float | None = None
    exposure_ev: float | None = None
    layers: tuple[str | None, str | None] = (None, None)
    measures: Sequence[str | Measure] = ()

    def __post_init__(self) -> None:
        for name, known in (("mode", get_args(Mode)), ("flow", get_args(FlowChoice))):
            if (value := getattr(self, name)) not in known:
                raise SettingsError(f"{name} = {value!r}: choose one of {', '.join(known)}")
        if isinstance(self.display, str):
            display_named(self.display)

    def conditions(self, size: tuple[int, int], fps: float) -> Viewing:
        """Viewing conditions of an image of a size."""
        screen = display_named(self.display) if isinstance(self.display, str) else self.display
        if screen is not None:
            return replace(screen, fps=fps).cropped(*size)
        return self.viewing.conditions(*size, fps)


def compare(
    test: Path | str,
    reference: Path | str,
    options: CompareOptions,
    monitor: Monitor,
    *,
    second_reference: Path | str | None = None,
    show: Show | None = None,
) -> SequenceDifference:
    """Measure the visible difference between two image sequences, videos or run folders.

    Frames are read and compared one after another: memory does not grow with their number. A second reference
    doubles the time.

    Parameters
    ----------
    test, reference
        Sources of :func:`enfilade.images.open_sequence`.
    options
    monitor
    second_reference
        Another rendering of the reference with other random numbers: the test is compared with the mean of
        both, and their difference from each other is the noise floor. Without it the noise of the reference
        is estimated.
    show
        Receives the compared frames and the viewing conditions, and must iterate over all of them.

    Raises
    ------
    ImageError
        A sequence can't be read, they differ in length, size or frame rate, they are runs of different
        frames, pixels are NaN or infinite, or the two references are equal. The message names the frame.
    SettingsError
        There is no such measure, or it is not installed.
    """
    references = [reference] if second_reference is None else [reference, second_reference]
    pairs = open_pairs(
        test, references, fps=options.fps, exposure_ev=options.exposure_ev, layers=options.layers
    )
    conditions = options.conditions(pairs.size, pairs.fps)
    motion = open_motion(pairs.test, pairs.reference, options.flow, pairs.starts)
    notes = [motion.text, *pairs.notes]
    if pairs.exposure_ev:
        notes.append(f"exposure: OpenEXR frames are shown at {pairs.exposure_ev:+g} stops")
    if options.display is None:
        notes.append(
            f"display: the image fills a diagonal of {conditions.diagonal_m:g} m, seen from "
            f"{conditions.distance_m:g} m: {conditions.pixels_per_degree:.0f} pixels per degree; --display "
            "chooses another"
        )
    for note in notes:
        monitor.message(note)
    comparer = _Comparer(conditions, options, len(pairs), is_moving=motion.kind != "none")
    found: list[FrameDifference] = []

    def compared() -> Iterator[ComparedFrame]:
        for pair, moved in motion.follow(pairs.displayed(conditions, monitor)):
            frame = comparer.compare(pair, moved)
            found.append(frame.difference)
            yield frame
            monitor.progress("compare", len(found), len(pairs))

    if show is None:
        deque(compared(), maxlen=0)
    else:
        show(compared(), conditions)
    return SequenceDifference(
        tuple(found),
        conditions,
        comparer.bands_cpd,
        options.mode,
        motion.kind,
        scores=comparer.scores(),
        noise_floor=comparer.noise_floor(),
        noise_estimate=comparer.noise_estimate(),
    )


class _Comparer:
    def __init__(self, viewing: Viewing, options: CompareOptions, count: int, *, is_moving: bool) -> None:
        self._viewing = viewing
        pursuit = options.metric.pursuit
        if options.mode == "paper":
            aqm = Aqm.paper(viewing, pursuit=pursuit, mask_slope=options.metric.mask_slope)
        else:
            aqm = Aqm.modern(viewing, pursuit=pursuit)
        self._aqm, self._aqm_of_floor = SequenceAqm(aqm), SequenceAqm(aqm)
        self._floor: list[tuple[float, float, float]] = []  # score, percent visible, squared error
        self._noise = NoiseEstimator(aqm, viewing, count) if is_moving else None
        self.bands_cpd = aqm.bands_cpd
        opened = [open_measure(m, viewing) if isinstance(m, str) else m for m in options.measures]
        self._measures: list[tuple[Measure, list[float | None]]] = [(measure, []) for measure in opened]

    def compare(self, pair: Pair, moved: Moved) -> ComparedFrame:
        velocity = None if moved.motion is None else self._viewing.velocity_deg_s(moved.motion)
        found = _compared(self._aqm, pair, moved, velocity)
        if pair.halves is not None:
            of_halves = _compared(self._aqm_of_floor, pair.halves, moved, velocity)
            self._floor.append((of_halves.score, of_halves.percent_visible, pair.halves.squared_error))
        elif self._noise is not None:
            self._noise.add(pair, moved, velocity)
        for measure, values in self._measures:
            values.append(measure.measure(pair))
        speed = 0.0 if velocity is None else float(np.hypot(velocity[..., 0], velocity[..., 1]).mean())
        difference = _difference(pair, found, speed)
        return ComparedFrame(difference, found.jnd, pair.reference_grey)

    def noise_floor(self) -> NoiseFloor | None:
        if not self._floor:
            return None
        scores, visible, squared = zip(*self._floor, strict=True)
        return NoiseFloor(
            scores, percent_visible=float(np.mean(visible)), squared_error=float(np.mean(squared))
        )

    def noise_estimate(self) -> NoiseEstimate | None:
        return None if self._noise is None else self._noise.estimate()

    def scores(self) -> dict[str, float]:
        return {measure.name: measure.pool(values) for measure, values in self._measures}


def _compared(aqm: SequenceAqm, pair: Pair, moved: Moved, velocity: F32 | None) -> Comparison:
    try:
        return aqm.compare(
            pair.test_cd_m2,
            pair.reference_cd_m2,
            velocity=velocity,
            backward_flow_px=moved.backward,
            forward_flow_px=moved.forward,
            is_cut=moved.is_cut,
        )
    except InputError as error:
        raise ImageError(f"{pair.name} can't be compared: {error}") from error


def _difference(pair: Pair, found: Comparison, speed_deg_s: float) -> FrameDifference:
    return FrameDifference(
        pair.name,
        pair.number,
        found.percent_visible,
        found.score,
        found.steady,
        found.transient,
        pair.squared_error,
        speed_deg_s,
        largest_jnd=float(found.jnd.max()),
        is_identical=pair.is_identical,
    )
