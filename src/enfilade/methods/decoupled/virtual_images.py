"""Virtual images: apparent positions of surfaces seen in mirrors and through glass (future work of §5.4).

Reprojecting them gives motion vectors of reflections and transmissions (Zimmer et al. 2015).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Bool, Float, UInt, lanes, rows
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.kernels.replay import recorded
from enfilade.methods.decoupled.paths import Path, compact, merged, spawn
from enfilade.records import Geometry, SurfaceClass
from enfilade.renderer import LobeRenderer

IN_VIRTUAL_IMAGE = np.uint32(1 << 30)  # added to the index of shapes seen in mirrors or through glass
CLEAR = SurfaceClass.TRANSPARENT
IMAGING = (SurfaceClass.MIRROR, CLEAR)
SKY_DISTANCE = 1e4  # of the sky seen in a mirror, in distances of the mirror
CHOICES = REFLECT, TRANSMIT = 0.000001, 0.999999  # random numbers that select the lobe: one an image
MAX_INTERFACES = 8  # mirrors, panes and cut-outs along a path
SAME_DISTANCE = 1e-5  # relative difference of the distances of a surface by two intersections


class VirtualImages:
    """Finds the virtual images of a frame.

    Parameters
    ----------
    renderer
    """

    def __init__(self, renderer: LobeRenderer) -> None:
        self._renderer = renderer
        self._extend = recorded(self._extend_kernel, renderer.state)

    def find(self, geometry: Geometry) -> list[Geometry]:
        """G-buffers of a frame with its virtual images: of reflections, and of what is seen through panes.

        In the first, pixels of mirrors and panes have the shape index (plus :data:`IN_VIRTUAL_IMAGE`) and
        normal of the surface at the end of the path, and the depth of its virtual image: the length of the
        whole path, which is exact for plane mirrors. In the second these are of panes alone, and of the
        surfaces behind them. All other pixels stay.
        """
        # Spawn a path at each mirror and pane, and another one at each pane: lanes of the second image.
        count = geometry.shape_index.size
        surface = geometry.surface.ravel()
        lane = np.flatnonzero(np.concatenate([np.isin(surface, IMAGING), surface == CLEAR])).astype(np.uint32)
        if not len(lane):
            return [geometry, geometry]
        shape_index = np.tile(geometry.shape_index.ravel(), 2)
        normal = np.tile(geometry.normal.reshape(-1, 3), (2, 1))
        rays = camera_rays(geometry.camera, pixel_centres(geometry.camera, lanes(lane % count)))
        path = spawn(rays, one_sequence(len(lane)), spread=0.0)
        path = compact(path, path.lane)
        choice = Float(dr.select(dr.gather(UInt, lanes(lane), path.lane) < count, REFLECT, TRANSMIT))
        length = np.ones(2 * count, np.float32)  # of the path, in distances of the first surface
        first = np.array(dr.norm(rays.direction)) * geometry.depth.ravel()[lane % count]
        for ahead, next_shape, next_normal, distance, is_image, _ in self._interfaces(path, choice):
            # Replace the surface by the next one where the interface forms an image; rough glass forms none.
            shown = np.flatnonzero(np.array(is_image))
            place = np.array(ahead.lane)[shown]
            at = lane[place]
            shape_index[at] = np.array(next_shape)[shown] + IN_VIRTUAL_IMAGE
            normal[at] = rows(next_normal)[shown]
            added = np.array(distance)[shown] / first[place]
            length[at] = np.minimum(length[at] + added, SKY_DISTANCE)
        size = geometry.shape_index.shape
        images = zip(
            length.reshape(2, *size), shape_index.reshape(2, *size), normal.reshape(2, *size, 3), strict=True
        )
        return [
            replace(
                geometry,
                depth=geometry.depth * lengths,
                shape_index=indices,
                normal=np.ascontiguousarray(normals),
            )
            for lengths, indices, normals in images
        ]

    def seen_along(self, path: Path, choice: float) -> Path:
        """Paths on their way to the surfaces that camera paths show by mirrors and panes.

        Parameters
        ----------
        path
            From the camera.
        choice
            Of :data:`CHOICES`, at the first interface.

        Returns
        -------
        Path
            In another order, without those that end at the sky or meet too many interfaces.
        """
        ends: list[Path] = []
        chosen = dr.full(Float, choice, dr.width(path.lane))
        for ahead, shape_index, *_, is_image, forms_image in self._interfaces(path, chosen):
            ends.append(compact(ahead, dr.compress(is_image & ~forms_image & (shape_index > 0))))
        return merged(ends)

    def _interfaces(self, path: Path, choice: Any) -> Iterator[tuple[Path, Any, Any, Any, Any, Any]]:
        """Follow paths from interface to interface, and yield what :meth:`_extend_kernel` returns at each.

        Padding lanes form no image.
        """
        for _ in range(MAX_INTERFACES):
            dr.eval(choice)
            found = self._extend(path, choice)
            yield found
            ahead, *_, forms_image = found
            path = compact(ahead, dr.compress(forms_image))
            if not dr.width(path.lane):
                break
            # A pane seen in a mirror shows the surface behind it.
            choice = dr.full(Float, TRANSMIT, dr.width(path.lane))

    def _extend_kernel(self, path: Path, choice: Any) -> tuple[Path, Any, Any, Any, Any, Any]:
        """Reflect or transmit paths at the next surface, and intersect the following one.

        Returns
        -------
        path
        shape_index, normal, distance
            Of the following surface.
        is_image : Bool
            Whether the interface forms an image.
        forms_image : Bool
            Whether the following surface may form another one.
        """
        # Scatter.
        sampler = path.sampler.copy()
        point = self._renderer.intersect(path.rays, path.bounce, path.is_active, opaque_only=True)
        sample = self._renderer.sample_specular(point, sampler, choice)
        ahead = replace(
            path,
            rays=sample.rays,
            bounce=sample.bounce,
            width=path.width_at(point),
            sampler=sampler,
            is_within=path.is_within_after(sample),
        )

        # Intersect.
        following = self._renderer.intersect(ahead.rays, ahead.bounce)
        surfaces = following.surfaces
        # Light from behind a cut-out comes from farther away.
        opaque = self._renderer.intersect(ahead.rays, opaque_only=True).surfaces
        forms_image = following.may_pass & (opaque.distance > surfaces.distance * (1.0 + SAME_DISTANCE))
        forms_image &= surfaces.surface != int(SurfaceClass.EMISSIVE)  # mirrors show lamps
        for kind in IMAGING:
            forms_image |= surfaces.surface == int(kind)
        shape_index = dr.select(surfaces.is_hit, ahead.shape_at(surfaces), 0)
        # Give the sky a single normal, so that the filter treats it as one surface.
        normal = dr.select(surfaces.is_hit, surfaces.normal, Array3f(0.0, 0.0, 1.0))
        is_image = sample.is_alive & sample.is_image
        forms_image &= surfaces.is_hit & is_image
        return (
            ahead,
            shape_index,
            Array3f(normal),
            Float(surfaces.distance),
            Bool(is_image),
            Bool(forms_image),
        )
