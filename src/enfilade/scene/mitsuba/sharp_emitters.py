"""Emitters that cast sharp shadows (point, spot and directional ones, and the sun), and all others."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from enfilade.arrays import Array3f, Bool, Float, UInt, lanes, opaque
from enfilade.kernels.random import BELOW_ONE, Discrete
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.scene.mitsuba.shadow_rays import ShadowRays
from enfilade.scene.mitsuba.sun import find_sun

SHADOW_RAYS = 4  # beside that to the sun
CANDIDATES = 8  # emitters of a group, at most, of which one is chosen


class SharpEmitters:
    """Next-event estimation of the emitters that cast sharp shadows, and of the soft ones: all others.

    Parameters
    ----------
    scene : mitsuba.Scene
    shadow_rays
    """

    def __init__(self, scene: Any, shadow_rays: ShadowRays) -> None:
        self._scene = scene
        self._shadow_rays = shadow_rays
        emitters = scene.emitters()
        weights = np.array([e.sampling_weight() for e in emitters], np.float64)
        is_delta = np.array([mi.has_flag(e.flags(), mi.EmitterFlags.Delta) for e in emitters], bool)
        is_delta &= weights > 0.0  # Mitsuba never samples the others
        self._count = int(is_delta.sum())
        self._delta = lanes(np.flatnonzero(is_delta).astype(np.uint32)) if self._count else None
        self._sun = find_sun(scene.environment())

        # The intervals of the first random number in which the scene samples each emitter.
        pmf = weights / max(weights.sum(), 1e-30)
        self._first, self._pmf = (lanes(a.astype(np.float32)) for a in (np.cumsum(pmf) - pmf, pmf))
        soft = np.where(is_delta, 0.0, pmf)
        self._soft_share = opaque(max(float(soft.sum()), 1e-30))
        self._soft = Discrete.of(soft) if soft.any() else None

    @property
    def is_empty(self) -> bool:
        """Whether no emitter casts sharp shadows."""
        return not self._count and self._sun is None

    @property
    def state(self) -> Any:
        """Arrays that the methods read."""
        sun = self._sun and self._sun.state
        return self._delta, sun, self._first, self._pmf, self._soft_share, self._soft

    def estimate(self, si: Any, sampler: Any, evaluate: Callable[[Any], Any], active: Any) -> Any:
        """Radiance that a surface reflects of the light of sharp emitters.

        Up to :data:`SHADOW_RAYS` emitters have a shadow ray each. More are divided into groups with one
        shadow ray each, to an emitter that is chosen in proportion to its contribution without occluders, by
        resampled importance sampling (Talbot et al. 2005). The sun has a shadow ray of its own.

        Parameters
        ----------
        si : mitsuba.SurfaceInteraction3f
        sampler : PaddedSobolSampler
        evaluate
            The BSDF times the cosine, by incident direction in world space.
        active : Bool

        Returns
        -------
        Array3f
        """
        groups = min(self._count, SHADOW_RAYS)
        size = self._count / max(groups, 1)  # emitters of a group
        candidates = min(math.ceil(size), CANDIDATES)
        found = Array3f(0)
        for group in range(groups):
            chosen, chosen_weight, total, target = Array3f(0), Float(0), Float(0), mi.Point3f(0)
            for candidate in range(candidates):
                within = (candidate + sampler.next_1d()) / candidates
                number = dr.minimum(UInt((group + within) * size), self._count - 1)
                index = dr.gather(UInt, self._delta, number)
                emitter = dr.gather(mi.EmitterPtr, self._scene.emitters_dr(), index)
                square = mi.Point2f(sampler.next_2d())
                sample, radiance = emitter.sample_direction(si, square, active)
                contribution = Array3f(evaluate(sample.d) * radiance) * (size / candidates)
                weight = dr.dot(contribution, Array3f(*REC709_LUMINANCE))
                total += weight
                is_taken = sampler.next_1d() * total < weight
                chosen = dr.select(is_taken, contribution, chosen)
                chosen_weight = dr.select(is_taken, weight, chosen_weight)
                target = dr.select(is_taken, sample.p, target)
            chosen *= dr.select(chosen_weight > 0.0, total / chosen_weight, 0.0)
            found += self._unoccluded(si, target, chosen, active & (chosen_weight > 0.0))
        if self._sun is not None:
            direction, radiance = self._sun.sample(sampler)
            target = si.p + direction * (2.0 * dr.norm(self._scene.bbox().extents()))
            contribution = Array3f(evaluate(direction) * radiance)
            found += self._unoccluded(si, target, contribution, active & (dr.max(contribution) > 0.0))
        return found

    def sample_soft(self, si: Any, sample_point: Any, active: Any) -> tuple[Any, Any]:
        """Sample the soft emitters, as ``scene.sample_emitter_direction`` does all.

        Returns
        -------
        sample : mitsuba.DirectionSample3f
        radiance : Color3f
            Divided by the density; 0 where occluded.
        """
        if self._soft is None:
            return dr.zeros(mi.DirectionSample3f, dr.width(si)), mi.Color3f(0)
        index, within, _ = self._soft.sample(sample_point.x)
        first, pmf = dr.gather(Float, self._first, index), dr.gather(Float, self._pmf, index)
        point = mi.Point2f(dr.minimum(first + within * pmf, BELOW_ONE), sample_point.y)
        sample, radiance = self._shadow_rays.sample_emitter(si, point, active)
        is_soft = active & ~sample.delta & ~(self._is_environment(sample) & self.is_sun(sample.d))
        sample.pdf = dr.select(is_soft, self.soft_pdf(sample.pdf), 0.0)
        return sample, dr.select(is_soft, radiance * self._soft_share, 0.0)

    def soft_pdf(self, pdf: Any) -> Any:
        """Density of :meth:`sample_soft` where ``scene.pdf_emitter_direction`` is `pdf`."""
        return pdf / self._soft_share

    def is_sun(self, direction: Any) -> Any:
        """Whether the environment shows the sun in a direction in world space; Bool."""
        return Bool(False) if self._sun is None else self._sun.contains(direction)

    def _is_environment(self, sample: Any) -> Any:
        return sample.emitter == mi.EmitterPtr(self._scene.environment())

    def _unoccluded(self, si: Any, target: Any, contribution: Any, active: Any) -> Any:
        """A contribution from a point, times the transmittance in between."""
        share = self._shadow_rays.transmittance(si, target, active)
        return dr.select(active, contribution * Array3f(share), 0.0)
