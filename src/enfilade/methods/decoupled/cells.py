"""What no page sees: the light in cells of space, coarser the less sharply it is seen.

Paths that a glossy, mirroring or transparent surface sends on land where no keyframe looked, again and again
in the same places. What was estimated there for some frames serves all: points are quantized with their
normals (Binder et al. 2018), by the width that a path has there (Bekaert et al. 2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, UInt64, lanes, opaque

LEVELS = 3  # sizes in which each estimate is kept: its own, twice and four times that
LEAST_ESTIMATES = 4  # in a cell that is believed
STEPS = 22  # of the binary search
MOST = 1 << STEPS  # cells that are looked up: of more, those with most estimates
COORDINATE_BITS = 14  # of a cell's place along an axis, which wraps around
LEVEL_BITS = 6
SHAPE_BITS = 13
QUANTUM = 2.0**-30  # of estimates, radiance: sums up to 2^23 fit into the 53 bits of a float64


@dataclass(frozen=True)
class Cells:
    """Light by cell, ready to be looked up.

    Attributes
    ----------
    keys : UInt64
        Rising.
    light : Array3f
        Radiance that the diffuse lobe would send if the albedo were one.
    last : UInt
        Lane of the last key.
    """

    keys: Any
    light: Any
    last: Any

    def find(self, position: Any, normal: Any, shape_index: Any, width: Any, jitter: Any) -> tuple[Any, Any]:
        """Light at points of surfaces.

        Parameters
        ----------
        position, normal : Array3f
        shape_index : UInt
        width : Float
            Of the path there, scene units.
        jitter : Array3f
            In [0, 1): moves a point by up to half a cell, so that many lookups interpolate. Where the cell
            that it is moved to is not known, its own is asked.

        Returns
        -------
        light : Array3f
        is_known : Bool
        """
        light, is_known = Array3f(0), Bool(False)
        for level in range(LEVELS):
            for moved in (jitter, 0.5):
                key = cell_key(position, normal, shape_index, width, level, moved)
                lane = self._search(key)
                is_here = dr.gather(UInt64, self.keys, lane) == key
                light = dr.select(is_here & ~is_known, dr.gather(Array3f, self.light, lane), light)
                is_known |= is_here
        return light, is_known

    def _search(self, key: Any) -> Any:
        """Lane of the first key that is not less, or the last one."""
        low, high = UInt(0), UInt(self.last)
        for _ in range(STEPS):
            middle = (low + high) >> 1
            is_less = dr.gather(UInt64, self.keys, middle) < key
            low = dr.select(is_less, dr.minimum(middle + 1, self.last), low)
            high = dr.select(is_less, high, middle)
        return low


def cell_key(
    position: Any, normal: Any, shape_index: Any, width: Any, coarser: int, jitter: Any = 0.5
) -> Any:
    """Key of the cell of a point; UInt64.

    Parameters
    ----------
    position, normal : Array3f
    shape_index : UInt
        Surfaces of several shapes never share a cell.
    width : Float
        Scene units: a cell is as wide, rounded down to a power of two.
    coarser
        How many times twice that.
    jitter : Array3f
    """
    level = Int(dr.floor(dr.log2(dr.maximum(width, 1e-9)))) + coarser
    size = dr.exp2(Float(level))
    place = Array3f(position) / size + (jitter - 0.5)
    key = UInt64(shape_index & ((1 << SHAPE_BITS) - 1))
    key = (key << LEVEL_BITS) | UInt64(UInt(level + (1 << (LEVEL_BITS - 1))) & ((1 << LEVEL_BITS) - 1))
    for axis in place:
        at = UInt(Int(dr.floor(axis))) & ((1 << COORDINATE_BITS) - 1)
        key = (key << COORDINATE_BITS) | UInt64(at)
    return (key << 3) | UInt64(_side(normal))


def _side(normal: Any) -> Any:
    """Which of the six axes a normal is nearest to, 0..5; UInt."""
    x, y, z = (dr.abs(axis) for axis in normal)
    along_x, along_y = (x >= y) & (x >= z), y >= z
    axis = dr.select(along_x, 0, dr.select(along_y, 1, 2))
    value = dr.select(along_x, normal.x, dr.select(along_y, normal.y, normal.z))
    return UInt(2 * axis + dr.select(value < 0.0, 1, 0))


@dataclass(frozen=True, eq=False)
class Estimates:
    """Sums of estimates by cell.

    Attributes
    ----------
    keys : (N,) uint64
        Rising, each once.
    sums : (N, 3) float64
    counts : (N,) int64
    """

    keys: npt.NDArray[np.uint64]
    sums: npt.NDArray[np.float64]
    counts: npt.NDArray[np.int64]

    @staticmethod
    def of(keys: npt.NDArray[np.uint64], light: npt.NDArray[np.floating[Any]]) -> Estimates:
        """Sum up estimates, of which many may fall into one cell; those that are not finite are left out.

        They are rounded to a :data:`QUANTUM`, so that sums are exact, and the same in whatever order.
        """
        is_finite = np.isfinite(light).all(axis=1)
        rounded = np.rint(light[is_finite].astype(np.float64) / QUANTUM) * QUANTUM
        return Estimates._summed(keys[is_finite], rounded, np.ones(int(is_finite.sum()), np.int64))

    @staticmethod
    def joined(parts: Sequence[Estimates]) -> Estimates:
        """Sum up what several lists know; none at all know nothing."""
        nothing = Estimates(np.zeros(0, np.uint64), np.zeros((0, 3)), np.zeros(0, np.int64))
        parts = [nothing, *parts]
        return Estimates._summed(
            np.concatenate([part.keys for part in parts]),
            np.concatenate([part.sums for part in parts]),
            np.concatenate([part.counts for part in parts]),
        )

    @staticmethod
    def _summed(keys: Any, sums: Any, counts: Any) -> Estimates:
        unique, place = np.unique(keys, return_inverse=True)
        total: Any = np.stack([np.bincount(place, s, len(unique)) for s in sums.T], axis=1)
        return Estimates(unique, total, np.bincount(place, counts, len(unique)).astype(np.int64))

    def opened(self) -> Cells | None:
        """Cells with estimates enough to be believed; None if there is none."""
        chosen = np.flatnonzero(self.counts >= LEAST_ESTIMATES)
        if not len(chosen):
            return None
        if len(chosen) > MOST:
            chosen = np.sort(chosen[np.argsort(-self.counts[chosen], kind="stable")[:MOST]])
        light = (self.sums[chosen] / self.counts[chosen, None]).astype(np.float32)
        cells = Cells(lanes(self.keys[chosen]), lanes(light[None]), opaque(len(chosen) - 1, UInt))
        dr.eval(cells)
        return cells
