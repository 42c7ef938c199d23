"""Edges between the surfaces of a G-buffer, and surfaces too thin to be filtered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, image, lanes, opaque, pixel_grid
from enfilade.kernels.rays import points_at
from enfilade.methods.decoupled.edges import beside, dilated
from enfilade.methods.decoupled.surface_image import PLANE_TOLERANCE
from enfilade.records import F32, Geometry, Mask

CREASE_COSINE = 0.9  # between the normals of two pixels, below which they show different surfaces
RADIUS_PX = 2
# Of the 24 pixels around that show the same surface: a line of two pixels has 9, a straight edge 14.
MIN_SUPPORT = 10
MARGIN = 2  # pixels beside the edges of a surface that do not belong to its interior


def surface_edges(geometry: Geometry) -> tuple[Mask, Mask]:
    """Pixels at the edges of their surface, and those with little of it around them.

    Two pixels show the same surface if shape and normal agree, and each lies in the tangent plane of the
    other, within a part of the depth.

    Parameters
    ----------
    geometry
        Of shape (H, W).

    Returns
    -------
    is_edge : (H, W) bool
        One of the four neighbours shows another surface.
    is_thin : (H, W) bool
        Fewer than :data:`MIN_SUPPORT` of the pixels around show the same one.
    """
    compare = _comparison(geometry)
    is_edge, support = Bool(False), UInt(0)
    for down in range(-RADIUS_PX, RADIUS_PX + 1):
        for across in range(-RADIUS_PX, RADIUS_PX + 1):
            if not (down or across):
                continue
            # Pixels beyond the border count as the same surface.
            is_same, is_inside = compare(down, across)
            support += dr.select(is_same | ~is_inside, 1, 0)
            if abs(down) + abs(across) == 1:
                is_edge |= is_inside & ~is_same
    is_thin = support < MIN_SUPPORT
    dr.eval(is_edge, is_thin)
    shape = geometry.shape_index.shape
    return image(is_edge, *shape), image(is_thin, *shape)


def own_sides(geometry: Geometry) -> tuple[F32, F32]:
    """How far a pixel's surface goes on to its sides, in pixels: 1 where the next pixel shows it, else 0.

    Parameters
    ----------
    geometry
        Of shape (H, W).

    Returns
    -------
    low, high : (H, W, 2) float32
        To the left and above, 0 or less; to the right and below, 0 or more.
    """
    compare = _comparison(geometry)
    sides = [
        np.stack([image(Float(compare(*step)[0]), *geometry.shape_index.shape) for step in steps], axis=2)
        for steps in (((0, -1), (-1, 0)), ((0, 1), (1, 0)))
    ]
    return -sides[0], sides[1]


def _comparison(geometry: Geometry) -> Callable[[int, int], tuple[Any, Any]]:
    """Tells of pixels some rows down and columns across: whether of the same surface, and in the image."""
    height, width = geometry.shape_index.shape
    _, column, row = pixel_grid(height, width)
    columns, rows = opaque(width, Int), opaque(height, Int)
    index, depth, normal = lanes(geometry.shape_index), lanes(geometry.depth), lanes(geometry.normal)
    position = points_at(geometry.camera, depth)
    dr.eval(position)

    def compare(down: int, across: int) -> tuple[Any, Any]:
        i, j = Int(column) + across, Int(row) + down
        is_inside = (i >= 0) & (i < columns) & (j >= 0) & (j < rows)
        tap = UInt(dr.clip(j, 0, rows - 1) * columns + dr.clip(i, 0, columns - 1))
        there, bent = dr.gather(Array3f, position, tap) - position, dr.gather(Array3f, normal, tap)
        tolerance = PLANE_TOLERANCE * dr.minimum(depth, dr.gather(Float, depth, tap))
        is_same = dr.gather(UInt, index, tap) == index
        is_flat = (dr.dot(bent, normal) > CREASE_COSINE) & (dr.abs(dr.dot(there, normal)) <= tolerance)
        is_flat &= dr.abs(dr.dot(there, bent)) <= tolerance
        return is_same & (is_flat | (index == 0)), is_inside

    return compare


def narrow_surfaces(is_edge: Mask, where: Mask) -> Mask:
    """Pixels of surfaces, or of parts of them, that are narrower than six to seven pixels.

    A denoiser has few pixels there from which it could tell light from noise. Single pixels, such as the
    corners of wide surfaces, do not count.

    Parameters
    ----------
    is_edge : (H, W) bool
        Of :func:`surface_edges`.
    where : (H, W) bool
        Pixels of surfaces.

    Returns
    -------
    (H, W) bool
    """
    near = dilated(is_edge, MARGIN)
    wide = where & ~near
    for _ in range(2 * (MARGIN + 1)):  # as far as the corner of a wide surface
        # Of pixels that are no edges, the four neighbours show the same surface.
        padded = np.pad(wide & ~is_edge, 1)
        wide |= padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    narrow = where & near & ~wide
    return narrow & beside(narrow)
