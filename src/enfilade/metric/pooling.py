"""Pooling over channels and pixels, percentages and scores (§3.4, §6; Fig. 6)."""

from __future__ import annotations

import numpy as np

from enfilade.metric.comparison import Comparison, Part
from enfilade.metric.pyramid import Pyramid, double, halved_shape
from enfilade.records import F32, Mask

POOLING_EXPONENT = 3.5  # b, no unit: slope of the psychometric function (Daly 1993)
DETECTION_JND = 1.0  # §6: seen in 75 % of cases; the paper counts a difference above this as visible


def raised(squared: F32) -> F32:
    """J^3.5 from J^2, 0 or more, as x sqrt(x) sqrt(sqrt(x)), without logarithms."""
    rooted = np.sqrt(squared)
    power = squared * rooted
    power *= np.sqrt(rooted, out=rooted)
    return power


def percent_visible(jnd: F32, valid: Mask) -> float:
    """Valid pixels that differ by more than 1 JND, percent (§3.4); 0 when none is valid."""
    count = int(np.count_nonzero(valid))
    return 100.0 * int(np.count_nonzero((jnd > DETECTION_JND) & valid)) / count if count else 0.0


class Pool:
    """Sums the channels of one comparison, each at its own size.

    Parameters
    ----------
    levels : int
        Number of radial bands.
    valid : (H, W) bool
        Pixels to compare.
    exponent : float
        b, of J = (sum J_kl^b)^(1/b).
    """

    def __init__(self, levels: int, valid: Mask, exponent: float) -> None:
        self._valid, self._exponent = valid, exponent
        self._area = None if valid.all() else Pyramid(valid.astype(np.float32))
        self._sums: dict[bool, dict[int, F32]] = {False: {}, True: {}}
        self._band_sums = {kind: [0.0] * levels for kind in self._sums}

    def area(self, reduction: int) -> F32 | None:
        """Valid part of each coarse sample, 0 to 1; None where all pixels are valid."""
        return None if self._area is None else self._area.at(reduction)

    def add(self, level: int, power: F32, reduction: int, *, is_transient: bool = False) -> None:
        """Add J^b of one or more channels of a level, a map at every `reduction`-th pixel.

        `Part.band_jnd` is exact where b is 3.5, or where all channels of a level are added at once.
        """
        sums, area = self._sums[is_transient], self.area(reduction)
        sums[reduction] = sums[reduction] + power if reduction in sums else power
        ratio = POOLING_EXPONENT / self._exponent
        pooled = power if ratio == 1.0 else power.astype(np.float64) ** ratio
        if area is None:
            mean = float(pooled.mean(dtype=np.float64))
        else:
            weight = float(area.sum(dtype=np.float64))
            mean = float(np.vdot(area, pooled)) / weight if weight else 0.0
        self._band_sums[is_transient][level - 1] += mean

    def comparison(self) -> Comparison:
        """Finish: maps and scores."""
        jnd = self._map(False)
        score = steady = self._score(jnd)
        transient = 0.0
        if self._sums[True]:
            transient = self._score(self._map(True))
            jnd = self._map(False, True)
            score = self._score(jnd)
        return Comparison(
            jnd=jnd,
            percent_visible=percent_visible(jnd, self._valid),
            score=score,
            steady=Part(steady, self._band_jnd(False)),
            transient=Part(transient, self._band_jnd(True)),
        )

    def _map(self, *kinds: bool) -> F32:
        """J from the sums of channels: coarse ones interpolated, the root, interpolated to full size."""
        shape, sums = self._valid.shape, [self._sums[kind] for kind in kinds]
        sizes = {size for of_kind in sums for size in of_kind} or {1}
        reduction = max(sizes)
        total = np.zeros(halved_shape(shape, reduction), dtype=np.float32)
        while True:
            for of_kind in sums:
                if reduction in of_kind:
                    total += of_kind[reduction]
            if reduction == min(sizes) and self._exponent != 1.0:
                total **= np.float32(1.0 / self._exponent)
            if reduction == 1:
                return total * self._valid
            reduction //= 2
            total = double(total, halved_shape(shape, reduction))

    def _score(self, jnd: F32) -> float:
        count = max(int(np.count_nonzero(self._valid)), 1)
        total = float(raised(np.square(jnd)).sum(dtype=np.float64))
        return float((total / count) ** (1.0 / POOLING_EXPONENT))

    def _band_jnd(self, kind: bool) -> tuple[float, ...]:
        return tuple(total ** (1.0 / POOLING_EXPONENT) for total in self._band_sums[kind])
