"""Edges between the surfaces of a G-buffer, and surfaces too thin to be filtered."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, image, lanes, opaque, pixel_grid
from enfilade.kernels.rays import points_at
from enfilade.methods.decoupled.edges import beside, dilated
from enfilade.methods.decoupled.surface_image import PLANE_TOLERANCE
from enfilade.records import Geometry, Mask
from enfilade.renderer import Rays, Renderer

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
    height, width = geometry.shape_index.shape
    _, column, row = pixel_grid(height, width)
    columns, rows = opaque(width, Int), opaque(height, Int)
    index, depth, normal = lanes(geometry.shape_index), lanes(geometry.depth), lanes(geometry.normal)
    position = points_at(geometry.camera, depth)
    dr.eval(position)

    is_edge, support = Bool(False), UInt(0)
    for down in range(-RADIUS_PX, RADIUS_PX + 1):
        for across in range(-RADIUS_PX, RADIUS_PX + 1):
            if not (down or across):
                continue
            # Pixels beyond the border count as the same surface.
            i, j = Int(column) + across, Int(row) + down
            is_inside = (i >= 0) & (i < columns) & (j >= 0) & (j < rows)
            tap = UInt(dr.clip(j, 0, rows - 1) * columns + dr.clip(i, 0, columns - 1))

            # Compare the surfaces.
            there, bent = dr.gather(Array3f, position, tap) - position, dr.gather(Array3f, normal, tap)
            nearer = dr.minimum(depth, dr.gather(Float, depth, tap))
            is_same = dr.gather(UInt, index, tap) == index
            is_same &= _is_flat(there, normal, bent, nearer) | (index == 0)

            # Count.
            support += dr.select(is_same | ~is_inside, 1, 0)
            if abs(down) + abs(across) == 1:
                is_edge |= is_inside & ~is_same
    is_thin = support < MIN_SUPPORT
    dr.eval(is_edge, is_thin)
    return image(is_edge, height, width), image(is_thin, height, width)


def _is_flat(between: Any, one: Any, other: Any, depth: Any) -> Any:
    """Whether two points lie in the tangent planes of each other, and their normals agree; Bool.

    Parameters
    ----------
    between : Array3f
        Vector from one point to the other.
    one, other : Array3f
        Normals.
    depth : Float
        Of the nearer point.
    """
    tolerance = PLANE_TOLERANCE * depth
    is_within = (dr.abs(dr.dot(between, one)) <= tolerance) & (dr.abs(dr.dot(between, other)) <= tolerance)
    return is_within & (dr.dot(one, other) > CREASE_COSINE)


class OwnSurfaces:
    """Surfaces at the centres of a G-buffer's pixels; called with camera rays, tells whether they meet them.

    Parameters
    ----------
    renderer
    geometry
        Of shape (H, W).
    where : (H, W) bool
        Pixels whose rays are confined to them.
    """

    def __init__(self, renderer: Renderer, geometry: Geometry, where: Mask) -> None:
        self.where = where
        self._renderer, self._camera = renderer, geometry.camera
        self._indices, self._depths = lanes(geometry.shape_index), lanes(geometry.depth)
        self._normals = lanes(geometry.normal)

    def __call__(self, pixel: Any, rays: Rays) -> Any:
        """Whether camera rays meet the surface at the centre of a pixel.

        Parameters
        ----------
        pixel : UInt
            Flat indices.
        rays
            With directions of unit depth.

        Returns
        -------
        Bool
        """
        seen = self._renderer.surfaces(rays)
        depth = dr.gather(Float, self._depths, pixel)
        between = rays.origin + seen.distance * rays.direction - points_at(self._camera, depth, pixel)
        normal = dr.gather(Array3f, self._normals, pixel)
        is_same = seen.is_hit & (seen.shape_index == dr.gather(UInt, self._indices, pixel))
        return Bool(is_same & _is_flat(between, normal, seen.normal, dr.minimum(depth, seen.distance)))


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
