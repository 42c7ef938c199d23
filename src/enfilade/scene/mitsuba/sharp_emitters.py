"""Emitters that cast sharp shadows (point, spot, directional ones, small lamps, the sun), and all others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Bool, Float, UInt, lanes, opaque, rows
from enfilade.kernels.random import BELOW_ONE, Discrete, one_sequence
from enfilade.scene.mitsuba.resampling import MOST_CANDIDATES, Contributions, resample
from enfilade.scene.mitsuba.shadow_rays import ShadowRays, Target
from enfilade.scene.mitsuba.sun import find_sun

SHADOW_RAYS = 4  # beside that to the sun
SUN_CANDIDATES = 4  # least number for soft light beside a sun, since those in the sun are left out
SMALL = 0.08  # half the width of a small lamp, over the mean distance of what it lights
DISTANCE_RAYS = 256  # for this mean
MOST_LIGHT = 0.9  # of small lamps: the strongest are sharp where they have so much of it


class SharpEmitters:
    """Next-event estimation of the emitters that cast sharp shadows, and of the soft ones: all others.

    Parameters
    ----------
    scene : mitsuba.Scene
    shadow_rays

    Attributes
    ----------
    count, soft_count : int
        Number of candidates of next-event estimation: one an emitter that is sampled, or a soft one.
    """

    def __init__(self, scene: Any, shadow_rays: ShadowRays) -> None:
        self._scene = scene
        self._shadow_rays = shadow_rays
        emitters = scene.emitters()
        weights = np.array([e.sampling_weight() for e in emitters], np.float64)
        is_delta = np.array([mi.has_flag(e.flags(), mi.EmitterFlags.Delta) for e in emitters], bool)
        is_small = (weights > 0.0) & _are_small(scene, emitters)
        if is_small.sum() > SHADOW_RAYS:  # the noise of a choice among them costs more than it gains
            is_small = _strongest(emitters, is_small)
        is_sharp = (is_delta | is_small) & (weights > 0.0)  # Mitsuba never samples the others
        self._sharp_count = int(is_sharp.sum())
        self._sharp = lanes(np.flatnonzero(is_sharp).astype(np.uint32)) if self._sharp_count else None
        self._sun = find_sun(scene.environment())

        # The intervals of the first random number in which the scene samples each emitter.
        pmf = weights / max(weights.sum(), 1e-30)
        self._first, self._pmf = (lanes(a.astype(np.float32)) for a in (np.cumsum(pmf) - pmf, pmf))
        soft = np.where(is_sharp, 0.0, pmf)
        self._soft_share = opaque(max(float(soft.sum()), 1e-30))
        self._soft = Discrete.of(soft) if soft.any() else None
        # A literal zero has the size of its lanes, which a recorded kernel does not adapt.
        self._zero = opaque(0.0)
        self.soft_count = int((soft > 0.0).sum())
        if self._sun is not None and self._soft is not None:
            self.soft_count = max(self.soft_count, SUN_CANDIDATES)

        # Factors from the scene's density of an emitter to that of its own estimate, by its number in the
        # registry of Dr.Jit, where 0 is none.
        group = self._sharp_count / max(min(self._sharp_count, SHADOW_RAYS), 1)
        scale = np.where(is_sharp, 1.0 / np.maximum(group * pmf, 1e-30), 1.0 / max(soft.sum(), 1e-30))
        numbers = np.array(_number(scene.emitters_dr()))
        table = np.zeros(numbers.max(initial=0) + 1, np.float32)
        table[numbers] = np.where(pmf > 0.0, scale, 0.0)
        self._scale = lanes(table)
        self.count = int((weights > 0.0).sum())

    @property
    def is_empty(self) -> bool:
        """Whether no emitter casts sharp shadows."""
        return not self._sharp_count and self._sun is None

    @property
    def state(self) -> Any:
        """Arrays that the methods read."""
        sun = self._sun and self._sun.state
        return self._sharp, self._scale, self._zero, sun, self._first, self._pmf, self._soft_share, self._soft

    def estimate(
        self,
        si: Any,
        sampler: Any,
        evaluate: Callable[[Any], Sequence[tuple[Any, Any]]],
        factors: Sequence[Any],
        active: Any,
    ) -> tuple[list[Any], Any]:
        """Radiance that lobes of a surface reflect of the light of sharp emitters, MIS-weighted.

        Up to :data:`SHADOW_RAYS` emitters have a shadow ray each. More are divided into groups with one
        shadow ray each, to an emitter that is chosen in proportion to its contribution without occluders.
        The sun has a shadow ray of its own.

        Parameters
        ----------
        si : mitsuba.SurfaceInteraction3f
        sampler : PaddedSobolSampler
        evaluate
            By incident direction in world space: of each lobe the BSDF times the cosine, and the density with
            which it is sampled.
        factors
            Of each lobe in the choice among the emitters of a group.
        active : Bool

        Returns
        -------
        light : list of Array3f
            Of each lobe.
        unoccluded : Array3f
            Of the first lobe, without occluders.
        """
        groups = min(self._sharp_count, SHADOW_RAYS)
        size = self._sharp_count / max(groups, 1)  # emitters of a group
        found, unoccluded = [Array3f(0)] * len(factors), Array3f(0)
        for group in range(groups):

            def candidate(place: Any, group: int = group) -> tuple[Target, Contributions]:
                at = (group + place.x) * size
                number = dr.minimum(UInt(at), self._sharp_count - 1)
                within = mi.Point2f(dr.minimum(at - Float(number), BELOW_ONE), place.y)
                index = dr.gather(UInt, self._sharp, number)
                emitter = dr.gather(mi.EmitterPtr, self._scene.emitters_dr(), index)
                sample, radiance = emitter.sample_direction(si, within, active)
                pdf = dr.select(sample.delta, dr.inf, sample.pdf / size)
                target = Target(sample.p, sample.delta)
                return target, _weighted(evaluate(sample.d), radiance * size, pdf)

            target, chosen = resample(candidate, min(math.ceil(size), MOST_CANDIDATES), sampler, factors)
            found = _added(found, self._shadow_rays.unoccluded(si, target, chosen, active))
            unoccluded += dr.select(active, chosen[0], 0.0)
        if self._sun is not None:
            direction, radiance, pdf = self._sun.sample(sampler)
            point = si.p + direction * (2.0 * dr.norm(self._scene.bbox().extents()))
            target = Target(point, Bool(False))
            contributions = _weighted(evaluate(direction), radiance, pdf)
            found = _added(found, self._shadow_rays.unoccluded(si, target, contributions, active))
            unoccluded += dr.select(active, contributions[0], 0.0)
        return found, unoccluded

    def sample_soft(self, si: Any, sample_point: Any, active: Any) -> tuple[Any, Any]:
        """Sample the soft emitters, as ``scene.sample_emitter_direction`` does all.

        Returns
        -------
        sample : mitsuba.DirectionSample3f
        radiance : Color3f
            Divided by the density; without occluders.
        """
        if self._soft is None:
            sample = dr.zeros(mi.DirectionSample3f, dr.width(si))
            sample.pdf = self._zero + dr.zeros(Float, dr.width(si))
            return sample, mi.Color3f(self._zero)
        index, within, _ = self._soft.sample(sample_point.x)
        first, pmf = dr.gather(Float, self._first, index), dr.gather(Float, self._pmf, index)
        point = mi.Point2f(dr.minimum(first + within * pmf, BELOW_ONE), sample_point.y)
        sample, radiance = self._scene.sample_emitter_direction(si, point, False, active)
        is_soft = active & ~sample.delta & ~self._is_sun(sample.emitter, sample.d)
        sample.pdf = dr.select(is_soft, sample.pdf / self._soft_share, 0.0)
        return sample, dr.select(is_soft, radiance * self._soft_share, 0.0)

    def pdf(self, emitter: Any, direction: Any, pdf: Any) -> Any:
        """Density with which an emitter is sampled where sharp ones are estimated apart.

        Parameters
        ----------
        emitter : mitsuba.EmitterPtr
            Seen in the direction.
        direction : mitsuba.Vector3f
            In world space.
        pdf : Float
            Of ``scene.pdf_emitter_direction``.

        Returns
        -------
        Float
        """
        found = pdf * dr.gather(Float, self._scale, _number(emitter))
        if self._sun is None:
            return found
        return dr.select(self._is_sun(emitter, direction), self._sun.pdf(direction), found)

    def _is_sun(self, emitter: Any, direction: Any) -> Any:
        """Whether an emitter (mitsuba.EmitterPtr) is the environment, and a direction is that of the sun."""
        if self._sun is None:
            return Bool(False)
        return (emitter == mi.EmitterPtr(self._scene.environment())) & self._sun.contains(direction)


def mis_weight(pdf: Any, other_pdf: Any) -> Any:
    """Veach's power heuristic: 0 where both densities are 0, 1 where the first is infinite."""
    ratio = dr.select(pdf == dr.inf, 0.0, other_pdf / pdf)
    weight = dr.rcp(1.0 + ratio * ratio)
    return dr.select((pdf > 0.0) & dr.isfinite(weight), weight, 0.0)


