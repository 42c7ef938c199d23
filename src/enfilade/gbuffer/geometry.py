"""The G-buffer of a frame: depth, shape and material of the surfaces visible at the pixels' centres (§1)."""

from __future__ import annotations

import drjit as dr
import numpy as np

from enfilade.arrays import image
from enfilade.camera.pinhole import Camera
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.records import F32, Geometry
from enfilade.renderer import Renderer


def find_geometry(renderer: Renderer, camera: Camera) -> Geometry:
    """Find the surfaces visible at the pixels' centres.

    Costs one ray a pixel (more where masked surfaces are looked through), and no shading.
    """
    height, width = camera.height, camera.width
    seen = renderer.surfaces(camera_rays(camera, pixel_centres(camera)))

    # Directions are of unit depth, so that distances along them are depths.
    depth = dr.select(seen.is_hit, seen.distance, 0)
    normal = dr.select(seen.is_hit, seen.normal, 0)
    albedo = dr.select(seen.is_hit, seen.albedo, 0)
    shape_index = dr.select(seen.is_hit, seen.shape_index, 0)
    surface = dr.select(seen.is_hit, seen.surface, 0)
    dr.eval(depth, normal, albedo, shape_index, surface)
    return Geometry(
        camera=camera,
        depth=image(depth, height, width),
        normal=image(normal, height, width),
        albedo=image(albedo, height, width),
        shape_index=image(shape_index, height, width),
        surface=image(surface, height, width).astype(np.uint8),
    )


def positions(geometry: Geometry) -> F32:
    """World positions of the visible surfaces, (H, W, 3) scene units; 0 where nothing is hit."""
    camera = geometry.camera
    x = np.arange(camera.width, dtype=np.float64) + 0.5
    y = np.arange(camera.height, dtype=np.float64) + 0.5
    p = camera.direction_from_pixel
    direction = x[None, :, None] * p[:, 0] + y[:, None, None] * p[:, 1] + p[:, 2]
    world = camera.eye + geometry.depth[..., None] * direction
    return np.where(geometry.is_hit[..., None], world, 0.0).astype(np.float32)
