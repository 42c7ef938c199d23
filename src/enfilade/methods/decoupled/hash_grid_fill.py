"""Filling the hash grid: irradiance at the end of paths on surfaces that no prepass image shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from enfilade.kernels.estimate import RayCount
from enfilade.methods.base import Output
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.integrator import SPECULAR_AOVS, OnMiss
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.light_camera import LIGHT_PIXELS, light_camera
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.virtual_images import IMAGING
from enfilade.methods.decoupled.virtual_irradiance import estimate_virtual_images
from enfilade.records import F32, Geometry, Mask
from enfilade.renderer import PixelFilter, Purpose

SPECULAR_SPP = 4  # specular rays of each pixel of the light camera
SEEN_SPP = 4  # camera rays of each pixel of the light camera
MAX_GATHER_SPP = 2  # final gather rays of each diffuse pixel of a prepass image (ATRIUM, GALLERY, KITCHEN)


def gather_spp(pixels: int) -> int:
    """Final gather rays of a pixel of a prepass image with so many pixels.

    Larger frames need fewer: the light of whole surfaces is uncertain, and that depends on their total.
    """
    return min(max(round(LIGHT_PIXELS / pixels), 1), MAX_GATHER_SPP)


def fill_hash_grid(shot: ShotContext, frame: int) -> Output:
    """Estimate irradiance where paths from a keyframe end on surfaces that no prepass image shows."""
    parts: list[Entries] = []
    cache, walk, collect = shot.prepass_cache(frame), shot.walk, _collector(shot, parts)
    camera, geometry = light_camera(walk.path.cameras[frame]), shot.images.light_geometry(frame)

    # Follow specular lobes; those of mirrors and panes have a pass of their own.
    count = _follow_specular(shot, frame, ~_forms_image(geometry), cache, collect, Purpose.HASH_GRID)

    # See what prepass images don't show: surfaces that are clear for the most part, and thin ones.
    seen = shot.estimate(
        camera,
        np.ones((camera.height, camera.width), np.bool_),
        lambda rays, sampler: shot.integrator.diffuse_radiance(
            cache, shot.spawn(frame, rays, sampler), collect
        ),
        walk.random(frame, Purpose.SEEN_HASH_GRID),
        pixel_filter=PixelFilter.GAUSSIAN,
        layers=1,
    )
    seen.add(SEEN_SPP)

    # Gather at the diffuse pixels of the prepass image. Final gathers look up the hash grid before other
    # prepass images, so that it needs the light of what these show, too.
    own = replace(cache, images=(), weights=())
    gathered = shot.estimate(
        geometry.camera,
        geometry.has_diffuse,
        lambda rays, sampler: shot.integrator.final_gather(own, shot.spawn(frame, rays, sampler), collect),
        walk.random(frame, Purpose.PREPASS_HASH_GRID),
    )
    gathered.add(gather_spp(camera.width * camera.height))

    # Sum up the estimates by entry.
    count += seen.count + gathered.count
    return Output(
        {frame: Entries.joined(parts)}, {"rays": {"hash_grid": count.rays}, "dropped": count.dropped}
    )


def fill_from_images(shot: ShotContext, frame: int) -> Output:
    """Estimate irradiance where mirrors and panes of a keyframe show surfaces that no prepass image shows."""
    parts: list[Entries] = []
    if not _forms_image(shot.images.virtual_geometry(frame)).any():
        return Output({frame: Entries.joined(parts)}, {"rays": {"virtual_images": 0}, "dropped": 0})
    prepass, collect = shot.prepass_cache(frame), _collector(shot, parts)

    # Follow their specular lobes.
    where = _forms_image(shot.images.light_geometry(frame))
    count = _follow_specular(shot, frame, where, prepass, collect, Purpose.VIRTUAL_HASH_GRID)
    single = Entries.joined(parts)

    # Estimate what they show together; the noisier estimates of single paths are not added there.
    cache = replace(prepass, hash_grid=shot.incomplete_hash_grid(frame, single))
    virtual, own = estimate_virtual_images(shot, frame, cache)
    count += own
    entries = Entries.joined([virtual, single.without(virtual)])
    return Output({frame: entries}, {"rays": {"virtual_images": count.rays}, "dropped": count.dropped})


def _collector(shot: ShotContext, parts: list[Entries]) -> OnMiss:
    """A function that appends estimates as entries to a list."""

    def collect(levels: list[npt.NDArray[np.uint64]], irradiance: F32) -> None:
        parts.append(Entries.of(levels, irradiance, unit=shot.unit))

    return collect


def _forms_image(geometry: Geometry) -> Mask:
    """Pixels of mirrors and panes; (H, W) bool."""
    return np.isin(geometry.surface, IMAGING)


def _follow_specular(
    shot: ShotContext, frame: int, where: Mask, cache: IrradianceCache, collect: OnMiss, purpose: Purpose
) -> RayCount:
    """Follow specular lobes from pixels of a keyframe to what the cache misses."""
    estimate = shot.estimate(
        light_camera(shot.walk.path.cameras[frame]),
        where,
        lambda rays, sampler: shot.integrator.specular_radiance(
            cache, shot.spawn(frame, rays, sampler), collect
        ),
        shot.walk.random(frame, purpose),
        pixel_filter=PixelFilter.BOX,
        layers=SPECULAR_AOVS,
    )
    estimate.add(SPECULAR_SPP)
    return estimate.count
