"""The cache: keyframes of arriving light, ready to be looked up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Array3f, Float, lanes, matrix3, opaque, vector3
from enfilade.pixels.lookup import Page, lookup
from enfilade.records import Keyframe

PLANE_TOLERANCE = 0.01  # of the depth
KNOWN = 0.02  # least weight of all taps together at which a surface counts as known


@dataclass(frozen=True, eq=False)
class LightCache:
    """What several keyframes know of the light; empty, it knows nothing, and every lookup is a miss."""

    pages: tuple[tuple[Page, float], ...] = ()

    def find(self, position: Any, normal: Any, item: Any) -> tuple[Any, Any]:
        """Light at points of surfaces.

        Parameters
        ----------
        position, normal : Array3f
        item : UInt

        Returns
        -------
        light : Array3f
            Radiance that the diffuse lobe would send if the albedo were one; 0 where unknown.
        is_known : Bool
        """
        total, weight = Array3f(0), Float(0)
        for page, share in self.pages:
            found, agreeing = lookup(position, normal, item, page, plane_tolerance=PLANE_TOLERANCE)
            total += opaque(share) * found
            weight += opaque(share) * agreeing
        is_known = weight > KNOWN
        return dr.select(is_known, total / weight, 0.0), is_known


def open_cache(keyframes: Sequence[Keyframe], weights: Sequence[float]) -> LightCache:
    """Make keyframes ready to be looked up.

    Parameters
    ----------
    keyframes
        Their shading is the light that arrives, not the colour.
    weights
        How much each counts where several know a surface; they sum to about one.
    """
    return LightCache(tuple((_page(k), w) for k, w in zip(keyframes, weights, strict=True) if w > 0.0))


def _page(keyframe: Keyframe) -> Page:
    geometry, camera = keyframe.geometry, keyframe.geometry.camera
    page = Page(
        depths=lanes(geometry.depth),
        items=lanes(geometry.item),
        values=lanes(keyframe.shading.color),
        eye=vector3(camera.eye),
        direction_from_pixel=matrix3(camera.direction_from_pixel),
        pixel_from_direction=matrix3(camera.pixel_from_direction),
        width=camera.width,
        height=camera.height,
    )
    dr.eval(page.depths, page.items, page.values)
    return page
