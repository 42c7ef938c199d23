"""Image flow to the previous and the next frame, from depth and cameras (§3.3, Fig. 5)."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import image, lanes, matrix3, vector3
from enfilade.camera.pinhole import Camera, planar_warp
from enfilade.kernels.rays import pixel_centres
from enfilade.kernels.reproject import reproject
from enfilade.records import F32, Flow, Geometry


def image_flow(geometry: Geometry, previous: Camera | None, following: Camera | None) -> Flow:
    """Motion vectors of each pixel's surface point to the previous and the next frame.

    Parameters
    ----------
    geometry
        Of the frame itself. Pixels that see nothing move as points at infinity: with the camera's
        rotation alone.
    previous, following
        Neighbouring cameras of the same shot; None where there is none.

    Returns
    -------
    Flow
        Exact to float32: a displacement of one pixel is off by less than 1e-4 px. Points that the
        neighbouring camera has behind it get the flow of a point just before it.
    """
    camera = geometry.camera
    disparity = lanes(geometry.disparity)
    return Flow(
        backward=_flow_to(camera, disparity, previous),
        forward=_flow_to(camera, disparity, following),
        has_backward=previous is not None,
        has_forward=following is not None,
    )


def _flow_to(camera: Camera, disparity: Any, other: Camera | None) -> F32:
    height, width = camera.height, camera.width
    if other is None:
        return np.zeros((height, width, 2), np.float32)
    warp = planar_warp(camera, other)
    at = pixel_centres(camera)
    flow, _, _ = reproject(at.x, at.y, disparity, change=matrix3(warp.change), epipole=vector3(warp.epipole))
    dr.eval(flow)
    return image(flow, height, width)
