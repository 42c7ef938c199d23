"""What a comparison of two images found: map, probability, share, bands and score (§3.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.cortex import Band
from enfilade.metric.pooling import POOLING_EXPONENT, detection_probability, percent_visible, raised, root
from enfilade.metric.pyramid import double, halve, halved_shape
from enfilade.metric.spatial import Aperture

__all__ = ["Comparison", "Part", "Pool", "PoolingRule"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Part:
    """What one kind of errors contributes to a comparison.

    Attributes
    ----------
    score : float
        As `Comparison.score`, of this part alone, JND.
    band_jnd : tuple of float
        As `Comparison.band_jnd`, of this part alone, JND.
    """

    score: float
    band_jnd: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Visible differences between two images.

    Attributes
    ----------
    jnd : (H, W) float32
        Differences pooled over the channels (and, with spatial pooling, over what an eye gathers
        that looks there), in just noticeable differences; 0 where not valid.
    probability : (H, W) float32
        1 - 0.25^jnd, the probability that the difference is seen there; 0 where not valid.
    valid : (H, W) bool
        Pixels that were judged.
    percent_visible : float
        Share of the valid pixels above 1 JND, percent; 0 when none is valid.
    band_jnd : tuple of float
        Per radial band, finest first and base last: J of the band's channels pooled over
        orientations and, as a mean, over the valid area, (mean sum_l J_kl^b)^(1/b), in JND; b is
        the exponent with which channels are pooled, 3.5 in the paper.
    score : float
        One number for the image, JND: the map pooled over the valid pixels, (mean J^3.5)^(1/3.5).
        It lies between the mean and the largest JND, nearer to the largest: small strong errors
        weigh more than faint large ones. In the paper's mode the bands add up to it,
        score^3.5 = sum_k band_jnd_k^3.5, but for interpolation (a few percent).
    steady, transient : Part
        What errors that stay contribute and what their change since the last frame does. Without
        a change all is steady. The two add up channel by channel, as bands do.
    """

    jnd: Float32Array
    probability: Float32Array
    valid: BoolArray
    percent_visible: float
    band_jnd: tuple[float, ...]
    score: float
    steady: Part
    transient: Part


@dataclass(frozen=True)
class PoolingRule:
    """How channels and places become one map.

    Attributes
    ----------
    exponent : float
        b, with which the J of channels are summed.
    spatial_exponent : float
        With which J is gathered over an aperture, if there is one.
    is_gathered : bool
        Whether the channels were gathered before they came (the transducer does).
    """

    exponent: float
    spatial_exponent: float
    is_gathered: bool


class Pool:
    """Sums the channels of one comparison, each at its own size.

    Parameters
    ----------
    bands : tuple of Band
        Bands of the Cortex transform.
    valid : (H, W) bool
        Pixels to judge.
    rule : PoolingRule
        Exponents.
    aperture : Aperture or None
        What gathers over space.
    """

    def __init__(
        self, bands: tuple[Band, ...], valid: BoolArray, rule: PoolingRule, aperture: Aperture | None
    ) -> None:
        self._valid = valid
        self._rule = rule
        self._aperture = aperture
        self._areas: dict[int, Float32Array] = {1: valid.astype(np.float32)}
        self._is_whole = bool(valid.all())
        self._sums: dict[bool, dict[int, Float32Array]] = {False: {}, True: {}}
        self._band_sums = {kind: [0.0] * len(bands) for kind in self._sums}

    def area(self, reduction: int) -> Float32Array | None:
        """How much of each coarse sample is judged, 0 to 1; None where all is."""
        return None if self._is_whole else self._area(reduction)

    def _area(self, reduction: int) -> Float32Array:
        if reduction not in self._areas:
            self._areas[reduction] = halve(self._area(reduction // 2))
        return self._areas[reduction]

    def add(self, level: int, power: Float32Array, reduction: int, *, is_transient: bool = False) -> None:
        """Add J^b of a channel or of a band of that level, a map at reduced size, which is kept."""
        sums = self._sums[is_transient]
        if reduction in sums:
            sums[reduction] += power
        else:
            sums[reduction] = power
        area = self.area(reduction)
        if area is None:
            pooled = float(power.mean(dtype=np.float64))
        else:
            weight = float(area.sum(dtype=np.float64))
            pooled = float(np.vdot(area, power)) / weight if weight else 0.0
        self._band_sums[is_transient][level - 1] += pooled

    def _map(self, sums: dict[int, Float32Array]) -> Float32Array:
        """J from the sums of channels: coarse ones interpolated to full size, root, gathered."""
        shape, rule, aperture = self._valid.shape, self._rule, self._aperture
        if not sums:
            return np.zeros(shape, dtype=np.float32)
        reduction = max(sums)
        total = sums[reduction]
        while reduction > min(sums):
            reduction //= 2
            total = double(total, halved_shape(shape, reduction))
            if reduction in sums:
                total += sums[reduction]
        if aperture is None or rule.is_gathered:
            total = root(total, rule.exponent)
            while reduction > 1:
                reduction //= 2
                total = double(total, halved_shape(shape, reduction))
            return total * self._valid
        area = self.area(reduction)
        total = root(total if area is None else total * area, rule.exponent / rule.spatial_exponent)
        (gathered,) = aperture.gather(aperture.coarse(total, reduction)[None], reduction)
        return aperture.full(root(gathered, rule.spatial_exponent)) * self._valid

    def _score(self, jnd: Float32Array) -> float:
        judged = max(int(np.count_nonzero(self._valid)), 1)
        total = float(raised(np.square(jnd)).sum(dtype=np.float64))
        return float((total / judged) ** (1.0 / POOLING_EXPONENT))

    def _band_jnd(self, *kinds: bool) -> tuple[float, ...]:
        sums = zip(*(self._band_sums[kind] for kind in kinds), strict=True)
        return tuple(sum(of_kinds) ** (1.0 / self._rule.exponent) for of_kinds in sums)

    def comparison(self) -> Comparison:
        """Finish: maps, probabilities, figures."""
        jnd = self._map(self._sums[False])
        score = steady = self._score(jnd)
        transient = 0.0
        if self._sums[True]:
            transient = self._score(self._map(self._sums[True]))
            jnd = self._map(_added(*self._sums.values()))
            score = self._score(jnd)
        return Comparison(
            jnd=jnd,
            probability=detection_probability(jnd),
            valid=self._valid,
            percent_visible=percent_visible(jnd, self._valid),
            band_jnd=self._band_jnd(False, True),
            score=score,
            steady=Part(steady, self._band_jnd(False)),
            transient=Part(transient, self._band_jnd(True)),
        )


def _added(*sums: dict[int, Float32Array]) -> dict[int, Float32Array]:
    steps = sorted({step for of_kind in sums for step in of_kind})
    return {
        step: np.sum([of_kind[step] for of_kind in sums if step in of_kind], axis=0, dtype=np.float32)
        for step in steps
    }
