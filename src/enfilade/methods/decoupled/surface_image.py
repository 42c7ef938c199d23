"""Images of values at surfaces, on the device, and their lookup at points in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, Int, UInt, lanes, matrix3, opaque, vector3
from enfilade.kernels.bilinear import taps_around
from enfilade.records import Geometry

# Largest distance from the tangent plane on the same surface: a part of the depth; in lookups not more than a
# pixel's width along the surface either, so that the slats of a blind that are one mesh share no light.
PLANE_TOLERANCE = 0.01
MIN_PLANE_COSINE = 0.1  # between normal and direction of view: at grazing angles that width is limited
MIN_FOUND_WEIGHT = 0.02  # of all taps together, above which a surface counts as found
SCALE = 1022.0  # of an axis of a packed normal; even, so that 0 stays 0
MIN_TAP_WEIGHT = 1e-3  # of each valid tap
TAPER = 0.125  # of an image's width or height, over which its weight falls towards its borders
MIN_TAPER = 0.02  # of an image's weight at its borders, where it may be the only one that shows a surface

Layer = tuple[Any, Any]  # Array3f: values, Float: variance of their luminance


@dataclass(frozen=True)
class UploadedImage:
    """Values at the surfaces that a camera sees, on the device.

    Attributes
    ----------
    depths : Float
    shape_indices : UInt
        Images, width * height lanes; the depth of unknown pixels is 0.
    normals : UInt or None
        Of :func:`packed`; None where normals are not compared, as for virtual images.
    values : tuple of Array3f or Array3f16
    variances : tuple of Float
        One a layer; a literal 0 where it has none.
    eye : Array3f
    direction_from_pixel, pixel_from_direction : Matrix3f
        Of the camera.
    width, height : Int
        One lane each, so that one kernel serves images of all sizes.
    """

    depths: Any
    shape_indices: Any
    normals: Any | None
    values: tuple[Any, ...]
    variances: tuple[Any, ...]
    eye: Any
    direction_from_pixel: Any
    pixel_from_direction: Any
    width: Any
    height: Any


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
    coverage : Float
        Bilinear weight of the valid pixels, 0..1.
    taper : Float
        Falls from 1 to nearly 0 towards the borders of the image: where images are averaged with this
        weight, there is no seam at the border of one.
    """

    totals: tuple[Any, ...]
    variances: tuple[Any, ...]
    weight: Any
    coverage: Any
    taper: Any


def upload_layers(
    geometry: Geometry, is_known: Any, layers: Sequence[Layer], *, has_normals: bool = True
) -> UploadedImage:
    """Upload layers of an image into memory that is not shared with NumPy.

    Memory shared with NumPy can't be freed while a kernel is recorded.

    Parameters
    ----------
    geometry
    is_known : Bool
        Pixels that have values, width * height lanes.
    layers
        Values (Array3f) and variances of their luminance (Float), the same, or a literal 0.
    has_normals
        Whether normals are compared in lookups.
    """
    camera = geometry.camera
    literal = dr.VarState.Literal
    uploaded = UploadedImage(
        depths=dr.select(is_known, lanes(geometry.depth), 0.0),
        shape_indices=dr.select(is_known, lanes(geometry.shape_index), 0),
        normals=packed(lanes(geometry.normal)) if has_normals else None,
        values=tuple(dr.select(is_known, value, 0.0) for value, _ in layers),
        variances=tuple(v if v.state == literal else dr.select(is_known, v, 0.0) for _, v in layers),
        eye=vector3(camera.eye),
        direction_from_pixel=matrix3(camera.direction_from_pixel),
        pixel_from_direction=matrix3(camera.pixel_from_direction),
        width=opaque(camera.width, Int),
        height=opaque(camera.height, Int),
    )
    dr.eval(uploaded.depths, uploaded.shape_indices, uploaded.normals, uploaded.values, uploaded.variances)
    return uploaded


def blank_image() -> UploadedImage:
    """An image of one layer that shows nothing, in place of a missing one: one kernel serves any number.

    Its arrays are its own: Dr.Jit merges arrays that appear twice, which would make another kernel.
    """

    def zeros(kind: Any) -> Any:
        found = dr.zeros(kind, 2)  # gathering from a single lane would be another kernel
        dr.make_opaque(found)
        return found

    nowhere = np.zeros((3, 3))
    return UploadedImage(
        depths=zeros(Float),
        shape_indices=zeros(UInt),
        normals=zeros(UInt),
        values=(zeros(Array3f),),
        variances=(Float(0),),
        eye=vector3(np.zeros(3)),
        direction_from_pixel=matrix3(nowhere),
        pixel_from_direction=matrix3(nowhere),  # all points are behind its camera
        width=opaque(2, Int),
        height=opaque(1, Int),
    )


