"""Reprojection of image points between two pinhole cameras (McMillan 1997, §3.3 of the paper)."""

from __future__ import annotations

from typing import Any

import drjit as dr

from enfilade.arrays import Array2f, Array3f

NEAREST = 1e-3  # least ratio of new depth to old: points that come closer to the eye count as behind it


def reproject(x: Any, y: Any, disparity: Any, *, change: Any, epipole: Any) -> tuple[Any, Any, Any]:
    """Reproject image points to another camera.

    Parameters
    ----------
    x, y : Float
        Image coordinates, pixels.
    disparity : Float
        One over the depth; 0 at infinity.
    change : Matrix3f
    epipole : Array3f
        Of :class:`enfilade.camera.pinhole.PlanarWarp`.

    Returns
    -------
    flow : Array2f
        Displacement, pixels.
    depth_ratio : Float
        New depth over old, at least `NEAREST`.
    is_ahead : Bool
        Whether the point lies before the new camera; the displacement of others is undefined.
    """
    # Displace in homogeneous coordinates.
    u = change @ Array3f(x, y, 1) + disparity * epipole

    # Divide: (x + u) / (1 + u_z) - x, without the cancellation.
    ratio = 1.0 + u.z
    is_ahead = ratio > NEAREST
    ratio = dr.maximum(ratio, NEAREST)
    return Array2f(u.x - x * u.z, u.y - y * u.z) / ratio, ratio, is_ahead


def warp_jacobian(
    x: Any, y: Any, disparity: Any, gradient: Any, *, change: Any, epipole: Any
) -> tuple[Any, Any]:
    """Jacobian of the reprojection of points on a plane.

    Parameters
    ----------
    x, y, disparity : Float
    gradient : Array2f
        Derivative of the disparity by image coordinates, which is constant on a plane.
    change, epipole
        As of :func:`reproject`.

    Returns
    -------
    by_x, by_y : Array2f
        Derivatives of the new position by the old x and y.
    """
    # Reproject the points.
    u = change @ Array3f(x, y, 1) + disparity * epipole
    ratio = dr.maximum(1.0 + u.z, NEAREST)
    moved = Array2f(x + u.x, y + u.y) / ratio

    # Differentiate the quotient along each axis.
    columns = []
    for axis, slope in enumerate((gradient.x, gradient.y)):
        d = Array3f(change[0, axis], change[1, axis], change[2, axis]) + slope * epipole
        step = Array2f(d.x + (1 - axis), d.y + axis)
        columns.append((step - moved * d.z) / ratio)
    return columns[0], columns[1]
