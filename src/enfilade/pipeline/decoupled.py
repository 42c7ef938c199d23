"""Frames with visibility of their own and light from the keyframes: ``--method decoupled``.

Every frame is shaded by itself: camera rays, textures and lobes are exact, and the light on diffuse
surfaces is looked up in the keyframes nearest on the path. What they don't know is path traced, for that
lookup alone.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from enfilade.codec import read_shading, write_shading
from enfilade.errors import SettingsError
from enfilade.irradiance import LightCache, open_cache, shade
from enfilade.pipeline.finish import result_unit, write_frame_result
from enfilade.pipeline.workshop import Workshop
from enfilade.pixels.estimate import estimate
from enfilade.records import Frame, Keyframe, Segment, Shading, Source
from enfilade.renderer import LightRenderer, PixelFilter, Purpose

REACH = 1.5  # of the keyframes' spacing: how far along the path a keyframe counts
LEAST_WEIGHT = 1e-3  # of a keyframe farther away: it counts where no other knows the surface


class LightTable:
    """The light of the keyframes of a shot, traced when first asked for.

    Parameters
    ----------
    workshop
    segments
        The shot's initial segments.

    Raises
    ------
    SettingsError
        The renderer can't be asked for light.
    """

    def __init__(self, workshop: Workshop, segments: list[Segment]) -> None:
        if not isinstance(workshop.renderer, LightRenderer):
            name = workshop.renderer.describe().renderer
            raise SettingsError(f"{name} can't be asked for light: --method decoupled needs a Mitsuba scene")
        self.renderer: LightRenderer = workshop.renderer
        self._workshop = workshop
        self.frames = sorted({s.first for s in segments} | {s.last for s in segments})
        self._made: dict[int, Keyframe] = {}

    def near(self, frame: int) -> LightCache:
        """The keyframes nearest to a frame, weighted so that none comes or goes abruptly."""
        count = min(self._workshop.job.settings.light.keyframes, len(self.frames))
        nearest = sorted(self.frames, key=lambda k: (abs(k - frame), k))[:count]
        spacing = max((self.frames[-1] - self.frames[0]) / max(len(self.frames) - 1, 1), 1.0)
        closeness = [max(1.0 - abs(k - frame) / (REACH * spacing), LEAST_WEIGHT) for k in nearest]
        weights = [c / sum(closeness) for c in closeness]
        cache = open_cache([self.keyframe(k) for k in nearest], weights)
        self._made = {k: self._made[k] for k in nearest}
        return cache

    def keyframe(self, frame: int) -> Keyframe:
        """Light at what the pixels' centres of a keyframe see."""
        if frame not in self._made:
            geometry = self._workshop.views[frame].geometry
            self._made[frame] = Keyframe(frame, geometry, self._shading(frame))
        return self._made[frame]

    def _shading(self, frame: int) -> Shading:
        workshop = self._workshop
        number = workshop.number(frame)
        unit, file = f"keyframe {number}", workshop.run.file("keyframes", number)
        if workshop.run.done(unit):
            workshop.run.check(file)
            return read_shading(file)
        shading = self._trace(frame)
        write_shading(file, shading)
        workshop.finish(unit, [file], frame=number, dropped=shading.dropped)
        return shading

    def _trace(self, frame: int) -> Shading:
        workshop, renderer = self._workshop, self.renderer
        path, settings = workshop.job.path, workshop.job.settings.trace
        with workshop.costs.of("trace"):
            light = estimate(
                path.cameras[frame],
                _all_pixels(path.width, path.height),
                lambda rays, rng: renderer.light(renderer.lit(rays), rng),
                spp=settings.spp,
                chunk=settings.chunk,
                pixel_filter=PixelFilter.CENTRE,
                random=_random(workshop, frame, Purpose.LIGHT),
            )
        size = (path.height, path.width)
        return Shading(light.color.reshape(*size, 3), light.variance.reshape(size), light.dropped)


def make_frame(workshop: Workshop, table: LightTable, frame: int) -> None:
    """Shade a frame from the light of the keyframes around it."""
    if workshop.run.done(result_unit(workshop, frame)):
        return
    path, settings = workshop.job.path, workshop.job.settings
    cache = table.near(frame)
    renderer = table.renderer
    with workshop.costs.of("gather"):
        shading = estimate(
            path.cameras[frame],
            _all_pixels(path.width, path.height),
            lambda rays, rng: shade(renderer, cache, rays, rng),
            spp=settings.light.samples,
            chunk=settings.trace.chunk,
            pixel_filter=PixelFilter.GAUSSIAN,
            random=_random(workshop, frame, Purpose.GATHER),
        )
    view = workshop.views[frame]
    kind = Source.KEYFRAME if frame in table.frames else Source.REUSED
    source = np.full((path.height, path.width), kind, np.uint8)
    made = Frame(shading.color.reshape(path.height, path.width, 3), source)
    write_frame_result(workshop, frame, view.geometry, view.flow, made, shading.dropped)


def _all_pixels(width: int, height: int) -> npt.NDArray[np.uint32]:
    return np.arange(width * height, dtype=np.uint32)


def _random(workshop: Workshop, frame: int, purpose: Purpose) -> dict[str, int]:
    seed = workshop.job.settings.trace.seed
    return {"seed": seed, "frame": workshop.number(frame), "purpose": int(purpose)}
