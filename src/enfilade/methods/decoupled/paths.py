"""Paths through a scene, as lanes that are compacted from bounce to bounce."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Bool, Float, UInt, lanes, opaque
from enfilade.kernels.random import PaddedSobolSampler
from enfilade.kernels.replay import padded
from enfilade.renderer import Bounce, Branch, BsdfSample, Rays, ShadingPoint, Surfaces

WITHIN = 1 << 29  # added to the index of shapes within glass, such as the floor below a block


@dataclass(frozen=True)
class Path:
    """The state of a path: a ray on its way to a surface.

    Attributes
    ----------
    lane : UInt
        Index of the pixel sample that receives its radiance.
    rays : Rays
    bounce : Bounce or None
        The last bounce; None for camera rays.
    throughput : Array3f
    width, spread : Float
        Width of the path at the ray's origin, scene units, and its growth by unit of length.
    sampler : PaddedSobolSampler
    bounces : UInt
        Made so far.
    depth : UInt
        Those of them that count where the scene limits the depth of paths.
    branch : UInt
        :class:`Branch` that it follows at the next interface.
    is_within : Bool
        Whether it is within a refractive medium, which it entered by an interface.
    """

    lane: Any
    rays: Rays
    bounce: Bounce | None
    throughput: Any
    width: Any
    spread: Any
    sampler: Any
    bounces: Any
    depth: Any
    branch: Any
    is_within: Any

    @property
    def is_active(self) -> Any:
        """Whether the path has any throughput: terminated and padding paths have none; Bool."""
        return dr.max(dr.abs(self.throughput)) > 0.0

    def width_at(self, point: ShadingPoint) -> Any:
        """Width of the path where it meets a surface, scene units; Float."""
        return self.width + self.spread * point.surfaces.distance * dr.norm(self.rays.direction)

    def shape_at(self, surfaces: Surfaces) -> Any:
        """Shape indices of surfaces in the cache, UInt: within glass they have other light than beside it."""
        return surfaces.shape_index + dr.select(self.is_within, UInt(WITHIN), UInt(0))

    def is_within_after(self, sample: BsdfSample) -> Any:
        """Whether the path is within a refractive medium after a bounce: interfaces alone change it; Bool."""
        return dr.select(sample.is_interface, sample.is_within, self.is_within)

    def on_branch(self, branch: Branch) -> Path:
        """The same paths on a branch."""
        count = dr.width(self.lane)
        return replace(self, branch=dr.opaque(UInt, int(branch), count)) if count else self


def spawn(rays: Rays, sampler: Any, spread: float) -> Path:
    """Camera paths, one a ray."""
    count = dr.width(sampler.seed)
    path = Path(
        lane=dr.arange(UInt, count),
        rays=Rays(rays.origin + dr.zeros(Array3f, count), rays.direction),
        bounce=None,
        throughput=dr.opaque(Array3f, 1.0, count),
        width=dr.opaque(Float, 0.0, count),
        spread=dr.opaque(Float, spread, count),
        sampler=sampler,
        bounces=dr.opaque(UInt, 0, count),
        depth=dr.opaque(UInt, 0, count),
        branch=dr.opaque(UInt, int(Branch.REFLECTED), count),
        is_within=dr.opaque(Bool, False, count),
    )
    # Evaluate now: memory shared with NumPy can't be freed while a kernel is recorded.
    dr.eval(path)
    return path


def compact(path: Path, chosen: Any) -> Path:
    """Gather the paths of a list of lanes (UInt); paths added as padding are not active."""
    if not dr.width(chosen):
        return replace(path, lane=UInt())
    index, is_real = padded(chosen)
    taken = Path(
        lane=dr.gather(UInt, path.lane, index),
        rays=dr.gather(Rays, path.rays, index),
        bounce=dr.gather(Bounce, path.bounce, index) if path.bounce else None,
        throughput=dr.select(is_real, dr.gather(Array3f, path.throughput, index), 0.0),
        width=dr.gather(Float, path.width, index),
        spread=dr.gather(Float, path.spread, index),
        sampler=dr.gather(PaddedSobolSampler, path.sampler, index),
        bounces=dr.gather(UInt, path.bounces, index),
        depth=dr.gather(UInt, path.depth, index),
        branch=dr.gather(UInt, path.branch, index),
        is_within=dr.gather(Bool, path.is_within, index),
    )
    dr.make_opaque(taken)  # a literal would be another signature of the kernels
    return taken


def merged(parts: Sequence[Path]) -> Path:
    """All paths of several lists, one list after the other."""
    filled = [part for part in parts if dr.width(part.lane)]
    if not filled:
        return parts[0]
    whole: Path = joined(filled)
    dr.eval(whole)
    return whole


def joined(parts: Sequence[Any]) -> Any:
    """The lanes of several trees of arrays, one after the other; all arrays of a tree have as many."""
    if len(parts) == 1:
        return parts[0]
    counts = [dr.width(part) for part in parts]
    starts = np.cumsum(counts) - counts
    targets = [dr.arange(UInt, n) + opaque(int(at)) for n, at in zip(counts, starts, strict=True)]
    return _joined(parts, targets, sum(counts))


def _joined(parts: Sequence[Any], targets: Sequence[Any], count: int) -> Any:
    first: Any = parts[0]
    if first is None:
        return None
    if isinstance(first, tuple):
        return tuple(_joined(of, targets, count) for of in zip(*parts, strict=True))
    if is_dataclass(first):
        kind: Any = type(first)
        return kind(*(_joined([getattr(p, f.name) for p in parts], targets, count) for f in fields(first)))
    # `drjit.concat` does not take masks.
    whole = dr.empty(type(first), count)
    for part, target in zip(parts, targets, strict=True):
        dr.scatter(whole, part, target)
    return whole


class Contributions:
    """Radiance that paths contribute to lanes, of which a lane may receive any number.

    Parameters
    ----------
    count
        Number of lanes.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._sum = dr.zeros(Array3f, count)
        self._parts: list[tuple[Any, Any]] = []

    def add_once(self, radiance: Any, lane: Any) -> None:
        """Add radiance (Array3f) to lanes (UInt), each of which at most one active path has."""
        scatter_add(self._sum, radiance, lane)

    def add(self, radiance: Any, lane: Any) -> None:
        """Add radiance (Array3f) to lanes (UInt), of which several paths may have the same."""
        # Leave out black paths, which are half of them.
        wide = radiance + dr.zeros(Array3f, dr.width(lane))
        chosen: Any = dr.compress(~dr.all(wide == 0.0))
        if dr.width(chosen):
            part = dr.gather(Array3f, wide, chosen), dr.gather(UInt, lane, chosen)
            dr.eval(part)
            self._parts.append(part)

    def summed(self) -> Any:
        """Sums of all lanes; Array3f.

        NumPy adds what several paths contribute in the order in which it came: sums of atomic additions
        depend on threads.
        """
        if not self._parts:
            return self._sum
        radiance, lane = joined(self._parts)
        dr.eval(radiance, lane)  # all axes by one kernel
        index = np.array(lane, np.intp)
        sums = (
            lanes(np.bincount(index, np.array(axis), self._count).astype(np.float32)) for axis in radiance
        )
        return self._sum + Array3f(*sums)


def scatter_add(radiance: Any, contribution: Any, lane: Any) -> None:
    """Add to the radiance of each lane, to which at most one active path contributes."""
    for target, value in zip(radiance, contribution, strict=True):
        # Without conflicts Dr.Jit needs neither atomics nor copies, and no kernel for each size.
        dr.scatter_add(target, Float(value), lane, value != 0.0, dr.ReduceMode.NoConflicts)
    dr.eval(radiance)
