"""Paths through a scene, as lanes that are compacted from bounce to bounce."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import PCG32, Array3f, Float, UInt, opaque
from enfilade.kernels.replay import padded
from enfilade.renderer import Bounce, Rays, ShadingPoint

__all__ = ["Path", "compact", "joined", "scatter_add", "spawn"]


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
    rng : PCG32
    """

    lane: Any
    rays: Rays
    bounce: Bounce | None
    throughput: Any
    width: Any
    spread: Any
    rng: Any

    @property
    def is_active(self) -> Any:
        """Whether the path has any throughput: terminated and padding paths have none; Bool."""
        return dr.max(dr.abs(self.throughput)) > 0.0

    def width_at(self, point: ShadingPoint) -> Any:
        """Width of the path where it meets a surface, scene units; Float."""
        return self.width + self.spread * point.surfaces.distance * dr.norm(self.rays.direction)


def spawn(rays: Rays, rng: Any, spread: float) -> Path:
    """Camera paths, one a ray."""
    count = dr.width(rng.state)
    path = Path(
        lane=dr.arange(UInt, count),
        rays=Rays(rays.origin + dr.zeros(Array3f, count), rays.direction),
        bounce=None,
        throughput=dr.opaque(Array3f, 1.0, count),
        width=dr.opaque(Float, 0.0, count),
        spread=dr.opaque(Float, spread, count),
        rng=rng,
    )
    # Evaluate now: memory shared with NumPy can't be freed while a kernel is recorded.
    dr.eval(path)
    return path


def compact(path: Path, lanes: Any) -> Path:
    """Gather the paths of a list of lanes; paths added as padding are not active."""
    if not dr.width(lanes):
        return Path(UInt(), path.rays, path.bounce, path.throughput, path.width, path.spread, path.rng)
    lanes, is_real = padded(lanes)
    taken = Path(
        lane=dr.gather(UInt, path.lane, lanes),
        rays=dr.gather(Rays, path.rays, lanes),
        bounce=dr.gather(Bounce, path.bounce, lanes) if path.bounce else None,
        throughput=dr.select(is_real, dr.gather(Array3f, path.throughput, lanes), 0.0),
        width=dr.gather(Float, path.width, lanes),
        spread=dr.gather(Float, path.spread, lanes),
        rng=dr.gather(PCG32, path.rng, lanes),
    )
    dr.eval(taken)
    return taken


def joined(parts: Sequence[Any]) -> Any:
    """The lanes of several trees of arrays, one after the other."""
    first: Any = parts[0]
    if len(parts) == 1 or first is None:
        return first
    if isinstance(first, tuple):
        return tuple(joined(of) for of in zip(*parts, strict=True))
    if isinstance(first, PCG32):
        found = PCG32(first)
        found.state, found.inc = joined([p.state for p in parts]), joined([p.inc for p in parts])
        return found
    if is_dataclass(first):
        kind: Any = type(first)
        return kind(*(joined([getattr(p, f.name) for p in parts]) for f in fields(first)))
    # `drjit.concat` does not take masks.
    whole, start = dr.empty(type(first), sum(map(dr.width, parts))), 0
    for part in parts:
        dr.scatter(whole, part, dr.arange(UInt, dr.width(part)) + opaque(start))
        start += dr.width(part)
    return whole


def scatter_add(radiance: Any, contribution: Any, lane: Any) -> None:
    """Add to the radiance of each lane, to which at most one active path contributes."""
    for target, value in zip(radiance, contribution, strict=True):
        # Without conflicts Dr.Jit needs neither atomics nor copies, and no kernel for each size.
        dr.scatter_add(target, Float(value), lane, value != 0.0, dr.ReduceMode.NoConflicts)
    dr.eval(radiance)
