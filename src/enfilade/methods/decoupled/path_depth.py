"""Light of paths that end at the scene's ``max_depth``: behind mirrors, glass and gloss there is less of it.

Cached irradiance has the light of paths that reach its surface as early as can be. A path that has bounced
off specular lobes before ends earlier. The mean irradiance at each path depth, estimated by paths that end
early, says how much of the light remains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, UInt, lanes
from enfilade.kernels.estimate import Estimate, RayCount, Samples
from enfilade.kernels.guiding import PathGuide
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.records import Geometry
from enfilade.renderer import MAX_PATH_DEPTH, LobeRenderer, RandomKey

PIXELS = 4096  # of a keyframe, from which paths end early
KEYFRAMES = 2  # of a shot, or one more
DEPTHS = range(1, MAX_PATH_DEPTH + 1)


@dataclass(frozen=True)
class DepthWeights:
    """Weights of cached irradiance after bounces: how much of it paths of limited depth bring.

    Attributes
    ----------
    images : Float or None
        Of irradiance images, by the number of bounces. None: all are 1.
    others : Float or None
        Of all other irradiance.
    soft : Float or None
        Of that without sharp light.
    """

    images: Any = None
    others: Any = None
    soft: Any = None

    @property
    def of_entries(self) -> tuple[Any, Any]:
        """Of the light in an entry of the hash grid: all, and soft."""
        return self.others, self.soft

    @staticmethod
    def of(light: Sequence[Sequence[float]]) -> DepthWeights:
        """The weights for irradiance images, whose paths begin at the first surface, without sharp light.

        All other irradiance is that of paths that begin at the second surface.

        Parameters
        ----------
        light
            :func:`light_by_depth` of several keyframes. Without any, all weights are 1.
        """
        if not light:
            return UNWEIGHTED
        total = np.sum(light, axis=0)
        soft, sharp = total[:-1], total[-1]
        return DepthWeights(_relative(soft, 0), _relative(soft + sharp, 1), _relative(soft, 1))


UNWEIGHTED = DepthWeights()


def weight_after(weights: Any, bounces: Any) -> Any:
    """The weight (Float) after a number of bounces (UInt); `weights` are those of :class:`DepthWeights`."""
    if weights is None:
        return Float(1)
    return dr.gather(Float, weights, dr.minimum(UInt(bounces), MAX_PATH_DEPTH - 1))


def light_by_depth(
    renderer: LobeRenderer,
    geometry: Geometry,
    guide: PathGuide | None,
    random: RandomKey,
    make_estimate: Callable[..., Estimate],
) -> tuple[list[float], RayCount]:
    """Mean luminance of irradiance over pi, by the same paths ended as if they began at each depth.

    It is that of visible surfaces; if none has a diffuse lobe, that of the surfaces to which a bounce leads.

    Parameters
    ----------
    renderer
    geometry
        G-buffer of a keyframe.
    guide
    random
    make_estimate
        Makes an estimate of pixels: :meth:`ShotContext.estimate`.

    Returns
    -------
    light : list of float
        Without sharp light, one a depth; then that of sharp light, which has the same at each. Multiplied by
        the number of pixels that it represents.
    count : RayCount
    """
    is_direct = bool(geometry.has_diffuse.any())
    pixels = np.flatnonzero(geometry.has_diffuse if is_direct else geometry.shape_index)
    chosen = np.zeros_like(geometry.has_diffuse)
    chosen.flat[pixels[np.linspace(0, len(pixels) - 1, min(len(pixels), PIXELS)).astype(np.intp)]] = True
    has_sharp_light = renderer.has_sharp_light()

    def radiance(rays: Any, sampler: Any) -> Samples:
        point = renderer.intersect(rays, opaque_only=True)
        if not is_direct:
            bounced = renderer.sample_specular(point, sampler)
            point = renderer.intersect(bounced.rays, bounced.bounce, bounced.is_alive)
        soft = [
            sum(
                renderer.estimate_diffuse(
                    point, sampler.copy(), 1, guide, end_depth=depth, soft_only=has_sharp_light
                ),
                Array3f(0),
            )
            for depth in DEPTHS
        ]
        sharp = renderer.sharp_light(point, sampler.copy()).diffuse if has_sharp_light else Array3f(0)
        return Samples((*soft, sharp + dr.zeros(Array3f, dr.width(sampler.seed))))

    estimate = make_estimate(geometry.camera, chosen, radiance, random, layers=len(DEPTHS) + 1)
    if not len(pixels):
        return [0.0] * (len(DEPTHS) + 1), estimate.count
    estimate.add(1)
    means = [float(np.mean(of.color @ REC709_LUMINANCE, dtype=np.float64)) for of in estimate.shadings]
    count = RayCount(estimate.count.rays * len(DEPTHS), estimate.count.dropped)
    return [mean * len(pixels) for mean in means], count


def _relative(light: Any, depth: int) -> Any:
    """Irradiance by depth over that of one depth, as lanes; 1 without light."""
    if not light[depth] > 0.0:
        return lanes(np.ones(len(light), np.float32))
    return lanes(np.maximum(light / light[depth], 0.0).astype(np.float32))
