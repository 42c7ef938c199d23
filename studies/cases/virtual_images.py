"""Virtual images of plane mirrors (§5.4, the paper's future work).

A plane mirror shows a point as far behind it as the point lies before it. This virtual image is static in the
world, like any surface, so that its depth gives the motion of the reflection.
"""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import numpy as np

from enfilade.arrays import Array2f, UInt, lanes, vector3
from enfilade.kernels.rays import camera_rays
from enfilade.records import Geometry, Mask, SurfaceClass
from enfilade.renderer import Rays, Renderer

OFFSET = 1e-4  # of the distance: start of reflected rays
VIRTUAL = np.uint32(1 << 30)  # added to the index of a shape that is seen in a mirror


def mirror_pixels(geometry: Geometry) -> Mask:
    """Pixels that show a mirror, (H, W)."""
    is_mirror: Mask = geometry.surface == SurfaceClass.MIRROR
    return is_mirror


def reflected_geometry(renderer: Renderer, geometry: Geometry) -> Geometry:
    """Geometry in which the pixels of mirrors contain the reflected surface, one reflection deep.

    Exact for plane mirrors. The depth is that of the virtual image along the camera's axis, 0 where the
    mirror reflects nothing. Shape index (plus :data:`VIRTUAL`), albedo, normal and class are those of the
    reflected surface, which need not be specular.
    """
    pixels = np.flatnonzero(mirror_pixels(geometry)).astype(np.uint32)
    if not len(pixels):
        return geometry
    camera = geometry.camera
    lane = lanes(pixels)
    row = lane // camera.width
    direction = camera_rays(camera, Array2f(lane - row * camera.width, row) + 0.5).direction
    depth = lanes(geometry.depth.ravel()[pixels])
    normal = lanes(np.ascontiguousarray(geometry.normal.reshape(-1, 1, 3)[pixels]))

    # Trace the reflected rays. Directions have unit depth, which reflection keeps: distances are depths.
    reflected = direction - 2.0 * dr.dot(direction, normal) * normal
    origin = vector3(camera.eye) + depth * (direction + OFFSET * normal)
    hit = renderer.surfaces(Rays(origin=origin, direction=reflected))
    found = {
        "depth": np.array(dr.select(hit.is_hit, depth + hit.distance, 0)),
        "normal": np.array(dr.select(hit.is_hit, hit.normal, 0)).T,
        "albedo": np.array(dr.select(hit.is_hit, hit.albedo, 0)).T,
        "shape_index": np.array(dr.select(hit.is_hit, hit.shape_index + UInt(int(VIRTUAL)), 0)),
        "surface": np.array(dr.select(hit.is_hit, hit.surface, 0)).astype(np.uint8),
    }

    # Replace the pixels of mirrors.
    layers = {}
    for name, values in found.items():
        layer = getattr(geometry, name).copy()
        layer.reshape(camera.width * camera.height, -1)[pixels] = values.reshape(len(pixels), -1)
        layers[name] = layer
    return replace(geometry, **layers)
