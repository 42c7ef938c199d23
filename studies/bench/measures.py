"""Measures of the bench, each of one window over all frames.

Measures of squared errors are products of the errors against both halves of the reference, (F - A)(F - B).
The noise of the halves is independent, so its mean is 0. The other measures compare with the denoised mean of
both halves, and contain what the denoiser leaves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enfilade.comparison.measures import DisplayedPair, Flip
from enfilade.comparison.measures.psnr import psnr_db
from enfilade.metric import Aqm, Pursuit, SequenceAqm, sequence_score
from enfilade.records import F32, Flow
from enfilade.viewing import Viewing

FLICKER_BLOCK_PX = 8
RELATIVE_FLOOR = 0.01  # added to the squared reference of the relative error (Rousselle et al. 2011)
BEST_JOD = 10.0
LEAST_ERROR = 1e-4  # where a measure finds none, or none above its noise: 80 dB


@dataclass(frozen=True, eq=False)
class WindowPair(DisplayedPair):
    """One window of a frame and of its reference, as the display shows them.

    Attributes
    ----------
    linear : (S, S, 3) float32
        The test before exposure and clipping.
    linear_reference : (S, S, 3) float32
        The reference, denoised.
    linear_halves, halves : tuple of (S, S, 3) float32
        The two halves of the reference, of independent random numbers: linear, and encoded.
    flow : Flow
        Motion vectors of the reference, pixels.
    """

    linear: F32
    linear_reference: F32
    linear_halves: tuple[F32, F32]
    halves: tuple[F32, F32]
    flow: Flow


@dataclass(frozen=True)
class Quality:
    """The scale of a measure, whose values are averaged over windows.

    Attributes
    ----------
    name, title, unit : str
        For files and programs; for tables and charts.
    has_noise : bool
        Whether the noise of the reference adds to the values.
    error_of : callable
        Maps a mean value to an error, 0 for identical sequences, which is interpolated on a logarithmic axis.
    score_of : callable or None
        Maps an error to the score for tables and charts.
    is_more_better : bool
        Of the score.
    """

    name: str
    title: str
    unit: str
    has_noise: bool = False
    error_of: Callable[[float], float] = float
    score_of: Callable[[float], float] = float
    is_more_better: bool = False

    def error(self, values: Sequence[float]) -> float:
        """Error of windows together, at least :data:`LEAST_ERROR`."""
        return max(self.error_of(sum(values) / len(values)), LEAST_ERROR)

    def score(self, values: Sequence[float]) -> float:
        """Score of windows together."""
        return self.score_of(self.error(values))


def _root(square: float) -> float:
    return math.sqrt(max(square, 0.0))


def _to_jod(error: float) -> float:
    return BEST_JOD - error


QUALITIES = {
    of.name: of
    for of in (
        Quality(
            "cvvdp", "ColorVideoVDP", "JOD", has_noise=True, error_of=lambda jod: BEST_JOD - jod,
            score_of=_to_jod, is_more_better=True,
        ),
        Quality("aqm", "AQM", "JND", has_noise=True),
        Quality("flip", "FLIP", "mean", has_noise=True),
        Quality(
            "psnr", "PSNR", "dB", error_of=_root, score_of=lambda rms: psnr_db(rms * rms), is_more_better=True
        ),
        Quality("relrmse", "relative RMSE", "", error_of=_root),
        Quality("flicker", "flicker", "RMS", error_of=_root),
    )
}  # fmt: skip


class Measure(Protocol):
    """Measures one window; a new instance for each."""

    def add(self, pair: WindowPair) -> None:
        """Measure the next frame."""
        ...

    def value(self) -> float:
        """The mean over all frames, in the unit of :meth:`Quality.error`'s values."""
        ...


class AqmMeasure:
    """The modern mode of the metric; see ``docs/metric.md``. Its value is the sequence score, JND."""

    def __init__(self, viewing: Viewing, *, pursuit: Pursuit) -> None:
        self._viewing = viewing
        self._metric = SequenceAqm(Aqm.modern(viewing, pursuit=pursuit))
        self._scores: list[float] = []

    def add(self, pair: WindowPair) -> None:
        """Score the next frame."""
        flow = pair.flow
        found = self._metric.compare(
            pair.test_cd_m2,
            pair.reference_cd_m2,
            velocity=np.ascontiguousarray(self._viewing.velocity_deg_s(flow.motion)),
            backward_flow_px=flow.backward if flow.has_backward else None,
            is_cut=not flow.has_backward,
        )
        self._scores.append(found.score)

    def value(self) -> float:
        """(mean over frames of score^3.5)^(1/3.5), JND."""
        return sequence_score(self._scores)


