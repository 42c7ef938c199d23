"""What a comparison of two images found: map, probability, share, bands and score (§3.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.cortex import Band
from enfilade.metric.pooling import (
    POOLING_EXPONENT,
    detection_probability,
    percent_visible,
    root,
)
from enfilade.metric.pyramid import double, halve, halved_shape

__all__ = ["Comparison", "Pool"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Visible differences between two images.

    Attributes
    ----------
    jnd : (H, W) float32
        Differences pooled over the channels, in just noticeable differences; 0 where not valid.
    probability : (H, W) float32
        1 - 0.25^jnd, the probability that the difference is seen there; 0 where not valid.
    valid : (H, W) bool
        Pixels that were judged.
    percent_visible : float
        Share of the valid pixels above 1 JND, percent; 0 when none is valid.
    band_jnd : tuple of float
        Per radial band, finest first and base last: J of the band's channels pooled over
        orientations and, as a mean, over the valid area, (mean sum_l J_kl^3.5)^(1/3.5), in JND.
    score : float
        One number for the image, JND: the map pooled over the valid pixels with the exponent of
        the channels, (mean J^3.5)^(1/3.5). It lies between the mean and the largest JND, nearer to
        the largest: small strong errors weigh more than faint large ones. The bands add up to it,
        score^3.5 = sum_k band_jnd_k^3.5, but for interpolation (a few percent).
    """

    jnd: Float32Array
    probability: Float32Array
    valid: BoolArray
    percent_visible: float
    band_jnd: tuple[float, ...]
    score: float


class Pool:
    """Sums the channels of one comparison, each at its own size.

    Parameters
    ----------
    bands : tuple of Band
        Bands of the Cortex transform.
    valid : (H, W) bool
        Pixels to judge.
    """

    def __init__(self, bands: tuple[Band, ...], valid: BoolArray) -> None:
        self._valid = valid
        self._sums: dict[int, Float32Array] = {}
        self._areas: dict[int, Float32Array] = {1: valid.astype(np.float32)}
        self._band_sums = [0.0] * len(bands)
        reduction = 1
        while reduction < bands[-1].reduction:
            self._areas[2 * reduction] = halve(self._areas[reduction])
            reduction *= 2
        for step, area in self._areas.items():
            self._sums[step] = np.zeros_like(area)

    def add(self, band: Band, power: Float32Array) -> None:
        """Add one channel's J^3.5, a map at the band's size."""
        self._sums[band.reduction] += power
        area = self._areas[band.reduction]
        weight = float(area.sum(dtype=np.float64))
        pooled = float(np.vdot(area, power))
        self._band_sums[band.level - 1] += pooled / weight if weight else 0.0

    def comparison(self) -> Comparison:
        """Finish: coarse sums interpolated to full size, roots, probabilities, figures."""
        valid = self._valid
        reduction = max(self._sums)
        total = self._sums[reduction]
        while reduction > 1:
            reduction //= 2
            total = double(total, halved_shape(valid.shape, reduction))
            total += self._sums[reduction]
        total *= valid
        jnd = root(total)
        judged = max(int(np.count_nonzero(valid)), 1)
        inverse = 1.0 / POOLING_EXPONENT
        return Comparison(
            jnd=jnd,
            probability=detection_probability(jnd),
            valid=valid,
            percent_visible=percent_visible(jnd, valid),
            band_jnd=tuple(pooled**inverse for pooled in self._band_sums),
            score=(float(total.sum(dtype=np.float64)) / judged) ** inverse,
        )
