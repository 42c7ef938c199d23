"""Virtual images: where that seems to be which mirrors show and glass lets through (§5.4's future work)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import PCG32, Array3f, Bool, Float, lanes, matrix3, opaque, rows, vector3
from enfilade.camera.pinhole import Camera
from enfilade.kernels.rays import pinhole_directions
from enfilade.kernels.replay import recorded
from enfilade.methods.decoupled.paths import Path, begun, chosen
from enfilade.records import Geometry, SurfaceClass
from enfilade.renderer import LobeRenderer, Rays

__all__ = ["BEHIND", "VirtualImages"]

BEHIND = np.uint32(1 << 30)  # added to the number of a shape that is seen in a mirror or through glass
CLEAR = (SurfaceClass.TRANSPARENT,)
SHARP = (SurfaceClass.MIRROR, *CLEAR)
ENDLESS = 1e4  # times as far as a mirror seems what it shows of the sky
REFLECTED, THROUGH = 0.000001, 0.999999  # choose the lobe that reflects light, and that which lets it through
LAYERS = 8  # of mirrors and glass, one behind the other


class VirtualImages:
    """Finds what is seen in mirrors and through glass."""

    def __init__(self, renderer: LobeRenderer) -> None:
        self._renderer = renderer
        self._look_on = recorded(self._look_on_kernel, lambda: renderer.state)

    def reflected(self, geometry: Geometry) -> Geometry:
        """What mirrors, and panes as far as they are mirrors, show in a frame, where it seems to be.

        Item and normal of pixels on a sharp surface become those of the surface at the end of the chain, with
        :data:`BEHIND` added to the shape's number, and the depth that of the
        virtual image: as far away as the way to it is long, which is exact for plane mirrors. Everything else
        stays.
        """
        return self._image(geometry, SHARP, REFLECTED)

    def transmitted(self, geometry: Geometry) -> Geometry:
        """What clear surfaces let through: as :meth:`reflected`, but pixels on mirrors stay, too."""
        return self._image(geometry, CLEAR, THROUGH)

    def _image(self, geometry: Geometry, kinds: Sequence[SurfaceClass], choice: float) -> Geometry:
        pixels = np.flatnonzero(np.isin(geometry.surface, kinds)).astype(np.uint32)
        if not len(pixels):
            return geometry
        shape_index, normal = geometry.shape_index.ravel().copy(), geometry.normal.reshape(-1, 3).copy()
        path = begun(*_centre_rays(geometry.camera, pixels), spread=0.0)
        path = chosen(path, path.lane)
        way = np.ones(len(shape_index), np.float32)  # in lengths of that to the surface itself
        first = geometry.depth.ravel() * _lengths(geometry.camera)
        count = len(pixels)  # of paths; what is added to have enough of them comes after
        for _ in range(LAYERS):
            path, found, turned, distance, is_image, is_sharp = self._look_on(path, opaque(choice))
            choice = THROUGH  # what a mirror shows of a pane is what lies behind that
            shown = np.array(is_image)[:count]  # rough glass shows none: what is seen is its own surface
            lane = pixels[np.array(path.lane)[:count][shown]]
            shape_index[lane] = np.array(found)[:count][shown] + BEHIND
            normal[lane] = rows(turned)[:count][shown]
            far = np.array(distance)[:count][shown] / first[lane]
            way[lane] = np.minimum(way[lane] + far, ENDLESS)
            going: Any = dr.compress(is_sharp)
            count = dr.width(going)
            if not count:
                break
            path = chosen(path, going)
        size = geometry.shape_index.shape
        return replace(
            geometry,
            depth=geometry.depth * way.reshape(size),
            shape_index=shape_index.reshape(size),
            normal=np.ascontiguousarray(normal.reshape(*size, 3)),
        )

    def _look_on_kernel(self, path: Path, choice: Any) -> tuple[Path, Any, Any, Any, Any, Any]:
        """Go through the surface that the rays meet, or be mirrored; and say what is met next.

        Also whether the one direction in which the surface sends the ray makes an image, and whether the
        image is of a surface that may make another.
        """
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.carries, opaque_only=True)
        sample = self._renderer.sample_specular(point, rng, choice)
        ahead = replace(path, rays=sample.rays, bounce=sample.bounce, rng=rng)
        surfaces = self._renderer.intersect(ahead.rays, ahead.bounce).surfaces
        is_sharp = Bool(False)
        for sharp in SHARP:
            is_sharp |= surfaces.surface == int(sharp)
        shape_index = dr.select(surfaces.is_hit, surfaces.shape_index, 0)
        # All of the sky has one normal, so that it is smoothed.
        normal = dr.select(surfaces.is_hit, surfaces.normal, Array3f(0.0, 0.0, 1.0))
        is_image = sample.is_alive & sample.bounce.is_delta
        is_sharp &= surfaces.is_hit & is_image
        return ahead, shape_index, Array3f(normal), Float(surfaces.distance), Bool(is_image), Bool(is_sharp)


def _centre_rays(camera: Camera, pixels: npt.NDArray[np.uint32]) -> tuple[Rays, Any]:
    """Rays through the centres of pixels, with a generator each."""
    pixel = lanes(pixels)
    row = pixel // opaque(camera.width)
    direction = pinhole_directions(
        Float(pixel - row * opaque(camera.width)) + 0.5,
        Float(row) + 0.5,
        direction_from_pixel=matrix3(camera.direction_from_pixel),
    )
    return Rays(vector3(camera.eye), direction), PCG32(dr.width(pixel))


def _lengths(camera: Camera) -> npt.NDArray[np.float32]:
    """Of the directions of unit depth through the centres of all pixels, (N,)."""
    row, column = np.indices((camera.height, camera.width)).reshape(2, -1) + 0.5
    directions = np.stack([column, row, np.ones_like(row)], axis=1) @ camera.direction_from_pixel.T
    lengths: npt.NDArray[np.float32] = np.linalg.norm(directions, axis=1).astype(np.float32)
    return lengths
