"""Result of a comparison of two images: map, probability, percentage, bands and score (§3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enfilade.records import F32

MISS_AT_ONE_JND = 0.25  # §6: 1 JND is seen in 75 % of cases


@dataclass(frozen=True)
class Part:
    """Contribution of steady or of transient errors.

    Attributes
    ----------
    score : float
        As in `Comparison`, of this part alone, JND.
    band_jnd : tuple of float
        Per radial band, finest first and base last: J of the band's channels, pooled over the valid
        pixels as the score is, (mean J_k^3.5)^(1/3.5), in JND; J_k = (sum_l J_kl^b)^(1/b) over
        orientations, and b is the exponent of pooling over channels, 3.5 in the paper's mode and 1 in the
        modern one. But for interpolation (a few percent), the bands add up to the score in the paper's
        mode, score^3.5 = sum_k band_jnd_k^3.5; in the modern mode the score lies between the largest band
        and the sum of all.
    """

    score: float
    band_jnd: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Visible differences between two images.

    Attributes
    ----------
    jnd : (H, W) float32
        Differences pooled over the channels (in the modern mode also over the aperture around each
        pixel), in just noticeable differences; 0 where not valid.
    percent_visible : float
        Valid pixels above 1 JND, percent; 0 when none is valid.
    score : float
        One number for the image, JND: the map pooled over the valid pixels, (mean J^3.5)^(1/3.5).
        It lies between the mean and the largest JND, nearer to the largest: small strong errors
        weigh more than faint large ones.
    steady, transient : Part
        Errors that stay, and their change since the last frame. Without a change all is steady.
        The two add up channel by channel, as bands do.
    """

    jnd: F32
    percent_visible: float
    score: float
    steady: Part
    transient: Part

    @property
    def probability(self) -> F32:
        """Probability that each pixel's difference is seen, 1 - 0.25^J (§6), (H, W); 0 where not valid."""
        return np.asarray(-np.expm1(self.jnd * np.float32(np.log(MISS_AT_ONE_JND))), np.float32)
