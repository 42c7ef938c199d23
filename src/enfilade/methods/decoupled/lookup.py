"""Lookup of images at points in the world, by reverse reprojection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Array3f, Float, Int, UInt

SCALE = 1022.0  # of an axis of a packed normal; even, so that 0 stays 0
MIN_TAP_WEIGHT = 1e-3  # of each valid tap: a single one at the border still counts


@dataclass(frozen=True)
class UploadedImage:
    """Values at the surfaces that a camera sees, on the device.

    Attributes
    ----------
    depths : Float
    shape_indices : UInt
        Images, width * height lanes; the depth of unknown pixels is 0.
    normals : UInt or None
        Of :func:`packed`; None where normals are not compared, as those of virtual images.
    values : tuple of Array3f
    variances : tuple of Float
        One a layer.
    eye : Array3f
    direction_from_pixel, pixel_from_direction : Matrix3f
        Of the camera.
    width, height : int
    """

    depths: Any
    shape_indices: Any
    normals: Any | None
    values: tuple[Any, ...]
    variances: tuple[Any, ...]
    eye: Any
    direction_from_pixel: Any
    pixel_from_direction: Any
    width: int
    height: int


@dataclass(frozen=True)
class Found:
    """Values found at points, as lanes.

    Attributes
    ----------
    totals : tuple of Array3f
        Weighted sums of the values, one a layer.
    variances : tuple of Float
        Weighted sums of the variances.
    weight : Float
        Sum of the weights; 0 where the surface is not in the image, at most about one.
    """

    totals: tuple[Any, ...]
    variances: tuple[Any, ...]
    weight: Any


def lookup(
    position: Any, normal: Any, shape_index: Any, image: UploadedImage, *, plane_tolerance: float
) -> Found:
    """Interpolate an image at points in the world.

    Of the four pixels around a point's projection those are valid that show the same shape, within a
    tolerance of the point's tangent plane: pixels of surfaces that occlude it, or meet it at an edge, are
    not. Pixels are weighted by the cosine between the normals, as the light differs, too. Images of the
    other side of a surface are not used.

    Parameters
    ----------
    position, normal : Array3f
        Points in the world, and surface normals on the side that is shaded, of any length.
    shape_index : UInt
    image
    plane_tolerance
        Distance from the tangent plane, by depth, up to which a pixel is of the same surface.

    Returns
    -------
    Found
    """
    # Project the points.
    seen = image.pixel_from_direction @ (position - image.eye)
    is_ahead = seen.z > 0.0
    x, y = seen.x / seen.z - 0.5, seen.y / seen.z - 0.5
    is_inside = is_ahead & (x > -0.5) & (y > -0.5) & (x < image.width - 0.5) & (y < image.height - 0.5)
    left, top = dr.floor(x), dr.floor(y)
    across, down = x - left, y - top

    # Prepare the distance of a pixel's point from the tangent plane: offset + depth * (slope . pixel).
    scale = dr.rcp(dr.norm(normal))
    offset = dr.dot(normal, image.eye - position) * scale
    slope = (image.direction_from_pixel.T @ normal) * scale
    tolerance = plane_tolerance * seen.z
    is_inside &= offset > 0.0  # the image shows the same side

    # Weight the four neighbouring pixels, and sum them up.
    totals, variances = [Array3f(0) for _ in image.values], [Float(0) for _ in image.values]
    weight = Float(0)
    for row, weight_y in ((0, 1.0 - down), (1, down)):
        for column, weight_x in ((0, 1.0 - across), (1, across)):
            i = dr.clip(Int(left) + column, 0, image.width - 1)
            j = dr.clip(Int(top) + row, 0, image.height - 1)
            lane = UInt(j * image.width + i)
            depth = dr.gather(Float, image.depths, lane, is_inside)
            distance = offset + depth * dr.dot(slope, Array3f(Float(i) + 0.5, Float(j) + 0.5, 1))
            is_same = is_inside & (dr.gather(UInt, image.shape_indices, lane, is_inside) == shape_index)
            is_same &= (dr.abs(distance) <= tolerance) & (depth > 0.0)
            share = dr.select(is_same, weight_x * weight_y + MIN_TAP_WEIGHT, 0.0)
            if image.normals is not None:
                turned = dr.dot(normal, _unpacked(dr.gather(UInt, image.normals, lane, is_inside))) * scale
                share *= dr.maximum(turned, 0.0)
            for layer, (value, variance) in enumerate(zip(image.values, image.variances, strict=True)):
                totals[layer] += share * dr.gather(Array3f, value, lane, is_same)
                variances[layer] += share * dr.gather(Float, variance, lane, is_same)
            weight += share
    return Found(tuple(totals), tuple(variances), weight)


def packed(normal: Any) -> Any:
    """Unit vectors in 32 bits each, ten an axis; UInt."""
    x, y, z = (UInt(dr.round(dr.clip(0.5 + 0.5 * axis, 0.0, 1.0) * SCALE)) for axis in normal)
    return x | (y << 10) | (z << 20)


def _unpacked(word: Any) -> Any:
    """Vectors of :func:`packed`; Array3f."""
    return Array3f(word & 1023, (word >> 10) & 1023, word >> 20) * (2.0 / SCALE) - 1.0


def footprint(position: Any, normal: Any, eye: Any, direction_from_pixel: Any) -> Any:
    """Area of a surface that a pixel in the middle of a view covers at points, scene units squared; Float.

    At grazing angles no more than twenty times that of a surface met head-on.
    """
    toward = position - eye
    squared = dr.squared_norm(toward)
    cosine = dr.abs(dr.dot(toward, normal)) * dr.rsqrt(squared * dr.squared_norm(normal))
    m = direction_from_pixel
    across, down = Array3f(m[0, 0], m[1, 0], m[2, 0]), Array3f(m[0, 1], m[1, 1], m[2, 1])
    return dr.norm(across) * dr.norm(down) * squared / dr.maximum(cosine, 0.05)
