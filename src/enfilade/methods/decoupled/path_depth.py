"""Light of paths that end at the scene's ``max_depth``: behind mirrors, glass and gloss there is less of it.

Cached irradiance has the light of paths that reach its surface as early as can be. A path that has bounced
off specular lobes on its way there has fewer edges left. The share that is left then is much the same all
over a scene; it is estimated by paths that are cut short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, UInt, lanes
from enfilade.kernels.estimate import Estimate, RayCount, Samples
from enfilade.kernels.guiding import PathGuide
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.records import Geometry
from enfilade.renderer import MAX_PATH_DEPTH, LobeRenderer, PixelFilter, RandomKey

PIXELS = 8192  # of a keyframe, from which a path each is cut short
DEPTHS = range(1, MAX_PATH_DEPTH + 1)


@dataclass(frozen=True)
class DepthShares:
    """Shares of cached irradiance that are left after so many bounces, as lanes.

    Attributes
    ----------
    images : Float
        Of irradiance images, whose paths begin at the first surface, without sharp light.
    others : Float
        Of all other irradiance, whose paths begin at the second surface.
    """

    images: Any
    others: Any

    def of_images(self, bounces: Any) -> Any:
        """The share of irradiance images at a surface after bounces (UInt); Float."""
        return dr.gather(Float, self.images, dr.minimum(UInt(bounces), MAX_PATH_DEPTH - 1))

    def of_others(self, bounces: Any) -> Any:
        """The share of all other irradiance; Float."""
        return dr.gather(Float, self.others, dr.minimum(UInt(bounces), MAX_PATH_DEPTH - 1))


def depth_shares(light: Sequence[Sequence[Sequence[float]]], *, has_sharp_light: bool) -> DepthShares:
    """The shares, from :func:`light_by_depth` of several keyframes."""
    *by_depth, sharp = np.sum(light, axis=0) if len(light) else np.zeros(MAX_PATH_DEPTH + 1)
    whole = np.array(by_depth)
    soft = whole - sharp if has_sharp_light else whole
    images, others = (
        of / of[base] if of[base] > 0.0 else np.ones(MAX_PATH_DEPTH) for of, base in ((soft, 0), (whole, 1))
    )
    return DepthShares(*(lanes(np.clip(of, 0.0, 1.0).astype(np.float32)) for of in (images, others)))


def light_by_depth(
    renderer: LobeRenderer,
    geometry: Geometry,
    guide: PathGuide | None,
    random: RandomKey,
    *,
    paths_in_flight: int,
) -> tuple[list[float], RayCount]:
    """Mean luminance of irradiance over pi, by the same paths cut short as if they began at each depth.

    Parameters
    ----------
    renderer
    geometry
        G-buffer of a keyframe.
    guide
    random
    paths_in_flight

    Returns
    -------
    light : list of float
        One a depth, and as the last one that of emitters with sharp shadows.
    count : RayCount
    """
    pixels = np.flatnonzero(geometry.has_diffuse).astype(np.uint32)
    pixels = pixels[:: max(-(-len(pixels) // PIXELS), 1)]
    has_sharp_light = renderer.has_sharp_light()

    def radiance(rays: Any, sampler: Any) -> Samples:
        point = renderer.intersect(rays, opaque_only=True)
        found = [
            sum(
                renderer.estimate_diffuse(point, sampler.copy(), 1, guide, limited_as=depth),
                Array3f(0),
            )
            for depth in DEPTHS
        ]
        sharp = renderer.sharp_light(point, sampler.copy())[0] if has_sharp_light else Array3f(0)
        return Samples((*found, Array3f(sharp + dr.zeros(Array3f, dr.width(sampler.seed)))))

    estimate = Estimate(
        geometry.camera,
        pixels,
        radiance,
        paths_in_flight=paths_in_flight,
        pixel_filter=PixelFilter.CENTRE,
        random=random,
        layers=len(DEPTHS) + 1,
    )
    estimate.add(1)
    means = [float(np.mean(of.color @ REC709_LUMINANCE)) if len(pixels) else 0.0 for of in estimate.shadings]
    return means, estimate.count
