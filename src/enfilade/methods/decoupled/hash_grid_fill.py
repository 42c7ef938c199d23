"""Filling the hash grid: irradiance at the end of paths on surfaces that no prepass image shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from enfilade.methods.base import Output
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.integrator import SPECULAR_AOVS
from enfilade.methods.decoupled.light_camera import LIGHT_PIXELS, light_camera
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.virtual_images import IMAGING
from enfilade.methods.decoupled.virtual_irradiance import trace_virtual_images
from enfilade.records import F32
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
    cache, walk = shot.prepass_cache(frame), shot.walk
    camera, geometry = light_camera(walk.path.cameras[frame]), shot.images.light_geometry(frame)

    def collect(levels: list[npt.NDArray[np.uint64]], irradiance: F32) -> None:
        parts.append(Entries.of(levels, irradiance, unit=shot.unit))

    # Path trace the surfaces that mirrors and panes show.
    virtual, count = trace_virtual_images(shot, frame)

    # Follow specular lobes from all pixels of the frame; those of mirrors and panes add no noisier estimates.
    random = walk.random(frame, Purpose.HASH_GRID)  # of two lists of pixels that have none in common
    forms_image = np.isin(geometry.surface, IMAGING).ravel()
    with_virtual = replace(cache, hash_grid=virtual.upload())
    for pixels, known in ((~forms_image, cache), (forms_image, with_virtual)):
        specular = shot.estimate(
            camera,
            pixels,
            lambda rays, sampler, known=known: shot.integrator.specular_radiance(
                known, shot.spawn(frame, rays, sampler), collect
            ),
            random,
            pixel_filter=PixelFilter.BOX,
            layers=SPECULAR_AOVS,
        )
        specular.add(SPECULAR_SPP)
        count += specular.count

    # See what prepass images don't show: surfaces that are clear for the most part, and thin ones.
    seen = shot.estimate(
        camera,
        np.ones(camera.width * camera.height, np.bool_),
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
    entries = Entries.joined([*parts, virtual])
    count += seen.count + gathered.count
    return Output({frame: entries}, {"rays": {"hash_grid": count.rays}, "dropped": count.dropped})
