"""How much of a difference a viewer sees between two sequences, frame by frame (§3)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError
from enfilade.metric import Aqm, Pursuit
from enfilade.monitor import Monitor
from enfilade.pixels.tone import display_luminance, srgb_encode
from enfilade.records import F32, Flow
from enfilade.settings import MetricSettings, ViewingSettings
from enfilade.video import Sequence, open_sequence
from enfilade.viewing import Viewing

DEFAULT_FPS = 30.0  # where neither sequence says its own: the paper's (§6)
FLOW_LAYERS = ("forward", "backward")

KeepMap = Callable[[str, F32], object]


@dataclass(frozen=True)
class FrameDifference:
    """What the metric says of one pair of frames.

    Attributes
    ----------
    name : str
        Of the test's frame.
    percent_visible : float
        Pixels above 1 JND, percent.
    score : float
        The map pooled to one number, JND.
    squared_error : float
        Mean over pixels and channels, sRGB-encoded and clipped to 0..1.
    velocity_deg_s : float
        Mean image velocity that was assumed.
    """

    name: str
    percent_visible: float
    score: float
    squared_error: float
    velocity_deg_s: float


@dataclass(frozen=True)
class SequenceDifference:
    """What the metric says of two sequences.

    Attributes
    ----------
    frames : tuple of FrameDifference
    viewing : Viewing
        Who was assumed to look.
    has_flow : bool
        Whether image flow was known; otherwise everything was judged as if it stood still.
    """

    frames: tuple[FrameDifference, ...]
    viewing: Viewing
    has_flow: bool

    @property
    def psnr_db(self) -> float:
        """PSNR of the whole sequence, of the mean squared error over all frames; infinite if identical."""
        return psnr_db(sum(f.squared_error for f in self.frames) / len(self.frames))

    def to_dict(self) -> dict[str, Any]:
        """Figures as plain values for JSON; a PSNR of identical images is None."""
        return {
            "frames": len(self.frames),
            "size": [self.viewing.width_px, self.viewing.height_px],
            "fps": self.viewing.fps,
            "pixels_per_degree": self.viewing.pixels_per_degree,
            "has_flow": self.has_flow,
            "percent_visible": _spread([f.percent_visible for f in self.frames]),
            "score_jnd": _spread([f.score for f in self.frames]),
            "psnr_db": _finite(self.psnr_db),
            "per_frame": [
                {
                    "name": f.name,
                    "percent_visible": f.percent_visible,
                    "score_jnd": f.score,
                    "psnr_db": _finite(psnr_db(f.squared_error)),
                    "velocity_deg_s": f.velocity_deg_s,
                }
                for f in self.frames
            ],
        }


def compare(
    test: Path | str,
    reference: Path | str,
    monitor: Monitor,
    *,
    viewing: ViewingSettings,
    metric: MetricSettings,
    fps: float | None = None,
    keep_map: KeepMap | None = None,
) -> SequenceDifference:
    """Judge two image sequences, videos or run folders with the animation quality metric.

    Image flow is taken from the ``forward`` and ``backward`` layers of the reference's frames, else of
    the test's; without any, everything is judged as if it stood still, where the eye sees most.

    Parameters
    ----------
    test, reference
        Whatever :func:`enfilade.video.open_sequence` reads.
    monitor
    viewing, metric
        Exposure is applied to OpenEXR frames alone: others are as shown.
    fps
        Frames per second shown; by default the reference's, the test's, or 30.
    keep_map
        Takes each frame's name and its map of detection probability, (H, W).

    Raises
    ------
    ImageError
        A sequence can't be read, or the two differ in length or size.
    """
    pair = open_sequence(test), open_sequence(reference)
    _check_alike(*pair)
    with_flow = next((s for s in reversed(pair) if _has_flow(s)), None)
    shown_fps = fps or pair[1].fps or pair[0].fps or DEFAULT_FPS
    if with_flow is None:
        monitor.say(
            "no image flow in either sequence: all is judged as if it stood still, where most is seen"
        )
    conditions = Viewing(
        width_px=pair[0].width,
        height_px=pair[0].height,
        diagonal_m=viewing.diagonal_m,
        distance_m=viewing.distance_m,
        fps=shown_fps,
        peak_cd_m2=viewing.peak_cd_m2,
        black_cd_m2=viewing.black_cd_m2,
    )
    judge = _Judge(conditions, metric, [_exposure_ev(s, viewing) for s in pair], keep_map)
    monitor.stage("compare", len(pair[0]))
    frames = []
    for index, images in enumerate(zip(*pair, strict=True)):
        velocity = None if with_flow is None else _velocity(with_flow, index, conditions)
        frames.append(judge.frame(pair[0].name(index), images, velocity))
        monitor.advance()
    return SequenceDifference(tuple(frames), conditions, with_flow is not None)


class _Judge:
    def __init__(
        self,
        viewing: Viewing,
        metric: MetricSettings,
        exposures_ev: list[float],
        keep_map: KeepMap | None,
    ) -> None:
        self._aqm = Aqm(viewing, pursuit=Pursuit(metric.metering.value), mask_slope=metric.mask_slope)
        self._exposures_ev = exposures_ev
        self._keep_map = keep_map

    def frame(self, name: str, images: tuple[F32, F32], velocity: F32 | None) -> FrameDifference:
        of = self._aqm.viewing
        test, reference = (
            display_luminance(image, exposure_ev=ev, peak_cd_m2=of.peak_cd_m2, black_cd_m2=of.black_cd_m2)
            for image, ev in zip(images, self._exposures_ev, strict=True)
        )
        found = self._aqm.compare(test, reference, velocity=velocity)
        if self._keep_map is not None:
            self._keep_map(name, found.probability)
        shown = [_encoded(image, ev) for image, ev in zip(images, self._exposures_ev, strict=True)]
        error = float(np.mean((shown[0] - shown[1]) ** 2, dtype=np.float64))
        speed = 0.0 if velocity is None else float(np.hypot(velocity[..., 0], velocity[..., 1]).mean())
        return FrameDifference(name, found.percent_visible, found.score, error, speed)


def psnr_db(squared_error: float) -> float:
    """Peak signal-to-noise ratio of values in 0..1: -10 log10 of the mean squared error; infinite at 0."""
    return math.inf if squared_error == 0.0 else -10.0 * math.log10(squared_error)


def _encoded(image: F32, exposure_ev: float) -> F32:
    shown: F32 = np.clip(image * np.float32(2.0**exposure_ev), 0.0, 1.0)
    return srgb_encode(shown)


def _check_alike(test: Sequence, reference: Sequence) -> None:
    if len(test) != len(reference):
        raise ImageError(
            f"the test has {len(test)} frames and the reference {len(reference)}; give equal ones"
        )
    sizes = [f"{s.width}x{s.height}" for s in (test, reference)]
    if sizes[0] != sizes[1]:
        raise ImageError(f"the test's images are {sizes[0]} and the reference's {sizes[1]}; give equal ones")


def _is_exr(sequence: Sequence) -> bool:
    return sequence.name(0).lower().endswith(".exr")


def _exposure_ev(sequence: Sequence, viewing: ViewingSettings) -> float:
    return viewing.exposure_ev if _is_exr(sequence) else 0.0


def _has_flow(sequence: Sequence) -> bool:
    return _is_exr(sequence) and all(layer in sequence.layers(0) for layer in FLOW_LAYERS)


def _velocity(sequence: Sequence, index: int, viewing: Viewing) -> F32:
    layers = sequence.layers(index)
    missing = [layer for layer in FLOW_LAYERS if layer not in layers]
    if missing:
        raise ImageError(f"{sequence.name(index)} has no layer {missing[0]!r}, which the first frame has")
    # A frame without a neighbour in its shot has zeros for the flow to it.
    forward, backward = (np.asarray(layers[name], np.float32) for name in FLOW_LAYERS)
    flow = Flow(backward, forward, bool(backward.any()), bool(forward.any()))
    return viewing.velocity_deg_s(flow.motion)


def _spread(values: list[float]) -> dict[str, float]:
    return {"mean": sum(values) / len(values), "most": max(values)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
