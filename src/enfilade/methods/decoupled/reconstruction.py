"""Reconstruction of pixels from the paths of all pixels under their filter.

The weighted mean of samples, normalized by their weights (pbrt, 4th edition, §8.8; there over the
whole filter, here in each pixel that it covers).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt
import scipy.ndimage

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, lanes, opaque
from enfilade.camera.pinhole import Camera
from enfilade.kernels.estimate import (
    GAUSSIAN_RADIUS_PX,
    GAUSSIAN_SIGMA_PX,
    Estimate,
    Radiance,
    Samples,
    is_finite,
)
from enfilade.records import F32, Shading
from enfilade.renderer import PixelFilter, RandomKey

NEIGHBOURS = (-1, 0, 1)  # pixels, along each axis: the filter's radius is one and a half


class ReconstructedEstimate(Estimate):
    """Means of pixels under the Gaussian filter, to which the paths of the pixels around contribute.

    Paths are uniform over their own pixel. In each pixel that the filter covers, the mean of its paths is
    weighted by the filter; the nine means are added in proportion to the filter's integrals over the pixels.
    The deviation is 1.8 times lower than that of filter importance sampling with as many paths, and 2.3 to
    2.6 times lower at straight edges, but the noise of neighbouring pixels is correlated. Sums are kept for
    each pixel and neighbour, so that no result depends on an order of additions.

    Beyond the border of the image there are no paths: the filter is cut there, and normalized.

    Parameters
    ----------
    camera, pixels, radiance, paths_in_flight, random, layers, auxiliary
        As of :class:`Estimate`.
    reconstructed
        Number of layers that are reconstructed, the first ones; None: those that are light.
        :attr:`unfiltered` has all.
    background : sequence of (H, W, 3) float32
        One a layer: values of pixels that have no paths. None: such pixels do not contribute.
    """

    def __init__(
        self,
        camera: Camera,
        pixels: npt.NDArray[np.uint32],
        radiance: Radiance,
        *,
        paths_in_flight: int,
        random: RandomKey,
        layers: int = 1,
        auxiliary: int = 0,
        reconstructed: int | None = None,
        background: Sequence[F32] | None = None,
    ) -> None:
        super().__init__(
            camera,
            pixels,
            radiance,
            paths_in_flight=paths_in_flight,
            pixel_filter=PixelFilter.BOX,
            random=random,
            layers=layers,
            auxiliary=auxiliary,
        )
        self._reconstructed = layers if reconstructed is None else reconstructed
        size = max(len(self._pixels), 1)
        # Of each neighbour in the order of `_neighbours`: the weights, and the weighted colours by layer.
        self._weighted = [
            (dr.zeros(Float, size), [dr.zeros(Array3f, size) for _ in range(self._reconstructed)])
            for _ in _neighbours()
        ]
        place = np.full(self._camera.width * self._camera.height, len(self._pixels), np.uint32)
        place[self._pixels] = np.arange(len(self._pixels), dtype=np.uint32)
        self._place = lanes(place)  # index of each pixel in the list; the list's length if absent
        self._background = None if background is None else [lanes(layer) for layer in background]

    @property
    def unfiltered(self) -> list[Shading]:
        """Means of the paths of each pixel alone, of every layer, (N,): their noise is not correlated."""
        return self._read(super()._means())

    def _accumulate(self, samples: Samples, offset: Any, target: Any, count: int) -> None:
        dr.eval(samples.layers, offset)  # else both sums would trace the paths
        super()._accumulate(samples, offset, target, count)
        sums = _weighted_sums(samples, self._reconstructed, offset, dr.width(target), count)
        for totals, found in zip(self._weighted, sums, strict=True):
            for total, value in zip(_flat(totals), _flat(found), strict=True):
                dr.scatter_add(total, value, target, mode=dr.ReduceMode.NoConflicts)
        dr.eval(self._weighted)

    def _means(self, chosen: npt.NDArray[np.uint32] | None = None) -> list[tuple[Any, Any]]:
        # Find the columns and rows of the pixels, and the variances of all pixels by themselves.
        pixels = self._pixels if chosen is None else self._pixels[chosen]
        pixel = lanes(pixels) if len(pixels) else UInt(0)
        width, height = opaque(self._camera.width, Int), opaque(self._camera.height, Int)
        row = Int(pixel // UInt(width))
        column = Int(pixel) - row * width
        variances = [variance for _, variance in super()._means()[: self._reconstructed]]
        dr.eval(variances)

        # Add the means of the nine pixels, or their background.
        colors = [Array3f(0) for _ in variances]
        squared = [Float(0) for _ in variances]
        total = Float(0)
        for (dx, dy), (weight, weighted) in zip(_neighbours(), self._weighted, strict=True):
            # The sums for this pixel are stored at the neighbour (-dx, -dy).
            x, y = column - dx, row - dy
            is_inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
            at = UInt(y * width + x)
            place = dr.gather(UInt, self._place, at, is_inside)
            has_paths = is_inside & (place < opaque(len(self._pixels)))
            own = dr.gather(Float, weight, place, has_paths)
            has_paths &= own > 0.0
            share = _integral(dx) * _integral(dy)
            squared_share = _squared_integral(dx) * _squared_integral(dy)
            is_used = has_paths if self._background is None else is_inside
            total += dr.select(is_used, share, 0.0)
            for layer, colors_of in enumerate(weighted):
                mean = dr.gather(Array3f, colors_of, place, has_paths) / dr.select(has_paths, own, 1.0)
                if self._background is not None:
                    mean = dr.select(
                        has_paths, mean, dr.gather(Array3f, self._background[layer], at, is_inside)
                    )
                variance = dr.gather(Float, variances[layer], place, has_paths)
                colors[layer] += share * mean
                squared[layer] += squared_share * variance

        # Normalize.
        scale = dr.select(total > 0.0, dr.rcp(total), 0.0)
        return [(scale * c, scale * scale * v) for c, v in zip(colors, squared, strict=True)]


def smoothed(image: F32) -> F32:
    """An image, (H, W, 3), filtered as paths of equal weight in each pixel are."""
    weights = [_integral(offset) for offset in NEIGHBOURS]
    for axis in (0, 1):
        image = scipy.ndimage.correlate1d(image, weights, axis, mode="nearest")
    return image


def _neighbours() -> Iterator[tuple[int, int]]:
    """Offsets of the pixels that a path contributes to, row by row."""
    return ((dx, dy) for dy in NEIGHBOURS for dx in NEIGHBOURS)


def _integral(offset: int) -> float:
    """Of the filter along one axis, over the pixel at an offset; all together are one."""
    scale = GAUSSIAN_SIGMA_PX * math.sqrt(2.0)
    return _erf_over(offset, scale) / (2.0 * math.erf(GAUSSIAN_RADIUS_PX / scale))


def _squared_integral(offset: int) -> float:
    """Of the squared filter along one axis: its factor of the variance of independent samples."""
    kept = math.erf(GAUSSIAN_RADIUS_PX / (GAUSSIAN_SIGMA_PX * math.sqrt(2.0)))
    return _erf_over(offset, GAUSSIAN_SIGMA_PX) / (4.0 * math.sqrt(math.pi) * GAUSSIAN_SIGMA_PX * kept**2)


def _erf_over(offset: int, scale: float) -> float:
    return math.erf((offset + 0.5) / scale) - math.erf((offset - 0.5) / scale)


def _flat(totals: tuple[Any, list[Any]]) -> list[Any]:
    weight, colors = totals
    return [weight, *(channel for color in colors for channel in color)]


def _weighted_sums(
    samples: Samples, reconstructed: int, offset: Any, pixels: int, count: int
) -> list[tuple[Any, list[Any]]]:
    """Sums over the `count` paths of each of some pixels, weighted by the filters of its neighbours.

    Returns
    -------
    list of (Float, list of Array3f)
        Of each neighbour: the weights, and the weighted colours of the layers that are reconstructed.
    """
    layers, is_valid = [Array3f(color) for color in samples.layers[:reconstructed]], is_finite(samples)
    dr.eval(layers, is_valid)
    number = opaque(count)
    first = dr.arange(UInt, pixels) * number
    falloff = -0.5 / GAUSSIAN_SIGMA_PX**2

    def step(k: Any, sums: Any) -> tuple[Any, Any]:
        lane = first + k
        at = dr.gather(type(offset), offset, lane)
        is_used = dr.gather(Bool, is_valid, lane)
        colors = [dr.select(is_used, dr.gather(Array3f, color, lane), 0.0) for color in layers]

        # Weigh the path by the filters of its pixel and of the eight around it.
        across, down = ([dr.exp(falloff * dr.square(v - d)) for d in NEIGHBOURS] for v in at)
        weights = [dr.select(is_used, x * y, 0.0) for y in down for x in across]
        return k + 1, [
            (total + w, [have + w * color for have, color in zip(sums_of, colors, strict=True)])
            for (total, sums_of), w in zip(sums, weights, strict=True)
        ]

    _, found = dr.while_loop(
        state=(UInt(0), [(Float(0), [Array3f(0) for _ in layers]) for _ in _neighbours()]),
        cond=lambda k, _: k < number,
        body=step,
        labels=("k", "sums"),
        label="reconstruction",
    )
    return found
