"""Adaptive sampling: more rays at edges, and where the displayed value of a pixel is uncertain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt
import scipy.ndimage

from enfilade.arrays import Float, Int, UInt, image, lanes, opaque
from enfilade.kernels.estimate import Estimate
from enfilade.kernels.tone import (
    SRGB_GAMMA,
    SRGB_LINEAR_LIMIT,
    SRGB_OFFSET,
    SRGB_SLOPE,
    compressed,
    luminance,
)
from enfilade.methods.decoupled.edges import beside, dilated
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, U32, Mask, Shading
from enfilade.settings import DecoupledSettings, ViewingSettings

EDGE_SPP = 16  # rays of a pixel at an edge; their number doubles while its value is uncertain
DISPLAYED_DEVIATION = 0.0033  # times the square root of the quality: above it a displayed value is uncertain
SPECULAR_DEVIATION = 2.0  # times that: specular rays, which cost more than camera rays
SPECULAR_CONTRAST = 1.0 / 3.0  # times the first: AOVs are refined where half their contrast exceeds it
FAINT = 1.5  # times the first: AOVs are faint where half of what their rays change is below it
AROUND = 7  # pixels: the window over which rays are averaged
MIN_AROUND = 8  # sampled pixels of the window


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
    white : float
        Exposed luminance that the tone curve shows as white.
    """

    most: int
    tolerance: float
    exposure_ev: float
    beneath: F32 | float = 0.0
    white: float = 1.0

    @staticmethod
    def of(walk: Walkthrough, *, times: float = 1.0, beneath: F32 | float = 0.0) -> AdaptiveSampling:
        """As the settings say, with a multiple of their tolerance."""
        settings = walk.settings[DecoupledSettings]
        viewing = walk.settings[ViewingSettings]
        tolerance = times * displayed_tolerance(settings.quality)
        return AdaptiveSampling(settings.edge_spp, tolerance, viewing.exposure_ev, beneath, viewing.white)

    @property
    def reach(self) -> int:
        """Largest distance from an edge, in pixels, at which :meth:`refine` compares values.

        Each doubling of the rays spreads by one pixel, and compares with the pixels around.
        """
        doublings = max(math.ceil(math.log2(self.most / EDGE_SPP)), 0)
        return doublings + 1

    def has_visible_contrast(self, color: F32) -> Mask:
        """Pixels whose 3x3 neighbourhood spans more than twice the tolerance, as it is displayed, (H, W)."""
        shape = color.shape[0], color.shape[1]
        pixel = dr.arange(UInt, shape[0] * shape[1])
        low, high = _extremes(lanes(luminance(color)), pixel, shape)
        return image(self._exceeds(low, high, pixel), *shape)

    def is_faint(self, estimate: Estimate, sampled: Mask, spp: int) -> Mask:
        """Pixels where the estimates, and their noise, are hardly seen, (H, W).

        They are judged by the root mean square of single rays in the pixels around, not by their own rays:
        the mean of a pixel has no bias if its number of rays does not depend on what they have found.

        Parameters
        ----------
        estimate
            Of the pixels of `sampled`, row by row.
        sampled : (H, W) bool
        spp
            Rays of each pixel.
        """
        mean, variance = estimate.luminance()
        squared, known = np.zeros(sampled.shape), sampled.astype(np.float64)
        squared[sampled] = np.array(dr.square(mean) + (spp - 1.0) * variance)
        total, count = (_sum_around(of) - of for of in (squared, known))
        rms = np.sqrt(np.maximum(total, 0.0) / np.maximum(count, 1.0)).astype(np.float32)
        exceeds = self._exceeds(Float(0), lanes(rms), dr.arange(UInt, sampled.size))
        is_faint: Mask = sampled & (count + 0.5 > MIN_AROUND) & ~image(exceeds, *sampled.shape)
        return is_faint

    def uncertain(
        self, estimate: Estimate, sampled: Mask, among: Mask | None = None, counts: U32 | None = None
    ) -> Mask:
        """Pixels whose displayed value is uncertain, (H, W).

        Their mean luminance has a deviation above the tolerance as it is displayed. Values above white count
        as white: where a quarter of sky makes a pixel white, its share of sky may be uncertain.

        Parameters
        ----------
        estimate
            Of the pixels of `sampled`, row by row.
        sampled, among : (H, W) bool
            The latter: those of them that are evaluated; None: all.
        counts : (H, W) uint32
            Rays of each pixel, n, which may all have missed what makes the brightest pixel beside it bright.
            Its share is taken to be 1 / (n + 1), as by the rule of succession. None: no such share.
        """
        found = np.zeros_like(sampled)
        among = sampled if among is None else among
        if not among.any():
            return found
        evaluated = among if counts is None else sampled & dilated(among)
        mean, variance = estimate.luminance(evaluated[sampled])
        dr.eval(mean, variance)
        deviation, pixel = dr.sqrt(variance), lanes(np.flatnonzero(evaluated).astype(np.uint32))
        if counts is not None:
            means = dr.zeros(Float, sampled.size)
            dr.scatter(means, mean, pixel)
            _, brightest = _extremes(means, pixel, sampled.shape)
            rays = Float(dr.gather(UInt, lanes(counts), pixel))
            deviation = dr.maximum(deviation, (brightest - mean) / (1.0 + rays))
        found[evaluated] = np.array(self._exceeds(mean - deviation, mean + deviation, pixel))
        return found & among

    def _exceeds(self, low: Any, high: Any, pixel: Any) -> Any:
        """Whether two luminances of pixels (UInt, flat indices) differ by twice the tolerance; Bool.

        What is far below zero, as a lobe that is a difference may be by chance, is as uncertain as what is
        far above, though it is displayed as black.
        """
        of = self.beneath
        beneath = dr.gather(Float, lanes(of), pixel) if isinstance(of, np.ndarray) else opaque(float(of))
        low, high = low + beneath, high + beneath
        is_below = low + high < 0.0
        low, high = dr.select(is_below, -high, low), dr.select(is_below, -low, high)
        deviation = displayed_deviation(low, high, self.exposure_ev, white=self.white)
        return deviation > opaque(self.tolerance)

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
            edges = within & dilated(self.uncertain(estimate, sampled, edges, counts))
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
        noisy = sampled & dilated(within)
        while spp < self.most:
            noisy = within & beside(self.uncertain(estimate, sampled, noisy))
            if not noisy.any():
                return
            more = min(spp, self.most - spp)
            estimate.add(more, noisy[sampled])
            spp += more


