"""Virtual images: apparent positions of surfaces seen in mirrors and through glass (future work of §5.4).

Reprojecting them gives motion vectors of reflections and transmissions (Zimmer et al. 2015).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import PCG32, Array3f, Bool, Float, lanes, opaque, rows
from enfilade.camera.pinhole import Camera
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.kernels.replay import recorded
from enfilade.methods.decoupled.paths import Path, compact, spawn
from enfilade.records import Geometry, SurfaceClass
from enfilade.renderer import LobeRenderer

__all__ = ["IN_VIRTUAL_IMAGE", "VirtualImages"]

IN_VIRTUAL_IMAGE = np.uint32(1 << 30)  # added to the index of shapes seen in mirrors or through glass
CLEAR = (SurfaceClass.TRANSPARENT,)
SHARP = (SurfaceClass.MIRROR, *CLEAR)
SKY_DISTANCE = 1e4  # of the sky seen in a mirror, in distances of the mirror
REFLECT, TRANSMIT = 0.000001, 0.999999  # random numbers that select the reflecting or transmitting lobe
MAX_INTERFACES = 8  # mirrors and panes along a path


class VirtualImages:
    """Finds the virtual images of a frame.

    Parameters
    ----------
    renderer
    """

    def __init__(self, renderer: LobeRenderer) -> None:
        self._renderer = renderer
        self._extend = recorded(self._extend_kernel, lambda: renderer.state)

    def reflected(self, geometry: Geometry) -> Geometry:
        """The G-buffer of a frame with the virtual images of reflections in mirrors and panes.

        Pixels of mirrors and panes have the shape index (plus :data:`IN_VIRTUAL_IMAGE`) and normal of the
        surface at the end of the path, and the depth of its virtual image: the length of the whole path,
        which is exact for plane mirrors. All other pixels stay.
        """
        return self._image(geometry, SHARP, REFLECT)

    def transmitted(self, geometry: Geometry) -> Geometry:
        """The G-buffer of a frame with the virtual images of surfaces behind panes; see :meth:`reflected`."""
        return self._image(geometry, CLEAR, TRANSMIT)

    def _image(self, geometry: Geometry, kinds: Sequence[SurfaceClass], choice: float) -> Geometry:
        # Spawn a path at each mirror and pane.
        pixels = np.flatnonzero(np.isin(geometry.surface, kinds)).astype(np.uint32)
        if not len(pixels):
            return geometry
        shape_index, normal = geometry.shape_index.ravel().copy(), geometry.normal.reshape(-1, 3).copy()
        rays = camera_rays(geometry.camera, pixel_centres(geometry.camera, lanes(pixels)))
        path = spawn(rays, PCG32(len(pixels)), spread=0.0)
        path = compact(path, path.lane)
        length = np.ones(len(shape_index), np.float32)  # of the path, in distances of the first surface
        first = geometry.depth.ravel() * _lengths(geometry.camera)
        count = len(pixels)  # of paths, without the padding at the end
        for _ in range(MAX_INTERFACES):
            path, next_shape, next_normal, distance, is_image, is_sharp = self._extend(path, opaque(choice))
            choice = TRANSMIT  # a pane seen in a mirror shows the surface behind it

            # Replace the surface by the next one where the interface forms an image; rough glass forms none.
            shown = np.array(is_image)[:count]
            lane = pixels[np.array(path.lane)[:count][shown]]
            shape_index[lane] = np.array(next_shape)[:count][shown] + IN_VIRTUAL_IMAGE
            normal[lane] = rows(next_normal)[:count][shown]
            added = np.array(distance)[:count][shown] / first[lane]
            length[lane] = np.minimum(length[lane] + added, SKY_DISTANCE)

            # Keep the paths whose next surface is another interface.
            onward: Any = dr.compress(is_sharp)
            count = dr.width(onward)
            if not count:
                break
            path = compact(path, onward)
        size = geometry.shape_index.shape
        return replace(
            geometry,
            depth=geometry.depth * length.reshape(size),
            shape_index=shape_index.reshape(size),
            normal=np.ascontiguousarray(normal.reshape(*size, 3)),
        )

    def _extend_kernel(self, path: Path, choice: Any) -> tuple[Path, Any, Any, Any, Any, Any]:
        """Reflect or transmit paths at the next surface, and intersect the following one.

        Returns
        -------
        path
        shape_index, normal, distance
            Of the following surface.
        is_image : Bool
            Whether the interface forms an image.
        is_sharp : Bool
            Whether the following surface may form another one.
        """
        # Scatter.
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active, opaque_only=True)
        sample = self._renderer.sample_specular(point, rng, choice)
        ahead = replace(path, rays=sample.rays, bounce=sample.bounce, rng=rng)

        # Intersect.
        surfaces = self._renderer.intersect(ahead.rays, ahead.bounce).surfaces
        is_sharp = Bool(False)
        for sharp in SHARP:
            is_sharp |= surfaces.surface == int(sharp)
        shape_index = dr.select(surfaces.is_hit, surfaces.shape_index, 0)
        # Give the sky a single normal, so that the filter treats it as one surface.
        normal = dr.select(surfaces.is_hit, surfaces.normal, Array3f(0.0, 0.0, 1.0))
        is_image = sample.is_alive & sample.bounce.is_delta
        is_sharp &= surfaces.is_hit & is_image
        return ahead, shape_index, Array3f(normal), Float(surfaces.distance), Bool(is_image), Bool(is_sharp)


def _lengths(camera: Camera) -> npt.NDArray[np.float32]:
    """Lengths of the directions of unit depth through the centres of all pixels, (N,)."""
    row, column = np.indices((camera.height, camera.width)).reshape(2, -1) + 0.5
    directions = np.stack([column, row, np.ones_like(row)], axis=1) @ camera.direction_from_pixel.T
    lengths: npt.NDArray[np.float32] = np.linalg.norm(directions, axis=1).astype(np.float32)
    return lengths
