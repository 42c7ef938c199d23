"""Resampled importance sampling of emitters (Talbot, Cline and Egbert 2005)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi

from enfilade.arrays import Array3f, Bool, Float, UInt, opaque
from enfilade.kernels.random import BELOW_ONE, PaddedSobolSampler
from enfilade.scene.mitsuba.shadow_rays import Target

Contributions = tuple[Any, ...]  # Array3f each

MOST_CANDIDATES = 8  # of which one has a shadow ray


def resample(
    candidate: Callable[[Any], tuple[Target, Contributions]],
    count: int,
    sampler: PaddedSobolSampler,
    factors: Sequence[Any] = (1.0,),
) -> tuple[Target, Contributions]:
    """One of several candidates, with a probability in proportion to its contribution without occluders.

    Parameters
    ----------
    candidate
        Maps a point of the unit square (mitsuba.Point2f) to a point of an emitter and its
        contributions (tuple of Array3f), divided by the density.
    count
        Number of candidates, each from a part of the square's first axis.
    sampler
    factors
        Of each contribution in the choice.

    Returns
    -------
    target : Target
        Of the chosen candidate.
    contributions : tuple of Array3f
        Its own, divided by the probability: the expectation is the mean of all candidates' contributions.
    """
    if count == 1:
        return candidate(mi.Point2f(sampler.next_2d()))
    first, size = sampler.dimension, opaque(count)
    nothing = tuple(Array3f(0) for _ in factors)

    def draw(
        k: Any, point: Any, is_delta: Any, chosen: Any, chosen_weight: Any, total: Any
    ) -> tuple[Any, ...]:
        own = replace(sampler, dimension=first + 2 * k)
        within = own.next_2d()
        place = mi.Point2f(dr.minimum((Float(k) + within.x) / Float(size), BELOW_ONE), within.y)
        target, contributions = candidate(place)
        scaled = (factor * of for factor, of in zip(factors, contributions, strict=True))
        weight = sum((dr.max(dr.abs(of)) for of in scaled), Float(0))
        total = total + weight
        is_taken = own.next_1d() * total < weight
        return (
            k + 1,
            dr.select(is_taken, target.point, point),
            dr.select(is_taken, target.is_delta, is_delta),
            tuple(dr.select(is_taken, *pair) for pair in zip(contributions, chosen, strict=True)),
            dr.select(is_taken, weight, chosen_weight),
            total,
        )

    _, point, is_delta, chosen, chosen_weight, total = dr.while_loop(
        (UInt(0), mi.Point3f(0.0), Bool(False), nothing, Float(0), Float(0)),
        lambda k, *_: k < size,
        draw,
        labels=("k", "point", "is_delta", "chosen", "chosen_weight", "total"),
    )
    sampler.dimension = first + 2 * count
    # What is not finite stays so, and is left out with its path.
    scale = dr.select(total == 0.0, 0.0, total / (chosen_weight * Float(size)))
    return Target(point, is_delta), tuple(of * scale for of in chosen)
