"""Noise-free guides of a denoiser: albedo and normal of each pixel."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array2f, Array3f, Bool, Float, UInt, lanes, opaque
from enfilade.camera.pinhole import Camera
from enfilade.errors import SettingsError
from enfilade.kernels.random import PaddedSobolSampler, samplers
from enfilade.kernels.rays import camera_rays
from enfilade.kernels.replay import padded, recorded
from enfilade.records import F32, SurfaceClass
from enfilade.renderer import Branch, LobeRenderer, Purpose, RandomKey, Rays, Renderer, Surfaces

RAYS = 16  # a pixel
BOUNCES = 6  # reflections and transmissions, before a path ends
IMAGING = (SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT)


class Guides:
    """Guides of the images of a scene.

    Parameters
    ----------
    renderer
    branch
        That is followed at interfaces, such as those of glass; None: by chance.
    """

    def __init__(self, renderer: Renderer, branch: Branch | None = None) -> None:
        self._renderer = renderer
        self._branch = branch
        if isinstance(renderer, LobeRenderer):
            self._extend = recorded(self._extend_kernel, renderer.state)

    def images(
        self, camera: Camera, *, seed: int, frame: int, paths_in_flight: int, is_followed: bool = False
    ) -> tuple[F32, F32]:
        """Albedo and normal of an image, through a box filter.

        Parameters
        ----------
        camera
        seed, frame
            Of the random numbers.
        paths_in_flight
            Rays traced at once; no result depends on it.
        is_followed
            Whether rays continue through mirrors and clear glass, as Open Image Denoise recommends, with a
            :class:`LobeRenderer`; otherwise they end at the first surface.

        Returns
        -------
        albedo : (H, W, 3) float32
            Diffuse reflectance times the throughput of mirrors and glass in front; 0 to 1, 0 where nothing is
            hit.
        normal : (H, W, 3) float32
            World-space normal of the surface where the path ends, averaged over the pixel (not normalized).

        Raises
        ------
        SettingsError
            The renderer does not support guides behind mirrors.
        """
        if is_followed and not isinstance(self._renderer, LobeRenderer):
            name = self._renderer.describe().renderer
            raise SettingsError(
                f"denoiser.guides=followed needs a renderer that separates lobes, which {name} does not; "
                "take first-hit"
            )
        pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
        step = max(paths_in_flight // RAYS, 1)
        random = RandomKey(seed, frame, Purpose.GUIDE)
        batches = []
        for first in range(0, len(pixels), step):
            rays, sampler = _stratified_rays(camera, pixels[first : first + step], random)
            albedo, normal = self.along(rays, sampler, is_followed=is_followed)
            sums = [np.array(dr.block_sum(v, RAYS)) for v in (*albedo, *normal)]
            batches.append(np.stack(sums) / np.float32(RAYS))
        found = np.concatenate(batches, axis=1).reshape(6, camera.height, camera.width).transpose(1, 2, 0)
        albedo_image = np.clip(found[..., :3], 0.0, 1.0)
        return np.ascontiguousarray(albedo_image), np.ascontiguousarray(found[..., 3:])

    def along(self, rays: Rays, sampler: Any, *, is_followed: bool) -> tuple[Any, Any]:
        """Albedo and normal along single rays, Array3f; see :meth:`images`."""
        hit = self._renderer.surfaces(rays)
        albedo, normal, forms_image = *_guides_of(hit), _is_sharp(hit)
        dr.eval(albedo, normal, forms_image, rays, sampler)
        if is_followed:
            self._follow(albedo, normal, forms_image, rays, sampler)
        return albedo, normal

    def _follow(self, albedo: Any, normal: Any, forms_image: Any, rays: Rays, sampler: Any) -> None:
        """Replace the guides of sharp surfaces by those of the surfaces behind."""
        lane = dr.arange(UInt, dr.width(forms_image))
        throughput = dr.full(Array3f, 1, dr.width(forms_image))
        rays = Rays(rays.origin + dr.zeros(Array3f, dr.width(forms_image)), rays.direction)
        for _ in range(BOUNCES):
            # Keep the paths at sharp surfaces.
            active: Any = dr.compress(forms_image)
            if not dr.width(active):
                return
            chosen, is_real = padded(active)
            lane, throughput = dr.gather(UInt, lane, chosen), dr.gather(Array3f, throughput, chosen)
            rays, sampler = dr.gather(Rays, rays, chosen), dr.gather(PaddedSobolSampler, sampler, chosen)
            dr.eval(lane, throughput, rays, sampler)

            # Reflect or transmit them, and find the next surfaces.
            rays, sampler, factor, next_albedo, next_normal, forms_image = self._extend(rays, sampler)
            throughput *= factor

            # Add their albedo, and take their normal.
            for target, value in zip(albedo, throughput * next_albedo, strict=True):
                dr.scatter_add(target, Float(value), lane, is_real, dr.ReduceMode.NoConflicts)
            for target, value in zip(normal, next_normal, strict=True):
                dr.scatter(target, value, lane, is_real)
            forms_image &= is_real
            dr.eval(albedo, normal, forms_image, throughput)

    def _extend_kernel(self, rays: Rays, sampler: Any) -> tuple[Any, ...]:
        """Scatter paths at a sharp surface, and find the next one."""
        assert isinstance(self._renderer, LobeRenderer)  # noqa: S101  (`__init__`)
        sampler = sampler.copy()
        point = self._renderer.intersect(rays, opaque_only=True)
        sample = self._renderer.sample_specular(point, sampler, branch=self._branch)
        hit = self._renderer.intersect(sample.rays, sample.bounce).surfaces
        throughput = Array3f(dr.select(sample.is_alive, sample.throughput, 0))
        return sample.rays, sampler, throughput, *_guides_of(hit), Bool(_is_sharp(hit) & sample.is_alive)


def _stratified_rays(camera: Camera, pixels: npt.NDArray[np.uint32], random: RandomKey) -> tuple[Rays, Any]:
    """Stratified rays through each pixel, in neighbouring lanes, and their samplers."""
    lane = dr.arange(UInt, len(pixels) * RAYS)
    slot = lane // RAYS
    pixel = dr.gather(UInt, lanes(pixels), slot)
    sampler = samplers(pixel, lane - slot * RAYS, random)
    row = pixel // opaque(camera.width)
    at = Array2f(pixel - row * opaque(camera.width), row) + sampler.next_2d()
    return camera_rays(camera, at), sampler


def _guides_of(hit: Surfaces) -> tuple[Any, Any]:
    return Array3f(dr.select(hit.is_hit, hit.albedo, 0)), Array3f(dr.select(hit.is_hit, hit.normal, 0))


def _is_sharp(hit: Surfaces) -> Any:
    found = Bool(False)
    for one in IMAGING:
        found |= hit.surface == int(one)
    return found & hit.is_hit
