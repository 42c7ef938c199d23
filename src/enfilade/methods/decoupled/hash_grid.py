"""A world-space hash grid of irradiance, for surfaces that no prepass image shows.

Paths from different pixels and frames end on the same such surfaces. Their estimates are summed in entries
whose keys are hashes of the quantized position and normal (Binder et al. 2018) and of the width of the path
(Bekaert et al. 2003): entries are larger where they are seen less sharply.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, UInt64, lanes, opaque
from enfilade.kernels.tone import REC709_LUMINANCE

LEVELS = 3  # sizes in which each estimate is kept: its own, twice and four times that
MIN_SAMPLES, MAX_ERROR = 4, 0.5  # fewest, and largest relative standard error, of an entry that is used
NO_PARENT = np.uint64(0)
MAX_ENTRIES = 1 << 22  # that are uploaded; of more, those with the most samples
SEARCH_STEPS = (16, 8, 4, 2, 1)  # of a binary search in a bucket: up to 31 keys; the mean is at most one
QUANTUM = 2.0**-30  # of estimates after exposure: sums up to 2^23 are exact in the 53 bits of a float64


@dataclass(frozen=True)
class HashGrid:
    """Irradiance by entry, on the device.

    Attributes
    ----------
    keys : UInt64
        Rising.
    irradiance : Array3f
        Irradiance over pi.
    is_reliable : Bool
        Whether the entry is preferred to larger ones.
    last : UInt
        Lane of the last key.
    starts : UInt
        Number of keys before each bucket. The upper bits of a key are the number of its bucket: keys are
        hashes, so that buckets have about as many each.
    shift : UInt64
        Number of the lower bits.
    """

    keys: Any
    irradiance: Any
    is_reliable: Any
    last: Any
    starts: Any
    shift: Any

    def lookup(
        self, position: Any, normal: Any, shape_index: Any, width: Any, offset: Any = None, where: Any = True
    ) -> tuple[Any, Any]:
        """Irradiance over pi at points, from the smallest reliable entry, or else the largest.

        Parameters
        ----------
        position, normal : Array3f
        shape_index : UInt
        width : Float
            Of the path there, scene units.
        offset : Array3f or None
            Jitter in widths of an entry, where 0.5 is none: the mean of many lookups interpolates between
            entries. Moved points without an entry use that of the point itself.
        where : Bool
            Lanes that are looked up.

        Returns
        -------
        irradiance : Array3f
        is_found : Bool
        """
        irradiance, is_found, is_final = Array3f(0), Bool(False), ~Bool(where)
        offsets = (0.5,) if offset is None else (offset, 0.5)
        for level in range(LEVELS):
            is_open = ~is_final
            for moved in offsets:
                key = entry_key(position, normal, shape_index, width, level, moved)
                lane, is_here = self._search(key, is_open)
                irradiance = dr.select(
                    is_here, dr.gather(Array3f, self.irradiance, lane, is_here), irradiance
                )
                is_final |= is_here & dr.gather(Bool, self.is_reliable, lane, is_here)
                is_found |= is_here
                is_open &= ~is_here
        return irradiance, is_found

    def _search(self, key: Any, is_active: Any) -> tuple[Any, Any]:
        """Lane of a key, and whether there is one, by binary search in its bucket."""
        lane = dr.gather(UInt, self.starts, UInt(key >> self.shift), is_active)
        for step in SEARCH_STEPS:
            ahead = dr.minimum(lane + (step - 1), self.last)
            lane = dr.select(dr.gather(UInt64, self.keys, ahead, is_active) < key, lane + step, lane)
        lane = dr.minimum(lane, self.last)
        return lane, is_active & (dr.gather(UInt64, self.keys, lane, is_active) == key)


def entry_key(position: Any, normal: Any, shape_index: Any, width: Any, level: int, offset: Any = 0.5) -> Any:
    """Key of the entry of a point; UInt64.

    A 64-bit hash of the shape index, the size, the three coordinates of the cell (32 bits each) and the axis
    nearest to the normal. Two entries share a key with a probability of 2^-64. Among 4 million entries the
    probability of any collision is 5e-7; that of a lookup that finds a wrong entry is 2e-13.

    Parameters
    ----------
    position, normal : Array3f
    shape_index : UInt
    width : Float
        Of the path, scene units: the entry is as wide, rounded down to a power of two.
    level
        Doublings of that width.
    offset : Array3f
        See :meth:`HashGrid.lookup`.
    """
    # Quantize the position.
    exponent = Int(dr.floor(dr.log2(dr.maximum(width, 1e-9)))) + level
    size = dr.exp2(Float(exponent))
    cell = Array3f(position) / size + (offset - 0.5)

    # Hash shape, size and direction of the normal, then the coordinates.
    x, y, z = (UInt(Int(dr.floor(coordinate))) for coordinate in cell)
    key = _splitmix64(_packed(shape_index, UInt(exponent << 3) | _nearest_axis(normal)))
    key = _splitmix64(key ^ _packed(x, y))
    return _splitmix64(key ^ UInt64(z))


def _packed(high: Any, low: Any) -> Any:
    """Two UInt in a UInt64."""
    return (UInt64(high) << 32) | UInt64(low)


def _splitmix64(key: Any) -> Any:
    """SplitMix64 (Steele et al. 2014): a bijection of 64 bits that makes every bit depend on all others."""
    key = key + UInt64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> 30)) * UInt64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> 27)) * UInt64(0x94D049BB133111EB)
    return key ^ (key >> 31)


def _nearest_axis(normal: Any) -> Any:
    """Index of the axis direction nearest to a normal, 0..5: x, -x, y, -y, z, -z; UInt."""
    x, y, z = (dr.abs(component) for component in normal)
    along_x, along_y = (x >= y) & (x >= z), y >= z
    axis = dr.select(along_x, 0, dr.select(along_y, 1, 2))
    value = dr.select(along_x, normal.x, dr.select(along_y, normal.y, normal.z))
    return UInt(2 * axis + dr.select(value < 0.0, 1, 0))


@dataclass(frozen=True, eq=False)
class Entries:
    """Sums of estimates of irradiance over pi, by entry.

    Attributes
    ----------
    keys : (N,) uint64
        Rising, each once.
    sums : (N, 3) float64
    squares : (N,) float64
        Sums of squared luminance.
    counts : (N,) int64 or float64
        The latter where estimates have a weight.
    parents : (N,) uint64
        Keys of the entries of twice the size; 0 where no estimate was kept in it.
    """

    keys: npt.NDArray[np.uint64]
    sums: npt.NDArray[np.float64]
    squares: npt.NDArray[np.float64]
    counts: npt.NDArray[np.int64] | npt.NDArray[np.float64]
    parents: npt.NDArray[np.uint64]

    @staticmethod
    def of(
        levels: Sequence[npt.NDArray[np.uint64]],
        irradiance: npt.NDArray[np.floating[Any]],
        *,
        unit: float = 1.0,
    ) -> Entries:
        """Sum up estimates in entries of rising size; those that are not finite are left out.

        They are rounded to :data:`QUANTUM`, so that sums are exact and independent of the order.

        Parameters
        ----------
        levels : sequence of (N,) uint64
            Keys of each estimate, one a level.
        irradiance : (N, 3)
            Over pi.
        unit
            Radiance that is 1 after exposure.
        """
        unit = 2.0 ** round(math.log2(unit))  # multiples of it are exact
        is_finite = np.isfinite(irradiance).all(axis=1)
        light = irradiance[is_finite].astype(np.float64)
        light, squares = (
            np.rint(v / quantum) * quantum
            for v, quantum in (
                (light, QUANTUM * unit),
                (np.square(light @ REC709_LUMINANCE), QUANTUM * unit**2),
            )
        )
        ones, keys = np.ones(len(light), np.int64), [level[is_finite] for level in levels]
        parents = [*keys[1:], np.full(len(light), NO_PARENT)]
        return Entries.joined(
            [Entries(key, light, squares, ones, above) for key, above in zip(keys, parents, strict=True)]
        )

    def weighted(self, weight: float) -> Entries:
        """The entries as if each estimate had been made so often; a fraction of few bits keeps sums exact."""
        if weight == 1:
            return self
        sums, squares, counts = (np.multiply(of, weight) for of in (self.sums, self.squares, self.counts))
        return replace(self, sums=sums, squares=squares, counts=counts)

    @staticmethod
    def joined(parts: Sequence[Entries]) -> Entries:
        """Sum up several lists of entries; of none, the empty list."""
        empty = np.zeros(0, np.uint64)
        parts = [Entries(empty, np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64), empty), *parts]
        keys, place = np.unique(np.concatenate([part.keys for part in parts]), return_inverse=True)
        sums, squares, counts, above = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("sums", "squares", "counts", "parents")
        )
        totals: Any = [np.bincount(place, v, len(keys)) for v in (*sums.T, squares, counts)]
        parents, has_parent = np.full(len(keys), NO_PARENT), above != NO_PARENT
        parents[place[has_parent]] = above[has_parent]
        return Entries(keys, np.stack(totals[:3], axis=1), totals[3], totals[4].astype(counts.dtype), parents)

    def upload(self) -> HashGrid | None:
        """Upload the entries with enough samples; None if there are none."""
        # Choose the entries that no single path dominates, but for those without light: a few paths miss rare
        # light by chance, and entries that have found it are often left out.
        count = np.maximum(self.counts, 2)
        irradiance = self.sums / count[:, None]
        mean = irradiance @ REC709_LUMINANCE
        deviation = np.maximum(self.squares - count * np.square(mean), 0.0)  # sum of squared deviations
        error = np.sqrt(deviation / (count * (count - 1))) / np.maximum(mean, np.finfo(float).tiny)
        is_reliable = self._are_reliable(mean, deviation)
        chosen = np.flatnonzero(
            is_reliable | ((self.counts >= MIN_SAMPLES) & (error <= MAX_ERROR) & (mean > 0.0))
        )
        if not len(chosen):
            return None
        if len(chosen) > MAX_ENTRIES:
            chosen = np.sort(chosen[np.argsort(-self.counts[chosen], kind="stable")[:MAX_ENTRIES]])
        irradiance, is_reliable = irradiance[chosen], is_reliable[chosen]
        shift = 64 - max(math.ceil(math.log2(len(chosen))), 1)
        buckets = (self.keys[chosen] >> np.uint64(shift)).astype(np.int64)
        sizes = np.bincount(buckets, minlength=1 << (64 - shift))
        grid = HashGrid(
            lanes(self.keys[chosen]),
            lanes(irradiance.astype(np.float32)[None]),
            lanes(is_reliable),
            opaque(len(chosen) - 1, UInt),
            lanes((np.cumsum(sizes) - sizes).astype(np.uint32)),
            opaque(shift, UInt64),
        )
        dr.eval(grid)
        return grid

    def _are_reliable(
        self, mean: npt.NDArray[np.float64], deviation: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.bool_]:
        """Entries that are preferred to their parents, (N,).

        Their own values decide nothing: if lit entries were preferred and dark ones were not, dark surfaces
        would have the mean of both, and the scene more light than it has. The variance of an estimate is
        that of all children of a parent together, each about its own mean, and its error is relative to the
        light of the parent.

        Parameters
        ----------
        mean, deviation : (N,) float64
            Mean luminance of each entry, and the sum of squared deviations from it.
        """
        found = np.minimum(np.searchsorted(self.keys, self.parents), max(len(self.keys) - 1, 0))
        has_parent = (self.parents != NO_PARENT) & (self.keys[found] == self.parents)
        child, parent = np.flatnonzero(has_parent), found[has_parent]
        freedom = np.bincount(parent, np.maximum(self.counts[child] - 1, 0), len(self.keys))
        pooled = np.bincount(parent, deviation[child], len(self.keys)) / np.maximum(freedom, 1.0)
        is_reliable = np.zeros(len(self.keys), np.bool_)
        error, counts = np.sqrt(pooled[parent] / self.counts[child]), self.counts[child]
        is_reliable[child] = (counts >= MIN_SAMPLES) & (error <= MAX_ERROR * mean[parent])
        return is_reliable
