"""What mirrors show, in the place where it is seen: the virtual image behind the mirror.

A plane mirror shows a point as far behind it as the point lies before it. That virtual image stands
still in the world, like any surface, so that its depth gives the flow of the reflection.
"""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import numpy as np

from enfilade.arrays import Float, UInt, lanes, matrix3, vector3
from enfilade.kernels.rays import pinhole_directions
from enfilade.records import Geometry, Mask, SurfaceClass
from enfilade.renderer import Rays, Renderer

__all__ = ["mirror_pixels", "mirrored"]

OFFSET = 1e-4  # of the distance: how far from the mirror a reflected ray begins
VIRTUAL = np.uint32(1 << 30)  # added to the number of a shape that is seen in a mirror


def mirror_pixels(geometry: Geometry) -> Mask:
    """Pixels that see a mirror, (H, W)."""
    is_mirror: Mask = geometry.surface == SurfaceClass.MIRROR
    return is_mirror


def mirrored(renderer: Renderer, geometry: Geometry) -> Geometry:
    """Geometry in which pixels on a mirror have what is seen in it, one reflection deep.

    Exact for plane mirrors. Depth is that of the virtual image along the camera's axis (0 where the mirror
    shows nothing), shape, albedo, normal and class are those of the surface that is seen; the shape's
    number is made another by :data:`VIRTUAL`, and its class is its own, so that it need not be specular.
    """
    pixels = np.flatnonzero(mirror_pixels(geometry)).astype(np.uint32)
    if not len(pixels):
        return geometry
    camera = geometry.camera
    lane = lanes(pixels)
    row = lane // camera.width
    direction = pinhole_directions(
        Float(lane - row * camera.width) + 0.5,
        Float(row) + 0.5,
        direction_from_pixel=matrix3(camera.direction_from_pixel),
    )
    depth = lanes(geometry.depth.ravel()[pixels])
    normal = lanes(np.ascontiguousarray(geometry.normal.reshape(-1, 1, 3)[pixels]))

    # Directions have unit depth and a reflection keeps their length: distances go on counting as depths.
    turned = direction - 2.0 * dr.dot(direction, normal) * normal
    origin = vector3(camera.eye) + depth * (direction + OFFSET * normal)
    seen = renderer.surfaces(Rays(origin=origin, direction=turned))
    found = {
        "depth": np.array(dr.select(seen.is_hit, depth + seen.distance, 0)),
        "normal": np.array(dr.select(seen.is_hit, seen.normal, 0)).T,
        "albedo": np.array(dr.select(seen.is_hit, seen.albedo, 0)).T,
        "shape_index": np.array(dr.select(seen.is_hit, seen.shape_index + UInt(int(VIRTUAL)), 0)),
        "surface": np.array(dr.select(seen.is_hit, seen.surface, 0)).astype(np.uint8),
    }
    layers = {}
    for name, values in found.items():
        layer = getattr(geometry, name).copy()
        layer.reshape(camera.width * camera.height, -1)[pixels] = values.reshape(len(pixels), -1)
        layers[name] = layer
    return replace(geometry, **layers)
