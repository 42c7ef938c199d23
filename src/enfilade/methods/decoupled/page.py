"""Images of light on surfaces: smoothed along them, and made ready to be looked up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit as dr

from enfilade.arrays import Float, lanes, matrix3, pixel_grid, vector3
from enfilade.kernels.lookup import Page, packed
from enfilade.kernels.rays import pinhole_directions
from enfilade.kernels.wavelet import Guide, smooth
from enfilade.records import U32, Geometry

__all__ = ["KNOWN", "PLANE_TOLERANCE", "guide_of", "page_of", "points_of", "smooth_along"]

PLANE_TOLERANCE = 0.01  # of the depth
KNOWN = 0.02  # least weight of all taps together at which a surface counts as known
LEVELS = 4  # of the wavelet that smooths
DEVIATIONS = 3.0  # of the luminance, across which it smooths
NORMAL_EXPONENT = 64.0  # light on surfaces that are turned by 12 degrees mixes by a quarter


def smooth_along(geometry: Geometry, groups: U32, light: Any, variance: Any) -> tuple[Any, Any]:
    """Smooth light along surfaces, as far as its noise asks for.

    Parameters
    ----------
    geometry
    groups : (H, W) uint32
        Only pixels of the same number mix.
    light : Array3f
        Image, width * height lanes.
    variance : Float
        Of its luminance.

    Returns
    -------
    light : Array3f
    variance : Float
        That is left.
    """
    return smooth(light, variance, guide_of(geometry, groups), levels=LEVELS, deviations=DEVIATIONS)


def guide_of(geometry: Geometry, groups: U32) -> Guide:
    """What tells surfaces apart; pixels of different numbers, (H, W) uint32, never mix."""
    return Guide(
        depths=lanes(geometry.depth),
        normals=lanes(geometry.normal),
        shape_indices=lanes(groups),
        direction_from_pixel=matrix3(geometry.camera.direction_from_pixel),
        width=geometry.camera.width,
        height=geometry.camera.height,
        plane_tolerance=PLANE_TOLERANCE,
        normal_exponent=NORMAL_EXPONENT,
    )


def points_of(geometry: Geometry, depths: Any) -> Any:
    """Where pixels' centres meet surfaces at some depths, in the world."""
    camera = geometry.camera
    _, column, row = pixel_grid(camera.height, camera.width)
    direction = pinhole_directions(
        Float(column) + 0.5, Float(row) + 0.5, direction_from_pixel=matrix3(camera.direction_from_pixel)
    )
    return vector3(camera.eye) + depths * direction


def page_of(
    geometry: Geometry, is_known: Any, layers: Sequence[tuple[Any, Any]], *, has_normals: bool = True
) -> Page:
    """A page in memory of Dr.Jit's own: what shares NumPy's can't be freed while a kernel is recorded.

    Parameters
    ----------
    geometry
    is_known : Bool
        Pixels that have light, width * height lanes.
    layers
        Light (Array3f) and the variance of its luminance (Float), the same.
    has_normals
        Whether they say what a surface is.
    """
    camera = geometry.camera
    page = Page(
        depths=dr.select(is_known, lanes(geometry.depth), 0.0),
        shape_indices=dr.select(is_known, lanes(geometry.shape_index), 0),
        normals=packed(lanes(geometry.normal)) if has_normals else None,
        values=tuple(dr.select(is_known, light, 0.0) for light, _ in layers),
        variances=tuple(dr.select(is_known, variance, 0.0) for _, variance in layers),
        eye=vector3(camera.eye),
        direction_from_pixel=matrix3(camera.direction_from_pixel),
        pixel_from_direction=matrix3(camera.pixel_from_direction),
        width=camera.width,
        height=camera.height,
    )
    dr.eval(page.depths, page.shape_indices, page.normals, page.values, page.variances)
    return page
