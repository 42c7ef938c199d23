"""Frames with visibility of their own and light from the keyframes: ``--method decoupled``.

Every frame is shaded by itself: camera rays, textures and lobes are exact, and the light on diffuse
surfaces is looked up in the keyframes nearest on the path. What they don't know is path traced, for that
lookup alone.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation

from enfilade.irradiance import LightCache, smoothed
from enfilade.pipeline.finish import result_unit, write_frame_result
from enfilade.pipeline.light import LightTable
from enfilade.pipeline.workshop import Workshop
from enfilade.pixels.estimate import LUMINANCE, Estimate
from enfilade.records import Frame, Shading, Source
from enfilade.renderer import PixelFilter, Purpose

EDGE_CONTRAST = 0.001  # by JND of the quality: relative deviation above which a pixel takes more camera rays
NOISE_CONTRAST = 0.01  # the same of what lobes scatter, once it is smoothed


def make_frame(workshop: Workshop, table: LightTable, frame: int) -> None:
    """Shade a frame from the light of the pages around it."""
    if workshop.run.done(result_unit(workshop, frame)):
        return
    view = workshop.views[frame]
    with workshop.costs.of("gather"):
        near, cache = table.around(frame)
        seen = _seen(workshop, table, frame, near, cache)
    with workshop.costs.of("scatter"):
        scattered = _scattered(workshop, table, frame, cache, seen)
    height, width = view.geometry.item.shape
    color = seen.shading.color.reshape(height, width, 3) + scattered.color
    kind = Source.KEYFRAME if frame in table.keyframes else Source.REUSED
    made = Frame(color, np.full((height, width), kind, np.uint8))
    dropped = seen.shading.dropped + scattered.dropped
    write_frame_result(workshop, frame, view.geometry, view.flow, made, dropped)


def _seen(workshop: Workshop, table: LightTable, frame: int, view: LightCache, cache: LightCache) -> Estimate:
    """What surfaces emit and scatter diffusely; edges and fine textures get more camera rays."""
    path, settings = workshop.job.path, workshop.job.settings
    seen = Estimate(
        path.cameras[frame],
        np.arange(path.width * path.height, dtype=np.uint32),
        lambda rays, rng: table.shader.seen(view, cache, rays, rng),
        chunk=settings.trace.chunk,
        pixel_filter=PixelFilter.GAUSSIAN,
        random=workshop.random(frame, Purpose.GATHER),
    )
    seen.add(settings.light.least_samples)
    if settings.light.samples > settings.light.least_samples:
        shading = seen.shading
        limit = EDGE_CONTRAST * settings.light.quality
        is_edge = np.sqrt(shading.variance) > limit * _luminance(shading)
        seen.add(settings.light.samples - settings.light.least_samples, _grown(is_edge, path.width))
    return seen


def _scattered(
    workshop: Workshop, table: LightTable, frame: int, cache: LightCache, seen: Estimate
) -> Shading:
    """What surfaces scatter by all but their diffuse lobes, (H, W), smoothed.

    Pixels where noise is left get more rays.
    """
    path, settings = workshop.job.path, workshop.job.settings
    where = _grown(seen.is_marked, path.width)
    scattered = Estimate(
        path.cameras[frame],
        np.flatnonzero(where).astype(np.uint32),
        lambda rays, rng, square: table.shader.scattered(cache, rays, rng, square),
        chunk=settings.trace.chunk,
        pixel_filter=PixelFilter.GAUSSIAN,
        random=workshop.random(frame, Purpose.SCATTER),
        is_stratified=True,
    )
    least, most = settings.light.least_lobe_samples, settings.light.lobe_samples
    scattered.add(least)

    shown = table.shader.shown(workshop.views[frame].geometry)

    def image() -> Shading:
        return smoothed(shown, scattered.shading.spread(where.reshape(path.height, path.width)))

    if most > least:
        left = image()
        whole = _luminance(seen.shading) + _luminance(left).ravel()
        is_noisy = np.sqrt(left.variance).ravel() > NOISE_CONTRAST * settings.light.quality * whole
        scattered.add(most - least, _grown(is_noisy, path.width)[where])
    return image()


def _luminance(shading: Shading) -> npt.NDArray[np.float32]:
    mean: npt.NDArray[np.float32] = shading.color @ np.array(LUMINANCE, np.float32)
    return mean


def _grown(chosen: npt.NDArray[np.bool_], width: int) -> npt.NDArray[np.bool_]:
    """Pixels of a flat image, and those around them."""
    grown: npt.NDArray[np.bool_] = binary_dilation(chosen.reshape(-1, width), np.ones((3, 3), bool)).ravel()
    return grown