def lookup(
    position: Any,
    normal: Any,
    shape_index: Any,
    image: UploadedImage,
    *,
    min_cosine: float = 0.0,
    margin: float = 0.0,
) -> Found:
    """Interpolate an image at points in the world.

    Of the four pixels around a point's projection those are valid that show the same shape within
    :data:`PLANE_TOLERANCE` of the point's tangent plane, which excludes occluders and surfaces that meet at
    an edge. Pixels are weighted bilinearly and by the fourth power of the cosine between the normals, so that
    a bevel has its own light where a pixel shows it. Images of the back of the surface are not used.

    Parameters
    ----------
    position, normal : Array3f
        Points in world space, and surface normals on the shaded side, of any length.
    shape_index : UInt
    image
    min_cosine
        Least cosine between the normals.
    margin
        Pixels beyond the image's borders where its outermost pixels count.

    Returns
    -------
    Found
    """
    # Project the points.
    seen = image.pixel_from_direction @ (position - image.eye)
    is_ahead = seen.z > 0.0
    x, y = seen.x / seen.z - 0.5, seen.y / seen.z - 0.5
    right, bottom = Float(image.width) - 0.5, Float(image.height) - 0.5
    is_inside = is_ahead & (x > -0.5 - margin) & (y > -0.5 - margin)
    is_inside &= (x < right + margin) & (y < bottom + margin)
    across = dr.minimum(x + 0.5, right - x) / (TAPER * Float(image.width))
    down = dr.minimum(y + 0.5, bottom - y) / (TAPER * Float(image.height))
    taper = dr.clip(dr.minimum(across, down), MIN_TAPER, 1.0)

    # Prepare the distance of a pixel's point from the tangent plane: offset + depth * (slope . pixel).
    scale = dr.rcp(dr.norm(normal))
    offset = dr.dot(normal, image.eye - position) * scale
    slope = (image.direction_from_pixel.T @ normal) * scale
    tolerance = PLANE_TOLERANCE * seen.z
    if image.normals is not None:  # the planes of virtual images are not those of their surfaces
        m = image.direction_from_pixel
        width = dr.norm(Array3f(m[0, 0], m[1, 0], m[2, 0])) * seen.z
        cosine = offset * dr.rsqrt(dr.squared_norm(image.eye - position))
        tolerance = dr.minimum(tolerance, width * dr.rcp(dr.maximum(cosine, MIN_PLANE_COSINE)))
    is_inside &= offset > 0.0  # the camera is in front of the surface

    # Interpolate between the four neighbouring pixels.
    totals, variances = [Array3f(0) for _ in image.values], [Float(0) for _ in image.values]
    weight, coverage = Float(0), Float(0)
    for tap in taps_around(x, y, width=image.width, height=image.height):
        # Test that the pixel shows the same surface.
        depth = dr.gather(Float, image.depths, tap.lane, is_inside)
        pixel = Array3f(Float(tap.column) + 0.5, Float(tap.row) + 0.5, 1)
        distance = offset + depth * dr.dot(slope, pixel)
        is_same = is_inside & (dr.gather(UInt, image.shape_indices, tap.lane, is_inside) == shape_index)
        is_same &= (dr.abs(distance) <= tolerance) & (depth > 0.0)

        # Weight it, and accumulate its layers.
        of_tap = dr.select(is_same, tap.weight + MIN_TAP_WEIGHT, 0.0)
        if image.normals is not None:
            other = _unpacked(dr.gather(UInt, image.normals, tap.lane, is_inside))
            cosine = dr.dot(normal, other) * scale
            of_tap *= dr.select(cosine > min_cosine, dr.square(dr.square(cosine)), 0.0)
        for layer, (value, variance) in enumerate(zip(image.values, image.variances, strict=True)):
            totals[layer] += of_tap * Array3f(dr.gather(type(value), value, tap.lane, is_same))
            variances[layer] += of_tap * dr.gather(Float, variance, tap.lane, is_same)
        weight += of_tap
        coverage += dr.select(of_tap > 0.0, tap.weight, 0.0)
    return Found(tuple(totals), tuple(variances), weight, coverage, taper)


def packed(normal: Any) -> Any:
    """Unit vectors in 32 bits each, ten an axis; UInt."""
    x, y, z = (UInt(dr.round(dr.clip(0.5 + 0.5 * axis, 0.0, 1.0) * SCALE)) for axis in normal)
    return x | (y << 10) | (z << 20)


def _unpacked(word: Any) -> Any:
    """Vectors of :func:`packed`; Array3f."""
    return Array3f(word & 1023, (word >> 10) & 1023, word >> 20) * (2.0 / SCALE) - 1.0


def footprint(position: Any, normal: Any, eye: Any, direction_from_pixel: Any) -> Any:
    """Area of a surface that a pixel in the middle of a view covers at points, scene units squared; Float.

    At grazing angles it is limited to twenty times the area at normal incidence.
    """
    toward = position - eye
    squared = dr.squared_norm(toward)
    cosine = dr.abs(dr.dot(toward, normal)) * dr.rsqrt(squared * dr.squared_norm(normal))
    m = direction_from_pixel
    across, down = Array3f(m[0, 0], m[1, 0], m[2, 0]), Array3f(m[0, 1], m[1, 1], m[2, 1])
    return dr.norm(across) * dr.norm(down) * squared / dr.maximum(cosine, 0.05)
