"""Differences of two noisy images of one scene by two renderers, without their noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from enfilade.kernels.tone import srgb_encode
from enfilade.records import F32

WINDOW_PX = 1.5  # standard deviation (Wang et al. 2004)
C1, C2 = 0.01**2, 0.03**2


@dataclass(frozen=True)
class Fidelity:
    """How near two renderers are.

    Attributes
    ----------
    mean_percent : float
        Largest difference of the channels' means, percent of the reference's mean luminance.
    structure : float
        1 - SSIM of the displayed images, over that of noise alone.
    """

    mean_percent: float
    structure: float


def compare(reference: tuple[F32, F32], image: tuple[F32, F32]) -> Fidelity:
    """Compare two halves of a reference with two halves of an image, all linear (H, W, 3).

    SSIM between halves of different renderers is divided by the geometric mean of that between halves of
    the same, which differ by noise alone.
    """
    first, second = 0.5 * (reference[0] + reference[1]), 0.5 * (image[0] + image[1])
    difference = (second.mean(axis=(0, 1)) - first.mean(axis=(0, 1))) / max(float(first.mean()), 1e-6)
    cross = np.mean([_ssim(a, b) for a in reference for b in image])
    noise = np.sqrt(_ssim(*reference) * _ssim(*image))
    return Fidelity(100.0 * float(np.abs(difference).max()), max(1.0 - float(cross / noise), 0.0))


def displayed(linear: F32) -> F32:
    """The sRGB curve, clipped at white."""
    return srgb_encode(np.clip(linear, 0.0, 1.0))


def _ssim(first: F32, second: F32) -> float:
    a, b = (displayed(image).mean(axis=-1) for image in (first, second))
    mean_a, mean_b = gaussian_filter(a, WINDOW_PX), gaussian_filter(b, WINDOW_PX)
    var_a = gaussian_filter(a * a, WINDOW_PX) - mean_a**2
    var_b = gaussian_filter(b * b, WINDOW_PX) - mean_b**2
    both = gaussian_filter(a * b, WINDOW_PX) - mean_a * mean_b
    similarity = (2 * mean_a * mean_b + C1) * (2 * both + C2)
    similarity /= (mean_a**2 + mean_b**2 + C1) * (var_a + var_b + C2)
    return float(similarity.mean())