def variance_around(light: Shading, sampled: Mask, counts: npt.NDArray[np.integer[Any]]) -> F32:
    """Variance of the luminance of single rays in the 7x7 pixels around each, (H, W).

    Parameters
    ----------
    light
        Means of shape (H, W), and their variances; 0 where no pixels were sampled.
    sampled : (H, W) bool
    counts : (H, W) integers
        Rays of each pixel.
    """
    mean = luminance(light.color).astype(np.float64)
    squared = np.square(mean) + (counts - 1.0) * light.variance
    count = np.maximum(_sum_around(sampled.astype(np.float64)), 1.0)
    variance = _sum_around(squared) / count - np.square(_sum_around(mean) / count)
    positive: F32 = np.maximum(variance, 0.0).astype(np.float32)
    return positive


def displayed_tolerance(quality: float) -> float:
    """Standard deviation of a displayed value, 0..1, above which its pixel has more camera rays."""
    return DISPLAYED_DEVIATION * math.sqrt(quality)


def displayed_deviation(low: Any, high: Any, exposure_ev: float, *, white: float = 1.0) -> Any:
    """Half the difference between two luminances (Float) as they are displayed, sRGB-encoded, 0..1.

    Views that show white from a higher luminance on, such as AgX, compress what is below it.
    """
    scale = opaque(2.0**exposure_ev)
    exposed = [dr.maximum(value * scale, 0.0) for value in (low, high)]
    if white > 1.0:
        exposed = [compressed(value, opaque(white)) for value in exposed]
    low, high = (_srgb_encode(dr.minimum(value, 1.0)) for value in exposed)
    return 0.5 * (high - low)


def _srgb_encode(linear: Any) -> Any:
    """:func:`enfilade.kernels.tone.srgb_encode` of lanes; Float."""
    power = dr.power(dr.maximum(linear, SRGB_LINEAR_LIMIT), 1.0 / SRGB_GAMMA)
    curved = (1.0 + SRGB_OFFSET) * power - SRGB_OFFSET
    return dr.select(linear <= SRGB_LINEAR_LIMIT, SRGB_SLOPE * linear, curved)


def _sum_around(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Sums over the pixels around each, and itself, (H, W)."""
    total: npt.NDArray[np.float64] = AROUND**2 * scipy.ndimage.uniform_filter(values, AROUND, mode="constant")
    return total


def _extremes(values: Any, pixel: Any, shape: tuple[int, ...]) -> tuple[Any, Any]:
    """Least and largest values of an image (H, W) in 3x3 pixels, cut at its border; Float, Float.

    Parameters
    ----------
    values : Float
        Of all pixels.
    pixel : UInt
        Flat indices of those in whose neighbourhood to look.
    shape : (H, W)
    """
    height, width = (opaque(size, Int) for size in shape)
    row = Int(pixel) // width
    column = Int(pixel) - row * width
    low = high = dr.gather(Float, values, pixel)
    for dy, dx in np.ndindex(3, 3):
        y, x = dr.clip(row + (dy - 1), 0, height - 1), dr.clip(column + (dx - 1), 0, width - 1)
        value = dr.gather(Float, values, UInt(y * width + x))
        low, high = dr.minimum(low, value), dr.maximum(high, value)
    return low, high
