"""Measures of the bench: the measures of ``enfilade compare``, the AQM, and the temporal error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from enfilade.comparison import measures
from enfilade.comparison.measures import DisplayedPair, Psnr, Scale
from enfilade.comparison.measures.psnr import psnr_db
from enfilade.metric import Aqm, Pursuit, SequenceAqm, sequence_score
from enfilade.records import F32, Flow, Mask
from enfilade.viewing import Viewing

PLANE_TOLERANCE = 0.01  # of the depth: distance from its plane within which a point is of the same surface
SHAPE, POSITION, NORMAL, DEPTH = "shape_index", "P", "N", "Z"  # AOVs of a delivered frame


@dataclass(frozen=True, eq=False)
class TrackedPair(DisplayedPair):
    """A pair of frames with the motion of the reference.

    Attributes
    ----------
    flow : Flow
        Motion vectors of the reference.
    visible_before : (H, W) bool or None
        Pixels whose surface the previous frame shows, at the end of `flow.backward`; None in the first
        frame of a shot.
    halves : tuple of (H, W, 3) float32
        The two halves of the reference, of independent random numbers, encoded as it is. The mean of
        products (test - first) (test - second) has no contribution of their noise.
    """

    flow: Flow
    visible_before: Mask | None
    halves: tuple[F32, F32]


class Measure(Protocol):
    """A :class:`enfilade.comparison.measures.Measure` that may use motion."""

    def measure(self, pair: TrackedPair) -> float | None:
        """Measure the next frame; None where the measure is undefined."""
        ...

    def pool(self, values: Sequence[float | None]) -> float:
        """Result for the sequence, from the values of its frames."""
        ...


class AqmMeasure:
    """The modern mode of the metric; see ``docs/metric.md``.

    Parameters
    ----------
    viewing
        Viewing conditions.
    pursuit
        Eye movements.
    """

    SCALE = Scale("aqm", "AQM", "JND")
    name = SCALE.name

    def __init__(self, viewing: Viewing, *, pursuit: Pursuit = Pursuit.BOTH) -> None:
        self._viewing = viewing
        self._metric = SequenceAqm(Aqm.modern(viewing, pursuit=pursuit))

    def measure(self, pair: TrackedPair) -> float:
        """Score of the frame, JND."""
        flow = pair.flow
        found = self._metric.compare(
            pair.test_cd_m2,
            pair.reference_cd_m2,
            velocity=self._viewing.velocity_deg_s(flow.motion),
            backward_flow_px=flow.backward if flow.has_backward else None,
            is_cut=pair.visible_before is None,
        )
        return found.score

    def pool(self, values: Sequence[float | None]) -> float:
        """(mean over frames of score^3.5)^(1/3.5), JND."""
        return sequence_score(value for value in values if value is not None)


class Temporal:
    """RMS change of the error since the previous frame, along the motion vectors.

    With e_t = test - reference, sRGB-encoded, and the backward motion vectors b_t of the reference, a frame's
    value is the root of the mean of |e_t(x) - e_{t-1}(x + b_t(x))|^2 over channels and over the pixels whose
    surface both frames show. An error that stays on its surface has 0; independent noise has sqrt(2) times
    its deviation. This is the warping error of Lai et al. (2018, "Learning blind video temporal
    consistency"), applied to the error instead of the image, so that changes of the reference (moving
    highlights) are no error.

    The square is the product of the changes against both halves of the reference, whose noise it does not
    contain. The previous error is interpolated bilinearly, which smooths fine noise and slightly favours
    noisy configurations.
    """

    SCALE = Scale("temporal", "temporal", "RMS")
    name = SCALE.name

    def __init__(self) -> None:
        self._previous: tuple[F32, F32] | None = None

    def measure(self, pair: TrackedPair) -> float | None:
        """Change of the error; None in the first frame of a shot, or where no surface is in both frames.

        Negative where noise of the references makes the product negative.
        """
        errors = pair.test - pair.halves[0], pair.test - pair.halves[1]
        previous, self._previous = self._previous, errors
        if previous is None or pair.visible_before is None or not pair.visible_before.any():
            return None
        first, second = (
            (now - _bilinear(before, pair.flow.backward))[pair.visible_before]
            for now, before in zip(errors, previous, strict=True)
        )
        square = float(np.mean(np.multiply(first, second, dtype=np.float64)))
        return math.copysign(math.sqrt(abs(square)), square)

    def pool(self, values: Sequence[float | None]) -> float:
        """RMS over frames; 0 where no frame has a previous one."""
        known = [value * abs(value) for value in values if value is not None]
        return math.sqrt(max(sum(known) / len(known), 0.0)) if known else 0.0


class HalvesPsnr:
    """PSNR without the noise of the reference: its squared error is the product of those against both halves.

    Infinite where that product is not positive.
    """

    SCALE = Psnr.SCALE
    name = SCALE.name

    def __init__(self) -> None:
        self._squares: list[float] = []

    def measure(self, pair: TrackedPair) -> float:
        """PSNR of the next frame, dB."""
        first, second = (pair.test - half for half in pair.halves)
        self._squares.append(float(np.mean(np.multiply(first, second, dtype=np.float64))))
        return psnr_db(max(self._squares[-1], 0.0))

    def pool(self, values: Sequence[float | None]) -> float:
        """PSNR of the whole sequence: of the mean squared error over all frames."""
        del values
        return psnr_db(max(sum(self._squares) / len(self._squares), 0.0))


def visible_before(layers: Mapping[str, npt.NDArray[Any]], previous: Mapping[str, npt.NDArray[Any]]) -> Mask:
    """Pixels whose surface the previous frame shows, too.

    Parameters
    ----------
    layers, previous
        AOVs ``shape_index``, ``P``, ``N``, ``Z`` and ``backward`` of a delivered frame, and of the previous
        one of the same shot.

    Returns
    -------
    (H, W) bool
        True where the motion vector ends at a pixel of the same shape on the same plane, or at the
        background, where nothing is hit.
    """
    backward = layers["backward"].astype(np.float32)
    height, width = backward.shape[:2]
    column = np.arange(width) + backward[..., 0]
    row = np.arange(height)[:, None] + backward[..., 1]
    is_inside = (column > -0.5) & (column < width - 0.5) & (row > -0.5) & (row < height - 0.5)
    at = np.where(is_inside, np.rint(row), 0).astype(int), np.where(is_inside, np.rint(column), 0).astype(int)
    step = previous[POSITION][at] - layers[POSITION]
    plane_distance = np.abs((step * layers[NORMAL].astype(np.float32)).sum(axis=-1))
    is_same_shape = previous[SHAPE][at] == layers[SHAPE]
    is_visible: Mask = is_inside & is_same_shape & (plane_distance <= PLANE_TOLERANCE * layers[DEPTH])
    return is_visible


def _bilinear(image: F32, flow: F32) -> F32:
    """Values of an image at the ends of the motion vectors: bilinear, clamped at the borders."""
    height, width = image.shape[:2]
    x = np.clip(np.arange(width) + flow[..., 0], 0.0, width - 1.0)
    y = np.clip(np.arange(height)[:, None] + flow[..., 1], 0.0, height - 1.0)
    left = np.minimum(x.astype(int), max(width - 2, 0))
    top = np.minimum(y.astype(int), max(height - 2, 0))
    u, v = (x - left)[..., None], (y - top)[..., None]
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    upper = image[top, left] * (1.0 - u) + image[top, right] * u
    lower = image[below, left] * (1.0 - u) + image[below, right] * u
    values: F32 = (upper * (1.0 - v) + lower * v).astype(np.float32)
    return values


SCALES = {
    scale.name: scale
    for scale in (
        AqmMeasure.SCALE,
        measures.SCALES["flip"],
        HalvesPsnr.SCALE,
        Temporal.SCALE,
        measures.SCALES["cvvdp"],
    )
}


def open_measure(name: str, viewing: Viewing, pursuit: Pursuit) -> Measure:
    """A measure for one pair of sequences; see :func:`enfilade.comparison.measures.open_measure`."""
    match name:
        case "aqm":
            return AqmMeasure(viewing, pursuit=pursuit)
        case "temporal":
            return Temporal()
        case "psnr":
            return HalvesPsnr()
        case _:
            return measures.open_measure(name, viewing)


NOISE_FREE = frozenset({HalvesPsnr.name, Temporal.name})  # measures without the noise of the reference
