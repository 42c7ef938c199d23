"""Paths on their way through a scene, as lanes: lists of them that grow shorter from bounce to bounce."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import PCG32, Array3f, Float, UInt
from enfilade.kernels.replay import padded
from enfilade.renderer import Bounce, Rays, ShadingPoint

__all__ = ["Path", "begun", "chosen", "scatter_add"]


@dataclass(frozen=True)
class Path:
    """A lane's path so far: a ray on its way to a surface.

    Attributes
    ----------
    lane : UInt
        Where its light goes.
    rays : Rays
    bounce : Bounce or None
        None for camera rays.
    throughput : Array3f
    width, spread : Float
        Of the path where the ray begins, scene units, and what it gains by unit of length.
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
    def carries(self) -> Any:
        """Whether it brings anything: those that have ended or only fill up a list do not; Bool."""
        return dr.max(dr.abs(self.throughput)) > 0.0

    def width_at(self, point: ShadingPoint) -> Any:
        """Of the path where it meets a surface, scene units; Float."""
        return self.width + self.spread * point.surfaces.distance * dr.norm(self.rays.direction)


def begun(rays: Rays, rng: Any, spread: float) -> Path:
    """Paths from the camera, one a ray."""
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
    # Now, and not while a kernel is recorded: then no memory of NumPy's can be let go.
    dr.eval(path)
    return path


def chosen(path: Path, lanes: Any) -> Path:
    """Paths of some lanes; what is added to have enough of them carries nothing."""
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


def scatter_add(radiance: Any, sent: Any, lane: Any) -> None:
    """Add to each lane's radiance. A lane has one path that carries anything."""
    for target, value in zip(radiance, sent, strict=True):
        # Told that nothing meets there, Dr.Jit needs neither atomics nor copies, and no kernel for each size.
        dr.scatter_add(target, Float(value), lane, value != 0.0, dr.ReduceMode.NoConflicts)
    dr.eval(radiance)
