"""Monte Carlo estimates of lists of pixels, for all renderers and methods that trace paths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array2f, Array3f, Bool, Float, Float64, UInt, lanes, opaque, rows
from enfilade.camera.pinhole import Camera
from enfilade.kernels.random import PaddedSobolSampler, samplers
from enfilade.kernels.rays import box_offsets, camera_rays, gaussian_offsets, pixel_centres
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.records import F32, Shading
from enfilade.renderer import PixelFilter, RandomKey

SPP_PER_SUM = 64  # paths of a pixel summed in float32; fixed, so that no size of a batch changes a rounding
GAUSSIAN_SIGMA_PX, GAUSSIAN_RADIUS_PX = 0.5, 1.5  # PixelFilter.GAUSSIAN
# Width of the filter of confined pixels, whose values are averaged over pixels again (KITCHEN, `bathroom`).
CONFINED_FILTER = 0.5

Radiance = Callable[..., Any]


@dataclass(frozen=True)
class Samples:
    """Radiance of paths in several layers, as lanes.

    Attributes
    ----------
    layers : tuple of Array3f
        Averaged separately; a path counts only where all of them are finite.
    is_marked : Bool or None
        Flags of paths; a pixel has the flag if any of its paths has it.
    """

    layers: tuple[Any, ...]
    is_marked: Any = None


@dataclass(frozen=True)
class RayCount:
    """Number of rays that begin a path, and of those left out since their radiance was not finite."""

    rays: int = 0
    dropped: int = 0

    def __add__(self, other: RayCount) -> RayCount:
        """The sum of both."""
        return RayCount(self.rays + other.rays, self.dropped + other.dropped)


class Confined(NamedTuple):
    """Pixels whose camera rays have :data:`CONFINED_FILTER` of the filter's width, and limits.

    Attributes
    ----------
    where : (..., ) bool
    low, high : (..., 2) float32
        Limits of the rays' offsets from the centres, in pixels.
    """

    where: npt.NDArray[np.bool_]
    low: F32
    high: F32

    def of(self, pixels: npt.NDArray[Any]) -> Confined:
        """The same of some pixels, by a mask or their indices."""
        return Confined(self.where[pixels], self.low[pixels], self.high[pixels])


class Estimate:
    """Means over the paths of each pixel of a list, to which paths can be added.

    Parameters
    ----------
    camera
    pixels : (N,) uint32
        Flat indices ``y * width + x``.
    radiance
        Maps camera rays (:class:`Rays` of any length of direction) and their :class:`PaddedSobolSampler` to
        the radiance along them, an Array3f or :class:`Samples`. Called once for each batch.
    paths_in_flight
        Paths traced at once. It changes no random number.
    pixel_filter
        Distribution of the camera rays over the image.
    random
        Key of the random numbers.
    layers
        Number of layers of the samples that are light.
    auxiliary
        Number of those behind them, which are not.
    confined
        Pixels of the list whose rays meet a part of the surfaces that they show. None: no such pixels.
    """

    def __init__(
        self,
        camera: Camera,
        pixels: npt.NDArray[np.uint32],
        radiance: Radiance,
        *,
        paths_in_flight: int,
        pixel_filter: PixelFilter,
        random: RandomKey,
        layers: int = 1,
        auxiliary: int = 0,
        confined: Confined | None = None,
    ) -> None:
        self._camera = camera
        self._pixels = pixels
        self._radiance = radiance
        self._paths_in_flight = paths_in_flight
        self._filter = pixel_filter
        self._confined = confined
        self._random = random
        self._next = 0  # index of the next path of each pixel
        self._traced = 0  # paths of all pixels together
        size = max(len(pixels), 1)  # Dr.Jit can't compare empty arrays with a number
        self._layers = layers
        # In the order of `_summed`.
        self._sums = [dr.zeros(Float64, size) for _ in range(2 + 4 * (layers + auxiliary))]

    def add(self, spp: int, where: npt.NDArray[np.bool_] | None = None) -> None:
        """Trace more paths.

        Parameters
        ----------
        spp
            Paths a pixel.
        where : (N,) bool
            Pixels of the list; None for all of them.
        """
        everyone = np.ones(len(self._pixels), bool) if where is None else where
        chosen = np.flatnonzero(everyone).astype(np.uint32)
        for first in range(self._next, self._next + spp, SPP_PER_SUM):
            count = min(SPP_PER_SUM, self._next + spp - first)
            step = max(self._paths_in_flight // count, 1)
            for start in range(0, len(chosen), step):
                # Generate camera rays, `count` neighbouring lanes a pixel.
                part = chosen[start : start + step]
                slot, pixel, path = _numbered(self._pixels[part], first, count)
                sampler = samplers(pixel, path, self._random)
                offset = self._offset(sampler)
                if self._confined is not None:
                    where, low, high = map(lanes, self._confined.of(part))
                    nearer = dr.clip(
                        CONFINED_FILTER * offset,
                        dr.gather(Array2f, low, slot),
                        dr.gather(Array2f, high, slot),
                    )
                    offset = dr.select(dr.gather(Bool, where, slot), nearer, offset)
                rays = camera_rays(self._camera, pixel_centres(self._camera, pixel) + offset)

                # Trace them, and add the sums over each pixel's lanes to the totals.
                found = self._radiance(rays, sampler)
                samples = found if isinstance(found, Samples) else Samples((found,))
                self._accumulate(samples, offset, lanes(part), count)
        self._next += spp
        self._traced += spp * len(chosen)

    @property
    def count(self) -> RayCount:
        """Rays traced so far, of all pixels together."""
        return RayCount(self._traced, self._traced - round(dr.sum(self._sums[0])[0]))

    @property
    def shading(self) -> Shading:
        """Mean colour of each pixel over its finite samples, and the variance of its mean luminance, (N,)."""
        return self.shadings[0]

    @property
    def shadings(self) -> list[Shading]:
        """The same of every layer."""
        return self._read(self._means())

    def _read(self, found: list[tuple[Any, Any]]) -> list[Shading]:
        """Means and variances of layers, (N,)."""
        dr.eval(found)
        n, dropped = len(self._pixels), self.count.dropped
        return [Shading(rows(color)[:n], np.array(variance)[:n], dropped) for color, variance in found]

    def luminance(self, where: npt.NDArray[np.bool_] | None = None) -> tuple[Any, Any]:
        """Mean luminance of pixels, of all light together, and the sum of its layers' variances.

        Parameters
        ----------
        where : (N,) bool
            Pixels of the list, one at least; None for all of them.

        Returns
        -------
        mean, variance : Float
            A single lane where the list is empty.
        """
        chosen = None if where is None or where.all() else np.flatnonzero(where).astype(np.uint32)
        means = self._means(chosen)[: self._layers]
        color = sum((color for color, _ in means), Array3f(0))
        return dr.dot(color, Array3f(*REC709_LUMINANCE)), sum((variance for _, variance in means), Float(0))

    @property
    def is_marked(self) -> npt.NDArray[np.bool_]:
        """Pixels that have a marked path, (N,)."""
        return np.array(self._sums[1] > 0.0)[: len(self._pixels)]

    def _offset(self, sampler: PaddedSobolSampler) -> Any:
        """Offsets of camera rays from their pixel's centre, distributed by the pixel filter; Array2f."""
        match self._filter:
            case PixelFilter.BOX:
                return box_offsets(sampler.next_2d())
            case PixelFilter.GAUSSIAN:
                return gaussian_offsets(sampler.next_2d(), sigma=GAUSSIAN_SIGMA_PX, radius=GAUSSIAN_RADIUS_PX)
        return Array2f(0.0)

    def _accumulate(
        self,
        samples: Samples,
        offset: Any,  # noqa: ARG002  (used by `ReconstructedEstimate`)
        target: Any,
        count: int,
    ) -> None:
        """Add paths to the sums of their pixels.

        Parameters
        ----------
        samples
        offset : Array2f
            Of the paths, from their pixel's centre.
        target : UInt
            Indices of the pixels in the list.
        count
            Paths a pixel, in neighbouring lanes.
        """
        for total, value in zip(self._sums, _summed(samples, count), strict=True):
            dr.scatter_add(total, Float64(value), target, mode=dr.ReduceMode.NoConflicts)
        dr.eval(self._sums)

    def _means(self, chosen: npt.NDArray[np.uint32] | None = None) -> list[tuple[Any, Any]]:
        """Mean colour (Array3f) and variance of the mean luminance (Float) of every layer.

        Parameters
        ----------
        chosen : (M,) uint32
            Indices in the list of the pixels; None for all of them.
        """
        sums = self._sums
        if chosen is not None:
            index = lanes(chosen)
            sums = [dr.gather(Float64, total, index) for total in sums]
        count = dr.maximum(sums[0], 1.0)
        found = []
        for first in range(2, len(sums), 4):
            *mean, mean_square = (total / count for total in sums[first : first + 4])
            luminance = sum(weight * channel for weight, channel in zip(REC709_LUMINANCE, mean, strict=True))
            sample_variance = dr.maximum(mean_square - luminance * luminance, 0.0)
            variance = dr.select(count > 1.0, sample_variance / dr.maximum(count - 1.0, 1.0), 0.0)
            found.append((Array3f(*map(Float, mean)), Float(variance)))
        return found


