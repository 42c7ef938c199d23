"""A flat wall, for tests of everything around the renderer: its pixels cost nothing."""

from __future__ import annotations

from pathlib import Path

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, UInt
from enfilade.camera.pinhole import Camera
from enfilade.records import F32, Shading, SurfaceClass
from enfilade.renderer import PixelFilter, RandomKey, Rays, SceneDescription, Surfaces


def load(file: Path, *, max_depth: int, paths_in_flight: int) -> Wall:
    """For ``Scene(file, renderer="support.wall:load")``."""
    del max_depth
    return Wall(file, paths_in_flight)


class Wall:
    """The plane z = 0 in front of the camera, and paths whose colours are plain noise."""

    def __init__(self, file: Path, paths_in_flight: int) -> None:
        self.folder = file.parent
        self.paths_in_flight = paths_in_flight

    def describe(self) -> SceneDescription:
        notes = [file.read_text() for file in self.folder.glob("notes")]
        return SceneDescription("wall", "none", ("wall",), notes=tuple(notes))

    def surfaces(self, rays: Rays) -> Surfaces:
        distance = -rays.origin.z / rays.direction.z
        return Surfaces(
            is_hit=distance > 0.0,
            distance=distance,
            normal=Array3f(0.0, 0.0, 1.0),
            albedo=Array3f(0.5, 0.6, 0.7) + 0.0 * distance,
            shape_index=dr.full(UInt, 1, dr.width(distance)),
            surface=dr.full(UInt, int(SurfaceClass.DIFFUSE), dr.width(distance)),
        )

    def trace(
        self,
        camera: Camera,
        pixels: npt.NDArray[np.uint32],
        random: RandomKey,
        *,
        spp: int,
        pixel_filter: PixelFilter = PixelFilter.CENTRE,
    ) -> Shading:
        del pixel_filter
        seed = (random.seed, random.frame, int(random.purpose), spp)
        image = np.random.default_rng(seed).random((camera.height * camera.width, 3), np.float32)
        color: F32 = image[pixels]
        return Shading(color, np.ones(len(pixels), np.float32))
