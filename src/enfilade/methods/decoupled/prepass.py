"""The irradiance prepass: a rough estimate at the size of the light camera, for final gathering.

A final gather averages the irradiance of many points, so that it may be rough at each of them (Ward and
Heckbert 1992; Jensen 1996).
"""

from __future__ import annotations

from enfilade.kernels.estimate import RayCount, Samples
from enfilade.methods.base import Output
from enfilade.methods.decoupled.denoising import denoise_irradiance
from enfilade.methods.decoupled.guiding import find_regions
from enfilade.methods.decoupled.path_depth import light_by_depth
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.renderer import Purpose

SPP = 2
OUTLIER = 16.0  # times the denoised irradiance: brighter estimates are limited where the mean is kept


def trace_prepass(shot: ShotContext, frame: int) -> Output:
    """Path trace the prepass image of a keyframe."""
    walk, renderer, geometry = shot.walk, shot.renderer, shot.images.light_geometry(frame)
    where = geometry.has_diffuse
    regions, guide_paths = find_regions(
        renderer.photons(), shot.integrator.kernels.probe, geometry, walk.random(frame, Purpose.GUIDING)
    )
    guide = regions.upload() if regions else None
    estimate = shot.estimate(
        geometry.camera,
        where,
        lambda rays, sampler: Samples(
            renderer.estimate_diffuse(
                renderer.intersect(rays, opaque_only=True), sampler, path_depth=2, guide=guide
            )
        ),
        walk.random(frame, Purpose.PREPASS),
    )
    estimate.add(SPP)
    by_depth, ended = None, RayCount()
    if frame in shot.depth_keyframes:
        by_depth, ended = light_by_depth(
            renderer, geometry, guide, walk.random(frame, Purpose.DEPTHS), shot.estimate
        )
    direct, indirect = (shading.to_image(where) for shading in estimate.shadings)
    image = IrradianceImage(direct, indirect, where)
    if (denoiser := shot.settings.denoiser) != "none":
        # Without noise: all of the light that the denoiser loses is added again, since many paths gather it.
        image = denoise_irradiance(
            geometry, image.with_noise(0.0), denoiser, outlier=OUTLIER, is_excess_kept=True
        )
    count = estimate.count
    metadata = {
        "rays": {"prepass": count.rays, "path_depth": ended.rays, "path_guide": guide_paths},
        "dropped": (count + ended).dropped,
        "light_by_depth": by_depth,
        "regions": regions.to_json() if regions else [],
    }
    return Output({frame: image}, metadata)
