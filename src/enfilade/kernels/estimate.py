"""Monte Carlo estimates of lists of pixels: what all backends that trace paths share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array2f, Array3f, Float, Float64, UInt, lanes, matrix3, opaque, rows, vector3
from enfilade.camera.pinhole import Camera
from enfilade.kernels.random import stratified, stratified4, streams
from enfilade.kernels.rays import box_offsets, gaussian_offsets, pinhole_directions
from enfilade.records import Shading
from enfilade.renderer import PixelFilter, RandomKey, Rays

PASS = 64  # paths of a pixel summed in one go; fixed, so that no chunking changes a rounding
GAUSSIAN_SIGMA_PX, GAUSSIAN_RADIUS_PX = 0.5, 1.5  # PixelFilter.GAUSSIAN
LUMINANCE = (0.2126, 0.7152, 0.0722)  # linear Rec.709

Radiance = Callable[..., Any]


@dataclass(frozen=True)
class Samples:
    """What paths bring, where that is more than one colour, as lanes.

    Attributes
    ----------
    layers : tuple of Array3f
        Averaged apart; a path counts only where all of them are finite.
    is_marked : Bool or None
        Marks paths, and so their pixels.
    """

    layers: tuple[Any, ...]
    is_marked: Any = None


class Estimate:
    """Averages of the paths of each pixel of a list, to which paths can be added.

    Parameters
    ----------
    camera
    pixels : (N,) uint32
    radiance
        What arrives along rays (:class:`Rays`, any length of direction), given a random number
        generator for each: an Array3f or :class:`Samples`. Called once a chunk.
    chunk
        Paths in flight at once. It changes no random number; what a renderer makes of them is its own.
    pixel_filter
        Where in the image the paths begin.
    random
        Of :func:`enfilade.kernels.random.streams`.
    layers
        How many ``radiance`` answers with.
    is_stratified
        Whether ``radiance`` is given an Array4f as a third argument: points of the unit cube that the paths
        of a pixel share out evenly among them.
    """

    def __init__(
        self,
        camera: Camera,
        pixels: npt.NDArray[np.uint32],
        radiance: Radiance,
        *,
        chunk: int,
        pixel_filter: PixelFilter,
        random: RandomKey,
        layers: int = 1,
        is_stratified: bool = False,
    ) -> None:
        self._camera = camera
        self._pixels = pixels
        self._radiance = radiance
        self._chunk = chunk
        self._filter = pixel_filter
        self._random = random
        self._next = 0  # numbers given to paths so far
        self._asked = 0
        self._layers = layers
        self._is_stratified = is_stratified
        size = max(len(pixels), 1)  # Dr.Jit can't compare no lanes with a number
        self._sums = [dr.zeros(Float64, size) for _ in range(2 + 4 * layers)]  # as _summed gives them

    def add(self, spp: int, where: npt.NDArray[np.bool_] | None = None) -> None:
        """Trace more paths, for all pixels of the list or for some of them.

        Parameters
        ----------
        spp
            Paths a pixel.
        where : (N,) bool
        """
        everyone = np.ones(len(self._pixels), bool) if where is None else where
        chosen = np.flatnonzero(everyone).astype(np.uint32)
        for first in range(self._next, self._next + spp, PASS):
            width = min(PASS, self._next + spp - first)
            step = max(self._chunk // width, 1)
            for start in range(0, len(chosen), step):
                part = chosen[start : start + step]
                pixel, path = _numbered(self._pixels[part], first, width)
                rng = streams(pixel, path, self._random)
                more = (stratified4(pixel, path, self._random),) if self._is_stratified else ()
                found = self._radiance(self._rays(pixel, path), rng, *more)
                for total, value in zip(self._sums, _summed(found, width), strict=True):
                    dr.scatter_add(total, Float64(value), lanes(part), mode=dr.ReduceMode.NoConflicts)
                dr.eval(self._sums)
        self._next += spp
        self._asked += spp * len(chosen)

    @property
    def paths(self) -> int:
        """Paths traced so far, of all pixels together."""
        return self._asked

    @property
    def shading(self) -> Shading:
        """Mean colour of each pixel over its finite samples, and the variance of its mean luminance."""
        return self.shadings[0]

    @property
    def shadings(self) -> list[Shading]:
        """The same of every layer."""
        count = dr.maximum(self._sums[0], 1.0)
        dropped = self._asked - round(dr.sum(self._sums[0])[0])
        found = []
        for first in range(2, len(self._sums), 4):
            *mean, square = (total / count for total in self._sums[first : first + 4])
            luminance = sum(share * channel for share, channel in zip(LUMINANCE, mean, strict=True))
            spread = dr.maximum(square - luminance * luminance, 0.0)
            variance = dr.select(count > 1.0, spread / dr.maximum(count - 1.0, 1.0), 0.0)
            found.append((Array3f(*map(Float, mean)), Float(variance)))
        dr.eval(found)
        n = len(self._pixels)
        return [Shading(rows(color)[:n], np.array(variance)[:n], dropped) for color, variance in found]

    @property
    def is_marked(self) -> npt.NDArray[np.bool_]:
        """Pixels that have a marked path, (N,)."""
        return np.array(self._sums[1] > 0.0)[: len(self._pixels)]

    def _rays(self, pixel: Any, path: Any) -> Rays:
        camera = self._camera
        row = pixel // opaque(camera.width)
        at = Array2f(pixel - row * opaque(camera.width), row) + 0.5
        match self._filter:
            case PixelFilter.BOX:
                at += box_offsets(stratified(pixel, path, self._random))
            case PixelFilter.GAUSSIAN:
                square = stratified(pixel, path, self._random)
                at += gaussian_offsets(square, sigma=GAUSSIAN_SIGMA_PX, radius=GAUSSIAN_RADIUS_PX)
        matrix = matrix3(camera.direction_from_pixel)
        return Rays(vector3(camera.eye), pinhole_directions(at.x, at.y, direction_from_pixel=matrix))


def estimate(
    camera: Camera,
    pixels: npt.NDArray[np.uint32],
    radiance: Radiance,
    *,
    spp: int,
    chunk: int,
    pixel_filter: PixelFilter,
    random: RandomKey,
) -> Shading:
    """Average the paths of each pixel: an :class:`Estimate` with as many paths for all.

    Returns
    -------
    Shading
        Of shape (N,), over the finite samples of each pixel.
    """
    whole = Estimate(camera, pixels, radiance, chunk=chunk, pixel_filter=pixel_filter, random=random)
    whole.add(spp)
    return whole.shading


def _numbered(pixels: npt.NDArray[np.uint32], first: int, width: int) -> tuple[Any, Any]:
    """Pixel and number of each path: `width` neighbouring lanes a pixel."""
    lane = dr.arange(UInt, len(pixels) * width)
    slot = lane // opaque(width)
    return dr.gather(UInt, lanes(pixels), slot), lane - slot * opaque(width) + opaque(first)


def _summed(answer: Any, width: int) -> list[Any]:
    """Sums over the paths of each pixel, lanes: finite, marked, then r, g, b, squared luminance a layer."""
    samples = answer if isinstance(answer, Samples) else Samples((answer,))
    values = []
    for layer in samples.layers:
        color = Array3f(layer)
        luminance = dr.dot(color, Array3f(*LUMINANCE))
        values += [*color, luminance * luminance]
    # What overflows when squared is no radiance either.
    is_valid = dr.isfinite(sum(values[3::4], Float(0)))
    values = [dr.select(is_valid, v, 0) for v in (Float(1), *values)]
    if samples.is_marked is not None:
        values.append(dr.select(samples.is_marked, Float(1), 0))
    # Together, before any sum: each block_sum evaluates its input, and would trace all anew.
    dr.eval(values)
    count, *sums = (dr.block_sum(v, width) for v in values)
    marked = sums.pop() if samples.is_marked is not None else dr.zeros(Float, dr.width(count))
    return [count, marked, *sums]
