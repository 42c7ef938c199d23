"""A scene along a camera path: cameras, settings, renderer, G-buffers and path tracing for the methods."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from enfilade.cache import LruCache, images_within_memory
from enfilade.camera.path import CameraPath
from enfilade.gbuffer import View, find_geometry
from enfilade.kernels.tone import display_luminance
from enfilade.records import F32, Mask, Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Renderer
from enfilade.settings import Settings, TraceSettings, ViewingSettings

Timed = Callable[[str], AbstractContextManager[Any]]
CACHED_VIEWS = 8  # between the shading of a frame and its accumulation, decoupled uses seven


class Walkthrough:
    """A scene along a camera path.

    Parameters
    ----------
    path
    settings
    renderer
        With the scene loaded.
    timed
        Returns a context manager that measures the time of tracing, or of G-buffers, by its name.

    Attributes
    ----------
    path : CameraPath
    settings : Settings
    renderer : Renderer
    viewing : Viewing
    """

    def __init__(
        self, path: CameraPath, settings: Settings, renderer: Renderer, *, timed: Timed = nullcontext
    ) -> None:
        self.path = path
        self.settings = settings
        self.renderer = renderer
        self.viewing = settings[ViewingSettings].conditions(path.width, path.height, path.fps)
        self._timed = timed
        self._views: LruCache[int, View] = LruCache(
            images_within_memory(path.width * path.height, CACHED_VIEWS)
        )

    def view(self, frame: int) -> View:
        """G-buffer and motion vectors of a frame."""
        return self._views.get(frame, lambda: self._computed(frame))

    def _computed(self, frame: int) -> View:
        with self._timed("gbuffer"):
            geometry = find_geometry(self.renderer, self.path.cameras[frame])
        neighbours, is_at_rest = self.path.neighbours(frame), self.path.is_at_rest(frame)
        return View(geometry, *neighbours, self.viewing, is_at_rest=is_at_rest)

    def random(self, frame: int, purpose: Purpose) -> RandomKey:
        """Key of the random numbers of a frame for a purpose."""
        return RandomKey(self.settings[TraceSettings].seed, self.path.numbers[frame], purpose)

    def trace(
        self,
        frame: int,
        purpose: Purpose,
        *,
        spp: int,
        pixel_filter: PixelFilter,
        where: Mask | None = None,
    ) -> Shading:
        """Path trace a frame, or some pixels of it.

        Parameters
        ----------
        frame
        purpose
            Of the random numbers.
        spp
            Paths a pixel.
        pixel_filter
        where : (H, W) bool
            None: all pixels.

        Returns
        -------
        Shading
            Of shape (H, W); of some pixels (N,), in the order of rows.
        """
        shape = self.path.height, self.path.width
        pixels = np.arange(np.prod(shape)) if where is None else np.flatnonzero(where)
        with self._timed("trace"):
            traced = self.renderer.trace(
                self.path.cameras[frame],
                pixels.astype(np.uint32),
                self.random(frame, purpose),
                spp=spp,
                pixel_filter=pixel_filter,
            )
        if where is not None:
            return traced
        return Shading(traced.color.reshape(*shape, 3), traced.variance.reshape(shape), traced.dropped)

    def display_luminance(self, color: F32) -> F32:
        """Luminance of linear colours on the display, (H, W) cd/m2."""
        of = self.settings[ViewingSettings]
        luminance: F32 = display_luminance(
            color, exposure_ev=of.exposure_ev, peak_cd_m2=of.peak_cd_m2, black_cd_m2=of.black_cd_m2
        )
        return luminance