class FlipMeasure:
    """LDR-FLIP, mean over pixels and frames; it does not see flicker."""

    def __init__(self, viewing: Viewing) -> None:
        self._flip = Flip(viewing)
        self._values: list[float] = []

    def add(self, pair: WindowPair) -> None:
        """Mean of the next frame's map."""
        self._values.append(self._flip.measure(pair))

    def value(self) -> float:
        """Mean over frames."""
        return sum(self._values) / len(self._values)


class SquaredError:
    """Mean squared error of encoded values, 1 = white, without the noise of the reference."""

    def __init__(self) -> None:
        self._values: list[float] = []

    def add(self, pair: WindowPair) -> None:
        """Mean of products over pixels and channels."""
        first, second = (pair.test - half for half in pair.halves)
        self._values.append(float(np.mean(np.multiply(first, second, dtype=np.float64))))

    def value(self) -> float:
        """Mean over frames; it may be negative within the noise."""
        return sum(self._values) / len(self._values)


class RelativeSquaredError:
    """Mean of (F - A)(F - B) / (R^2 + 0.01), linear, R the denoised reference (Rousselle et al. 2011).

    The mean of both halves as R would weigh pixels by the noise that their product contains.
    """

    def __init__(self) -> None:
        self._values: list[float] = []

    def add(self, pair: WindowPair) -> None:
        """Mean over pixels and channels."""
        first, second = (pair.linear.astype(np.float64) - half for half in pair.linear_halves)
        squared = np.square(pair.linear_reference.astype(np.float64))
        self._values.append(float(np.mean(first * second / (squared + RELATIVE_FLOOR))))

    def value(self) -> float:
        """Mean over frames; it may be negative within the noise."""
        return sum(self._values) / len(self._values)


class Flicker:
    """Mean square of the change of the error since the last frame, of means over blocks of 8x8 pixels.

    Encoded values; blocks stay at their place in the image. Fine noise averages out, as it does for the eye;
    patches that come and go remain. Products of the changes against both halves: the noise of the reference
    does not count.
    """

    def __init__(self) -> None:
        self._previous: tuple[F32, F32] | None = None
        self._values: list[float] = []

    def add(self, pair: WindowPair) -> None:
        """Mean over blocks and channels; none for the first frame of a shot."""
        errors = _block_means(pair.test - pair.halves[0]), _block_means(pair.test - pair.halves[1])
        previous, self._previous = self._previous, errors
        if previous is not None and pair.flow.has_backward:
            first, second = (now - before for now, before in zip(errors, previous, strict=True))
            self._values.append(float(np.mean(np.multiply(first, second, dtype=np.float64))))

    def value(self) -> float:
        """Mean over frames, 0 if there is a single one; it may be negative within the noise."""
        return sum(self._values) / max(len(self._values), 1)


def _block_means(image: F32) -> F32:
    """Means over blocks, (H / 8, W / 8, 3)."""
    rows, columns = (size // FLICKER_BLOCK_PX for size in image.shape[:2])
    cut = image[: rows * FLICKER_BLOCK_PX, : columns * FLICKER_BLOCK_PX]
    blocks = cut.reshape(rows, FLICKER_BLOCK_PX, columns, FLICKER_BLOCK_PX, -1)
    return np.asarray(blocks.mean(axis=(1, 3)), np.float32)


def open_measure(name: str, viewing: Viewing, pursuit: Pursuit) -> Measure:
    """A measure of one window, other than ColorVideoVDP; `viewing` is that of the window."""
    match name:
        case "aqm":
            return AqmMeasure(viewing, pursuit=pursuit)
        case "flip":
            return FlipMeasure(viewing)
        case "psnr":
            return SquaredError()
        case "relrmse":
            return RelativeSquaredError()
        case "flicker":
            return Flicker()
        case _:
            raise KeyError(name)
