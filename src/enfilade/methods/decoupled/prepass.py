"""The irradiance prepass: a rough estimate at half the light camera's size, for final gathering.

A final gather averages the irradiance of many points, so that it may be rough at each of them (Ward and
Heckbert 1992; Jensen 1996).
"""

from __future__ import annotations

import numpy as np

from enfilade.gbuffer import find_geometry
from enfilade.kernels.estimate import Estimate, Samples
from enfilade.methods.base import Output
from enfilade.methods.decoupled.denoising import denoise_irradiance
from enfilade.methods.decoupled.light_camera import light_camera, reduced
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Geometry
from enfilade.renderer import LobeRenderer, PixelFilter, Purpose
from enfilade.settings import DecoupledSettings, LimitSettings

REDUCTION = 2  # of width and height, from those of the light camera
SPP = 4


def prepass_geometry(walk: Walkthrough, frame: int) -> Geometry:
    """G-buffer of a prepass image."""
    return find_geometry(walk.renderer, reduced(light_camera(walk.path.cameras[frame]), REDUCTION))


def trace_prepass(walk: Walkthrough, renderer: LobeRenderer, frame: int) -> Output:
    """Path trace the prepass image of a keyframe."""
    geometry = prepass_geometry(walk, frame)
    where = geometry.has_diffuse
    estimate = Estimate(
        geometry.camera,
        np.flatnonzero(where).astype(np.uint32),
        lambda rays, sampler: Samples(
            renderer.estimate_diffuse(renderer.intersect(rays, opaque_only=True), sampler, path_depth=2)
        ),
        chunk=walk.settings[LimitSettings].paths_in_flight,
        pixel_filter=PixelFilter.CENTRE,
        random=walk.random(frame, Purpose.PREPASS),
        layers=2,
    )
    estimate.add(SPP)
    direct, indirect = (shading.to_image(where) for shading in estimate.shadings)
    image = IrradianceImage(direct, indirect, where)
    if (denoiser := walk.settings[DecoupledSettings].denoiser) != "none":
        # Without noise: all of the light that the denoiser loses is added again, since many paths gather it.
        image = denoise_irradiance(geometry, image.with_noise(0.0), denoiser)
    facts = {"rays": {"prepass": estimate.paths}, "dropped": image.direct.dropped}
    return Output({frame: image}, facts)
