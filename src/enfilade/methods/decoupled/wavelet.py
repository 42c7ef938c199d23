"""Edge-avoiding wavelets (Dammertz et al. 2010; Schied et al. 2017), and fireflies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, Int, UInt, lanes, matrix3, opaque, pixel_grid
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.decoupled.surface_image import PLANE_TOLERANCE, Layer
from enfilade.records import Geometry, Mask

SPLINE = (1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0)  # cubic B-spline
TINY = 1e-8
SMOOTHING_LEVELS = 4
SMOOTHING_DEVIATIONS = 3.0  # of the luminance, across which it smooths
FIREFLY = 2.0  # times a neighbour's luminance: brighter pixels are fireflies
NORMAL_EXPONENT = 64  # of the cosine: normals 12 degrees apart have a weight of a quarter
# Neighbours at later levels are correlated, since they are averages over common pixels. They reduce the
# logarithm of the variance by this part of the reduction by independent ones (exact for a flat image).
INDEPENDENT, INDEPENDENT_BEYOND = (1.0, 0.613, 0.552, 0.539), 0.535


@dataclass(frozen=True)
class Guide:
    """Surfaces of an image, as lanes.

    Attributes
    ----------
    depths : Float
    normals : Array3f
    shape_indices : UInt
        Images, width * height lanes. Pixels of different shapes do not mix; those of 0 stay as they are.
    direction_from_pixel : Matrix3f
        Of the camera.
    width, height : int
    """

    depths: Any
    normals: Any
    shape_indices: Any
    direction_from_pixel: Any
    width: int
    height: int


def guide_of(geometry: Geometry, where: Mask) -> Guide:
    """Guide of the wavelet filter, for the pixels of a mask, (H, W)."""
    return Guide(
        depths=lanes(geometry.depth),
        normals=lanes(geometry.normal),
        shape_indices=lanes(np.where(where, geometry.shape_index, np.uint32(0))),
        direction_from_pixel=matrix3(geometry.camera.direction_from_pixel),
        width=geometry.camera.width,
        height=geometry.camera.height,
    )


def smooth_along(geometry: Geometry, where: Mask, color: Any, variance: Any) -> Layer:
    """Smooth an image along its surfaces by the wavelet filter.

    Parameters
    ----------
    geometry
    where : (H, W) bool
        Pixels that are smoothed; they mix with no others.
    color : Array3f
        Image, width * height lanes.
    variance : Float
        Of its luminance.

    Returns
    -------
    color : Array3f
    variance : Float
        Of the result.
    """
    guide = guide_of(geometry, where)
    return smooth(color, variance, guide, levels=SMOOTHING_LEVELS, deviations=SMOOTHING_DEVIATIONS)


def smooth(
    color: Any, variance: Any, guide: Guide, *, levels: int, deviations: float | None
) -> tuple[Any, Any]:
    """Smooth an image along its surfaces, where it differs within its noise.

    Edge-avoiding a-trous wavelets (Dammertz et al. 2010), guided by the variance (Schied et al. 2017).

    Parameters
    ----------
    color : Array3f
        With `deviations` None, a vector of any size.
    variance : Float
        Of the luminance.
    guide
    levels
        Of the wavelet; the last one reaches 2 ** levels pixels to each side.
    deviations
        Difference of luminance, in standard deviations, at which a pixel's weight falls to 1/e. None: no
        difference counts.

    Returns
    -------
    color
        As the input.
    variance : Float
        Of the result.
    """
    pixel: Any = dr.compress(guide.shape_indices > 0)
    if not dr.width(pixel):
        return color, variance
    related = Float(1)  # variance of the result over that of independent pixels
    for level in range(levels):
        step = opaque(1 << level, Int)
        *filtered, fraction = _filter_level(color, variance, guide, pixel, step, deviations)
        part = INDEPENDENT[level] if level < len(INDEPENDENT) else INDEPENDENT_BEYOND
        related *= fraction ** (part - 1.0)
        if level == levels - 1:
            filtered[1] *= related
        color, variance = (
            _replaced(of, pixel, own) for of, own in zip((color, variance), filtered, strict=True)
        )
        dr.eval(color, variance, related)
    return color, variance


def _filter_level(
    colors: Any, variances: Any, guide: Guide, pixel: Any, step: Any, deviations: float | None
) -> tuple[Any, Any, Any]:
    """One level, at some pixels.

    Returns
    -------
    color
    variance : Float
        As if pixels were independent.
    fraction : Float
        Ratio of the variance to the one before.
    """
    width, height = opaque(guide.width, Int), opaque(guide.height, Int)

    # Blur the variance.
    blurred = _blurred(variances, guide) if deviations else Float(0)
    dr.eval(blurred)

    # Prepare the distance of taps from this pixel's tangent plane.
    row = Int(pixel) // width
    column = Int(pixel) - row * width
    vector = type(colors)
    color, variance = dr.gather(vector, colors, pixel), dr.gather(Float, variances, pixel)
    own_blurred = dr.gather(Float, blurred, pixel) if deviations else blurred
    normal = dr.gather(Array3f, guide.normals, pixel)
    depth = dr.gather(Float, guide.depths, pixel)
    shape_index = dr.gather(UInt, guide.shape_indices, pixel)
    slope = guide.direction_from_pixel.T @ normal
    offset = depth * dr.dot(slope, Array3f(Float(column) + 0.5, Float(row) + 0.5, 1))
    nearness = dr.rcp(PLANE_TOLERANCE * depth + TINY)

    total, total_variance, squares = vector(0), Float(0), Float(0)
    weight, taken = Float(0), Float(0)
    for down, weight_y in zip(range(-2, 3), SPLINE, strict=True):
        for across, weight_x in zip(range(-2, 3), SPLINE, strict=True):
            i, j = column + across * step, row + down * step
            is_inside = (i >= 0) & (j >= 0) & (i < width) & (j < height)
            if not across and not down:
                weight += Float(weight_x * weight_y)
                continue
            # Weight the tap by the distance from the tangent plane, and by the cosine of the normals.
            tap = UInt(dr.select(is_inside, j * width + i, 0))
            is_same = is_inside & (dr.gather(UInt, guide.shape_indices, tap) == shape_index)
            beyond = dr.gather(Float, guide.depths, tap) * dr.dot(
                slope, Array3f(Float(i) + 0.5, Float(j) + 0.5, 1)
            )
            cosine: Any = dr.clip(dr.dot(normal, dr.gather(Array3f, guide.normals, tap)), 0.0, 1.0)
            surface = dr.exp(-dr.abs(beyond - offset) * nearness) * cosine**NORMAL_EXPONENT
            surface = dr.select(is_same, surface * Float(weight_x * weight_y), 0.0)

            # Weight it by the difference of luminance in units of the noise of both pixels.
            other, of_tap = dr.gather(vector, colors, tap), surface
            if deviations:
                deviation = deviations * dr.sqrt(own_blurred + dr.gather(Float, blurred, tap)) + TINY
                difference = dr.abs(dr.dot(other - color, Array3f(*REC709_LUMINANCE)))
                of_tap = surface * dr.exp(-difference / deviation)

            # Accumulate.
            total += of_tap * other
            total_variance += of_tap * of_tap * dr.gather(Float, variances, tap)
            squares += of_tap * of_tap
            weight += surface
            taken += of_tap

    # Give the weight of taps that differ too much to the pixel itself: leaving them out of the mean would
    # lose the energy of rare bright samples.
    own = weight - taken
    total += own * color
    total_variance += own * own * variance
    squares += own * own
    whole = weight * weight
    return total / weight, total_variance / whole, squares / whole


def redistribute_fireflies(color: Any, variance: Any, guide: Guide, *, levels: int) -> tuple[Any, Any]:
    """Distribute the energy of an image's fireflies along their surfaces; its total stays.

    The limit is in units of the second brightest neighbour's luminance, since fireflies also come in pairs.

    Parameters
    ----------
    color : Array3f
    variance : Float
        Of the luminance.
    guide
    levels
        Of the wavelet that distributes it, as of :func:`smooth`.

    Returns
    -------
    color : Array3f
    variance : Float
    """
    # Split the image into its clamped part and the remainder.
    kept = firefly_weights(color, width=guide.width, height=guide.height, rank=2)
    beyond = 1.0 - kept

    # Smooth the remainder, and add it again.
    smoothed, smoothed_variance = smooth(
        beyond * color, beyond * beyond * variance, guide, levels=levels, deviations=None
    )
    return kept * color + smoothed, kept * kept * variance + smoothed_variance


def firefly_weights(color: Any, *, width: int, height: int, rank: int = 1) -> Any:
    """Factors that clamp the fireflies of an image to twice the luminance of a neighbour; Float.

    Parameters
    ----------
    color : Array3f
        Image, width * height lanes.
    width, height
    rank
        1 for the brightest neighbour, 2 for the second brightest.
    """
    _, column, row = pixel_grid(height, width)
    columns, rows = opaque(width, Int), opaque(height, Int)

    # Find the brightest neighbours.
    luminance = dr.abs(dr.dot(color, Array3f(*REC709_LUMINANCE)))
    dr.eval(luminance)
    brightest = [Float(0)] * rank
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            if across or down:
                i, j = Int(column) + across, Int(row) + down
                is_inside = (i >= 0) & (j >= 0) & (i < columns) & (j < rows)
                around = dr.gather(Float, luminance, UInt(j * columns + i), is_inside)
                for place, other in enumerate(brightest):
                    brightest[place], around = dr.maximum(other, around), dr.minimum(other, around)

    # Clamp.
    limit = FIREFLY * brightest[-1]
    return dr.select(luminance > limit, limit / dr.maximum(luminance, TINY), 1.0)


def _replaced(image: Any, pixel: Any, values: Any) -> Any:
    """An image with other values at some pixels."""
    replaced = type(image)(image)  # `scatter` copies what is shared
    dr.scatter(replaced, values, pixel)
    return replaced


def _blurred(variance: Any, guide: Guide) -> Any:
    """Variance, blurred over 3x3 pixels to reduce its own noise."""
    _, column, row = pixel_grid(guide.height, guide.width)
    column, row = Int(column), Int(row)
    width, height = opaque(guide.width, Int), opaque(guide.height, Int)
    blurred = Float(0)
    for down, weight_y in zip((-1, 0, 1), (0.25, 0.5, 0.25), strict=True):
        for across, weight_x in zip((-1, 0, 1), (0.25, 0.5, 0.25), strict=True):
            i, j = dr.clip(column + across, 0, width - 1), dr.clip(row + down, 0, height - 1)
            blurred += weight_x * weight_y * dr.gather(Float, variance, UInt(j * width + i))
    return blurred
