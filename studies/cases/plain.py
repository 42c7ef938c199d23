"""A scene lit by a distant lamp without shadows: outlines and textures as they are, and no noise.

The paper's ray tracer has no noise. Under path tracing what the metric says of reuse and of filters is mixed
with what it says of noise; this renderer takes the noise away, and the scene's own light with it.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Float, UInt, opaque
from enfilade.camera.pinhole import Camera
from enfilade.kernels.estimate import estimate
from enfilade.records import Shading, SurfaceClass
from enfilade.renderer import PixelFilter, RandomKey, Rays, Renderer, SceneFacts, Surfaces

__all__ = ["PlainlyLit"]

SUN = (0.36, 0.48, 0.8)  # direction of the lamp, in the world
AMBIENT = 0.3  # part of the light that comes from everywhere
OFFSET = 1e-4  # of the distance: how far from a mirror or a pane a ray goes on
CHUNK = 4_194_304  # rays in flight


class PlainlyLit:
    """A renderer that shades what another one finds: albedo times a cosine.

    What emits is white, what is beyond all surfaces black. Mirrors show what they reflect and panes what
    is behind them, one deep, without loss; gloss shows nothing but its albedo.

    Parameters
    ----------
    renderer
        Of the scene; asked for surfaces alone.
    """

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer

    def describe(self) -> SceneFacts:
        """Say what is rendered, and by what."""
        facts = self._renderer.describe()
        return SceneFacts(f"{facts.renderer}, plainly lit", facts.variant, facts.shapes)

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

        Rays through a pixel's centre are all the same: one is sent, and the variance is 0.
        """
        return estimate(
            camera,
            pixels,
            self._radiance,
            spp=1 if pixel_filter is PixelFilter.CENTRE else spp,
            chunk=CHUNK,
            pixel_filter=pixel_filter,
            random=random,
        )

    def _radiance(self, rays: Rays, _rng: Any) -> Any:
        direct, seen = self._shaded(rays)
        is_mirror = seen.is_hit & (seen.surface == opaque(int(SurfaceClass.MIRROR), UInt))
        is_pane = seen.is_hit & (seen.surface == opaque(int(SurfaceClass.TRANSPARENT), UInt))
        turned = rays.direction - 2.0 * dr.dot(rays.direction, seen.normal) * seen.normal
        side = dr.select(is_mirror, Float(OFFSET), Float(-OFFSET))
        origin = rays.origin + seen.distance * (rays.direction + side * seen.normal)
        onward = Rays(
            dr.select(seen.is_hit, origin, rays.origin), dr.select(is_mirror, turned, rays.direction)
        )
        behind, _ = self._shaded(onward)
        return dr.select(is_mirror | is_pane, behind, direct)

    def _shaded(self, rays: Rays) -> tuple[Any, Surfaces]:
        seen = self._renderer.surfaces(rays)
        facing = dr.abs(dr.dot(seen.normal, Array3f(*SUN)))
        color = seen.albedo * (AMBIENT + (1.0 - AMBIENT) * facing)
        is_lamp = seen.surface == opaque(int(SurfaceClass.EMISSIVE), UInt)
        return dr.select(seen.is_hit, dr.select(is_lamp, Array3f(1.0), color), Array3f(0.0)), seen
