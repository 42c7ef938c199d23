"""Noise-free renderer: a distant light without shadows, with exact outlines and textures.

The paper's ray tracer has no noise. Under path tracing, differences by reuse and filters are mixed with
noise. This renderer removes the noise, and with it the illumination of the scene.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Float, UInt, opaque
from enfilade.camera.pinhole import Camera
from enfilade.kernels.estimate import Estimate
from enfilade.records import Shading, SurfaceClass
from enfilade.renderer import PixelFilter, RandomKey, Rays, Renderer, SceneDescription, Surfaces

SUN = (0.36, 0.48, 0.8)  # direction of the light, world space
AMBIENT = 0.3  # share of the light that is the same from all directions
OFFSET = 1e-4  # of the distance: start of reflected and transmitted rays
PATHS_IN_FLIGHT = 4_194_304  # rays in flight


class NoiseFreeRenderer:
    """A renderer that shades the surfaces of another renderer with albedo times a cosine.

    Emitters are white and the background is black. Mirrors show the reflected surface and panes the
    transmitted one, one interaction deep and without loss. Glossy surfaces show their albedo.

    Parameters
    ----------
    renderer
        Renderer of the scene, used for its surfaces.
    """

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer

    def describe(self) -> SceneDescription:
        """Facts of the scene and of its renderer."""
        return self._renderer.describe()

    def surfaces(self, rays: Rays) -> Surfaces:
        """Find the first surface along each ray."""
        return self._renderer.surfaces(rays)

    def trace(
        self,
        camera: Camera,
        pixels: npt.NDArray[np.uint32],
        random: RandomKey,
        *,
        spp: int,
        pixel_filter: PixelFilter = PixelFilter.CENTRE,
    ) -> Shading:
        """Shade a list of pixels; see :meth:`enfilade.renderer.Renderer.trace`.

        All rays through a pixel's centre are identical: one is traced, and the variance is 0.
        """
        estimate = Estimate(
            camera,
            pixels,
            self._radiance,
            paths_in_flight=PATHS_IN_FLIGHT,
            pixel_filter=pixel_filter,
            random=random,
        )
        estimate.add(1 if pixel_filter is PixelFilter.CENTRE else spp)
        return estimate.shading

    def _radiance(self, rays: Rays, _sampler: Any) -> Any:
        # Shade the first surface.
        direct, hit = self._shaded(rays)
        is_mirror = hit.is_hit & (hit.surface == opaque(int(SurfaceClass.MIRROR), UInt))
        is_pane = hit.is_hit & (hit.surface == opaque(int(SurfaceClass.TRANSPARENT), UInt))

        # Shade the surface that a mirror reflects or a pane transmits.
        reflected = rays.direction - 2.0 * dr.dot(rays.direction, hit.normal) * hit.normal
        side = dr.select(is_mirror, Float(OFFSET), Float(-OFFSET))
        origin = rays.origin + hit.distance * (rays.direction + side * hit.normal)
        onward = Rays(
            dr.select(hit.is_hit, origin, rays.origin), dr.select(is_mirror, reflected, rays.direction)
        )
        second, _ = self._shaded(onward)
        return dr.select(is_mirror | is_pane, second, direct)

    def _shaded(self, rays: Rays) -> tuple[Any, Surfaces]:
        hit = self._renderer.surfaces(rays)
        cosine = dr.abs(dr.dot(hit.normal, Array3f(*SUN)))
        color = hit.albedo * (AMBIENT + (1.0 - AMBIENT) * cosine)
        is_emitter = hit.surface == opaque(int(SurfaceClass.EMISSIVE), UInt)
        return dr.select(hit.is_hit, dr.select(is_emitter, Array3f(1.0), color), Array3f(0.0)), hit