def _weighted(lobes: Sequence[tuple[Any, Any]], radiance: Any, pdf: Any) -> tuple[Any, ...]:
    """Contributions of a sample of an emitter, whose radiance is divided by its density."""
    return tuple(Array3f(value * radiance * mis_weight(pdf, own)) for value, own in lobes)


def _added(totals: Sequence[Any], more: Sequence[Any]) -> list[Any]:
    return [total + of for total, of in zip(totals, more, strict=True)]


def _number(emitter: Any) -> Any:
    """Numbers of emitters (mitsuba.EmitterPtr) in Dr.Jit's registry; UInt."""
    return dr.reinterpret_array(UInt, emitter)


def _are_small(scene: Any, emitters: Sequence[Any]) -> npt.NDArray[np.bool_]:
    """Whether emitters (N,) are small shapes, seen from what they light; one launch finds all distances."""
    found = np.zeros(len(emitters), np.bool_)
    places = [place for place, emitter in enumerate(emitters) if emitter.get_shape() is not None]
    if not places:
        return found
    shapes = [emitters[place].get_shape() for place in places]

    # Trace rays from all of each shape, as a Lambertian emitter sends them.
    sampler = one_sequence(DISTANCE_RAYS)
    position, direction = mi.Point2f(sampler.next_2d()), mi.Point2f(sampler.next_2d())
    starts = [shape.sample_position(0.0, position) for shape in shapes]
    wide = dr.zeros(Array3f, DISTANCE_RAYS)  # a flat shape has one normal
    points, normals = (
        np.concatenate([rows(wide + Array3f(getattr(start, axis))) for start in starts])
        for axis in ("p", "n")
    )
    local = rows(Array3f(mi.warp.square_to_cosine_hemisphere(direction)))
    si = dr.zeros(mi.SurfaceInteraction3f, len(points))
    si.p, si.n = mi.Point3f(lanes(points[None])), mi.Normal3f(lanes(normals[None]))
    frame = mi.Frame3f(mi.Vector3f(si.n))
    towards = frame.to_world(mi.Vector3f(lanes(np.tile(local, (len(shapes), 1))[None])))
    hit = scene.ray_intersect(si.spawn_ray(towards))

    # Compare their widths with the mean distances.
    distance = np.array(dr.select(hit.is_valid(), hit.t, 0.0)).reshape(len(shapes), DISTANCE_RAYS)
    mean = distance.sum(axis=1) / np.maximum((distance > 0.0).sum(axis=1), 1)
    width = np.array([float(np.array(shape.bbox().extents()).max()) for shape in shapes])
    found[places] = 0.5 * width < SMALL * mean
    return found


def _strongest(emitters: Sequence[Any], is_small: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Small lamps that have a shadow ray each, (N,): none if they have too little of the light of all."""
    places = np.flatnonzero(is_small)
    flux = np.array([_flux(emitters[place]) for place in places.tolist()])
    strongest = np.argsort(-flux, kind="stable")[:SHADOW_RAYS]
    chosen = np.zeros_like(is_small)
    chosen[places[strongest]] = flux[strongest].sum() >= MOST_LIGHT * flux.sum() > 0.0
    return chosen


def _flux(emitter: Any) -> float:
    """Luminous flux of an area emitter, over pi, from points on its shape."""
    shape = emitter.get_shape()
    start = shape.sample_position(0.0, mi.Point2f(one_sequence(DISTANCE_RAYS).next_2d()))
    si = dr.zeros(mi.SurfaceInteraction3f, DISTANCE_RAYS)
    si.p, si.n, si.uv, si.wi = start.p, start.n, start.uv, mi.Vector3f(0, 0, 1)
    si.shape = mi.ShapePtr(shape)  # radiance by vertex is that of one triangle
    radiance = mi.luminance(emitter.eval(si))
    return float(np.array(dr.mean(radiance)).item()) * float(np.array(shape.surface_area()).item())
