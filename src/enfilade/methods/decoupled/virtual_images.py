"""Virtual images: the apparent places of surfaces seen in mirrors and through glass (§5.4's future work).

Reprojecting them gives motion vectors of reflections and transmissions (Zimmer et al. 2015).
"""

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
from enfilade.methods.decoupled.paths import Path, compact, spawn
from enfilade.records import Geometry, SurfaceClass
from enfilade.renderer import LobeRenderer, Rays

__all__ = ["IN_VIRTUAL_IMAGE", "VirtualImages"]

IN_VIRTUAL_IMAGE = np.uint32(
    1 << 30
)  # added to the index of a shape that is seen in a mirror or through glass
CLEAR = (SurfaceClass.TRANSPARENT,)
SHARP = (SurfaceClass.MIRROR, *CLEAR)
SKY_DISTANCE = 1e4  # of the sky seen in a mirror, in distances of the mirror
REFLECT, TRANSMIT = 0.000001, 0.999999  # random numbers that choose the reflecting and the transmitting lobe
MAX_INTERFACES = 8  # mirrors and panes in a row


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
        """The G-buffer of a frame with the virtual images in mirrors, and in panes as far as they reflect.

        Pixels on a mirror or pane get shape index (plus :data:`IN_VIRTUAL_IMAGE`) and normal of the surface
        at the end of the chain, and the depth of the virtual image: the length of the whole path, which is
        exact for plane mirrors. All other pixels stay.
        """
        return self._image(geometry, SHARP, REFLECT)

    def transmitted(self, geometry: Geometry) -> Geometry:
        """The G-buffer of a frame with the surfaces behind panes; as :meth:`reflected`, but mirrors stay."""
        return self._image(geometry, CLEAR, TRANSMIT)

    def _image(self, geometry: Geometry, kinds: Sequence[SurfaceClass], choice: float) -> Geometry:
        pixels = np.flatnonzero(np.isin(geometry.surface, kinds)).astype(np.uint32)
        if not len(pixels):
            return geometry
        shape_index, normal = geometry.shape_index.ravel().copy(), geometry.normal.reshape(-1, 3).copy()
        path = spawn(*_centre_rays(geometry.camera, pixels), spread=0.0)
        path = compact(path, path.lane)
        length = np.ones(len(shape_index), np.float32)  # of the path, in distances of the first surface
        first = geometry.depth.ravel() * _lengths(geometry.camera)
        count = len(pixels)  # of paths, without the padding at the end
        for _ in range(MAX_INTERFACES):
            path, found, turned, distance, is_image, is_sharp = self._extend(path, opaque(choice))
            choice = TRANSMIT  # a pane seen in a mirror shows the surface behind it

            # Replace the surface by the next one, where the interface forms an image: rough glass forms none.
            shown = np.array(is_image)[:count]
            lane = pixels[np.array(path.lane)[:count][shown]]
            shape_index[lane] = np.array(found)[:count][shown] + IN_VIRTUAL_IMAGE
            normal[lane] = rows(turned)[:count][shown]
            far = np.array(distance)[:count][shown] / first[lane]
            length[lane] = np.minimum(length[lane] + far, SKY_DISTANCE)

            # Go on where the next surface is another interface.
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
        """Reflect or transmit the paths at the next surface, and intersect the one after.

        Returns
        -------
        path
        shape_index, normal, distance
            Of the surface after.
        is_image : Bool
            Whether the interface forms an image.
        is_sharp : Bool
            Whether the surface after may form another.
        """
        rng = PCG32(path.rng)
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active, opaque_only=True)
        sample = self._renderer.sample_specular(point, rng, choice)
        ahead = replace(path, rays=sample.rays, bounce=sample.bounce, rng=rng)
        surfaces = self._renderer.intersect(ahead.rays, ahead.bounce).surfaces
        is_sharp = Bool(False)
        for sharp in SHARP:
            is_sharp |= surfaces.surface == int(sharp)
        shape_index = dr.select(surfaces.is_hit, surfaces.shape_index, 0)
        # Give the sky a single normal, so that it is smoothed.
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
    """Lengths of the directions of unit depth through the centres of all pixels, (N,)."""
    row, column = np.indices((camera.height, camera.width)).reshape(2, -1) + 0.5
    directions = np.stack([column, row, np.ones_like(row)], axis=1) @ camera.direction_from_pixel.T
    lengths: npt.NDArray[np.float32] = np.linalg.norm(directions, axis=1).astype(np.float32)
    return lengths