def _numbered(pixels: npt.NDArray[np.uint32], first: int, count: int) -> tuple[Any, Any, Any]:
    """Index in the list, pixel, and index of each path, UInt: `count` neighbouring lanes a pixel."""
    lane = dr.arange(UInt, len(pixels) * count)
    slot = lane // opaque(count)
    return slot, dr.gather(UInt, lanes(pixels), slot), lane - slot * opaque(count) + opaque(first)


def is_finite(samples: Samples) -> Any:
    """Paths that count: those of finite radiance, the square of whose luminance does not overflow; Bool."""
    luminances = [dr.dot(Array3f(layer), Array3f(*REC709_LUMINANCE)) for layer in samples.layers]
    return dr.isfinite(sum((dr.square(value) for value in luminances), Float(0)))


def _summed(samples: Samples, count: int) -> list[Any]:
    """Sums over the `count` paths of each pixel.

    Returns
    -------
    list of Float
        Number of finite paths, number of marked ones; of each layer red, green, blue, squared luminance.
    """
    values, is_valid = [Float(1)], is_finite(samples)
    for layer in samples.layers:
        color = Array3f(layer)
        luminance = dr.dot(color, Array3f(*REC709_LUMINANCE))
        values += [*color, luminance * luminance]
    values = [dr.select(is_valid, v, 0) for v in values]
    if samples.is_marked is not None:
        values.append(dr.select(samples.is_marked, Float(1), 0))
    # Evaluate all together: each block_sum evaluates its input, and would trace the paths again.
    dr.eval(values)
    finite, *sums = (dr.block_sum(v, count) for v in values)
    marked = sums.pop() if samples.is_marked is not None else dr.zeros(Float, dr.width(finite))
    return [finite, marked, *sums]
