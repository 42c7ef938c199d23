"""Adaptive sampling: more rays at edges, and where the displayed value of a pixel is uncertain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from enfilade.kernels.estimate import Estimate
from enfilade.kernels.tone import luminance, srgb_encode
from enfilade.methods.decoupled.edges import beside, dilated
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, U32, Mask, Shading
from enfilade.settings import DecoupledSettings, ViewingSettings

EDGE_SPP = 16  # rays of a pixel at an edge; their number doubles while its value is uncertain
DISPLAYED_DEVIATION = 0.0033  # times the square root of the quality: above it a displayed value is uncertain
SPECULAR_DEVIATION = 2.0  # times that: specular rays, which cost more than camera rays
SPECULAR_CONTRAST = 2.0 / 3.0  # times that: specular AOVs are refined where half their contrast exceeds it


@dataclass(frozen=True)
class AdaptiveSampling:
    """Numbers of rays by the uncertainty of what is displayed.

    Attributes
    ----------
    most : int
        Of a pixel.
    tolerance : float
        Standard deviation of a displayed value, 0..1.
    exposure_ev : float
        In stops.
    beneath : (H, W) float32 or float
        Luminance of what is displayed together with the estimates, and is certain.
    """

    most: int
    tolerance: float
    exposure_ev: float
    beneath: F32 | float = 0.0

    @staticmethod
    def of(walk: Walkthrough, *, times: float = 1.0, beneath: F32 | float = 0.0) -> AdaptiveSampling:
        """As the settings say, with a multiple of their tolerance."""
        settings = walk.settings[DecoupledSettings]
        exposure_ev = walk.settings[ViewingSettings].exposure_ev
        tolerance = times * displayed_tolerance(settings.quality)
        return AdaptiveSampling(settings.edge_spp, tolerance, exposure_ev, beneath)

    def matters(self, color: F32) -> Mask:
        """Pixels around which estimates differ by more than twice the tolerance, as displayed, (H, W)."""
        value = luminance(color)
        low, high = scipy.ndimage.minimum_filter(value, 3), scipy.ndimage.maximum_filter(value, 3)
        found: Mask = displayed_deviation_of(low, high, self.beneath, self.exposure_ev) > self.tolerance
        return found

    def uncertain(self, estimate: Estimate, sampled: Mask, spp: int | U32 | None = None) -> Mask:
        """Pixels whose displayed value is uncertain, (H, W); see :func:`displayed_deviation`."""
        layers = [shading.to_image(sampled) for shading in estimate.shadings]
        color, variance = (sum(getattr(of, name) for of in layers) for name in ("color", "variance"))
        deviation = displayed_deviation(Shading(color, variance), self.exposure_ev, spp, self.beneath)
        return deviation > self.tolerance

    def refine(self, estimate: Estimate, sampled: Mask, edges: Mask, within: Mask, spp: int) -> Mask:
        """Trace more rays at edges, and double them at uncertain pixels and beside them.

        Parameters
        ----------
        estimate
            Of the pixels of `sampled`, row by row.
        sampled : (H, W) bool
        edges, within : (H, W) bool
            Pixels that are refined first, and those to which it may spread; both are among `sampled`.
        spp
            Rays of a pixel so far.

        Returns
        -------
        (H, W) bool
            Pixels that have more rays now.
        """
        refined = np.zeros_like(edges)
        counts = np.full(edges.shape, spp, np.uint32)
        while spp < self.most and edges.any():
            more = min(max(spp, EDGE_SPP - spp), self.most - spp)
            estimate.add(more, edges[sampled])
            spp += more
            counts[edges] += more
            refined |= edges
            edges = within & dilated(edges & self.uncertain(estimate, sampled, counts))
        return refined

    def reduce_noise(self, estimate: Estimate, sampled: Mask, within: Mask, spp: int) -> None:
        """Double the rays beside uncertain pixels, then beside those of them that still are uncertain.

        Whether a pixel has more rays follows from its neighbours, not from its own rays. Otherwise those that
        found a rare bright path would be averaged with many others, those that missed it would stay as they
        are, and light would be lost. Some is lost even so, since the neighbours' rays depend on the pixel.

        Parameters
        ----------
        estimate, sampled, spp
            As of :meth:`refine`.
        within : (H, W) bool
            Pixels of `sampled` that may have more rays.
        """
        noisy = sampled
        while spp < self.most:
            noisy = within & beside(noisy & self.uncertain(estimate, sampled))
            if not noisy.any():
                return
            more = min(spp, self.most - spp)
            estimate.add(more, noisy[sampled])
            spp += more


def displayed_tolerance(quality: float) -> float:
    """Standard deviation of a displayed value, 0..1, above which its pixel has more camera rays."""
    return DISPLAYED_DEVIATION * math.sqrt(quality)


def displayed_deviation(
    shading: Shading, exposure_ev: float, spp: int | U32 | None = None, beneath: F32 | float = 0.0
) -> F32:
    """Standard deviation of the mean luminance as it is displayed, sRGB-encoded, 0..1; (H, W).

    Values above white count as white: where a quarter of sky makes a pixel white, its share of sky may be
    uncertain.

    Parameters
    ----------
    shading
        Estimates of pixels, (H, W).
    exposure_ev
        In stops.
    spp : int or (H, W) uint32
        Rays of a pixel, which may all have missed what makes the brightest pixel beside it bright. Its share
        is taken to be 1 / (spp + 1), in the manner of the rule of succession. None: leave this out.
    beneath : (H, W) float32 or float
        Luminance that is displayed together with it.
    """
    mean, deviation = luminance(shading.color), np.sqrt(shading.variance)
    if spp is not None:
        unseen = (scipy.ndimage.maximum_filter(mean, 3) - mean) / (np.float32(1) + np.float32(spp))
        deviation = np.maximum(deviation, unseen)
    return displayed_deviation_of(mean - deviation, mean + deviation, beneath, exposure_ev)


def displayed_deviation_of(low: F32, high: F32, beneath: F32 | float, exposure_ev: float) -> F32:
    """Half the difference between two luminances above what is displayed with them, sRGB-encoded, 0..1."""
    scale = np.float32(2.0**exposure_ev)
    low, high = (srgb_encode(np.clip((value + beneath) * scale, 0.0, 1.0)) for value in (low, high))
    return np.float32(0.5) * (high - low)
