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

LEVELS = 3  # sizes in which points are looked up: that of their path, twice and four times that
MIN_SAMPLES, MAX_ERROR = 4, 0.5  # fewest, and largest relative standard error, of an entry that is used
NO_PARENT = np.uint64(0)
SIZE_BITS, SIZE_OFFSET = 127, 32  # of a key: the exponent of the entry's size, plus the offset
MIN_WIDTH, MAX_WIDTH = 1e-9, 2.0**90  # of paths, scene units: exponents that these bits can hold
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
    last: Any
    starts: Any
    shift: Any

    def lookup(
        self, position: Any, normal: Any, shape_index: Any, width: Any, offset: Any = None, where: Any = True
    ) -> tuple[Any, Any]:
        """Irradiance over pi at points, from the smallest entry.

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
        irradiance, is_found = Array3f(0), Bool(False)
        offsets = (0.5,) if offset is None else (offset, 0.5)
        for level in range(LEVELS):
            for moved in offsets:
                key = entry_key(position, normal, shape_index, width, level, moved)
                lane, is_here = self._search(key, Bool(where) & ~is_found)
                irradiance = dr.select(
                    is_here, dr.gather(Array3f, self.irradiance, lane, is_here), irradiance
                )
                is_found |= is_here
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

    57 bits of a hash of the shape index, the size, the three coordinates of the cell (32 bits each) and the
    axis nearest to the normal; the lowest seven bits are the exponent of the size. Two entries of a size
    share a key with a probability of 2^-57. Among 4 million entries the probability of any collision is
    6e-5; that of a lookup that finds a wrong entry is 3e-11.

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
    exponent = Int(dr.floor(dr.log2(dr.clip(width, MIN_WIDTH, MAX_WIDTH)))) + level
    size = dr.exp2(Float(exponent))
    cell = Array3f(position) / size + (offset - 0.5)

    # Hash shape, size and direction of the normal, then the coordinates.
    x, y, z = (UInt(Int(dr.floor(coordinate))) for coordinate in cell)
    key = _splitmix64(_packed(shape_index, UInt(exponent << 3) | _nearest_axis(normal)))
    key = _splitmix64(key ^ _packed(x, y))
    key = _splitmix64(key ^ UInt64(z))
    return (key & UInt64(2**64 - 1 - SIZE_BITS)) | UInt64(exponent + SIZE_OFFSET)


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
    """Sums of estimates of irradiance over pi, by entry of the size that the estimates' paths have.

    Attributes
    ----------
    keys : (N,) uint64
        Rising, each once.
    sums : (N, 3) float64
    squares : (N,) float64
        Sums of squared luminance.
    counts : (N,) int64 or float64
        The latter where estimates have a weight.
    parents : (N, LEVELS) uint64
        Keys of the larger entries around each, each of twice the size of the one before; 0 where it is not
        known. Points are not looked up in the last one.
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
        """Sum up estimates in entries; those that are not finite are left out.

        They are rounded to :data:`QUANTUM`, so that sums are exact and independent of the order.

        Parameters
        ----------
        levels : sequence of (N,) uint64
            Keys of each estimate: of the entry of its own size, and of larger ones, up to ``1 + LEVELS``.
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
        keys, *parents = (level[is_finite] for level in levels)
        above = np.full((len(light), LEVELS), NO_PARENT)
        for column, key in enumerate(parents):
            above[:, column] = key
        return Entries.joined([Entries(keys, light, squares, np.ones(len(light), np.int64), above)])

    def weighted(self, weight: float) -> Entries:
        """The entries as if each estimate had been made so often; a fraction of few bits keeps sums exact."""
        if weight == 1:
            return self
        sums, squares, counts = (np.multiply(of, weight) for of in (self.sums, self.squares, self.counts))
        return replace(self, sums=sums, squares=squares, counts=counts)

    @staticmethod
    def joined(parts: Sequence[Entries]) -> Entries:
        """Sum up several lists of entries; of none, the empty list."""
        empty, above = np.zeros(0, np.uint64), np.zeros((0, LEVELS), np.uint64)
        parts = [Entries(empty, np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64), above), *parts]
        keys, first, place = np.unique(
            np.concatenate([part.keys for part in parts]), return_index=True, return_inverse=True
        )
        sums, squares, counts, parents = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("sums", "squares", "counts", "parents")
        )
        totals: Any = [np.bincount(place, v, len(keys)) for v in (*sums.T, squares, counts)]
        return Entries(
            keys, np.stack(totals[:3], axis=1), totals[3], totals[4].astype(counts.dtype), parents[first]
        )

    def upload(self) -> HashGrid | None:
        """Upload the entries with enough samples; None if there are none."""
        keys, irradiance, counts = self._chosen()
        if not len(keys):
            return None
        if len(keys) > MAX_ENTRIES:
            most = np.argsort(-counts, kind="stable")[:MAX_ENTRIES]
            keys, irradiance = keys[most], irradiance[most]
        order = np.argsort(keys)
        keys, irradiance = keys[order], irradiance[order]
        shift = 64 - max(math.ceil(math.log2(len(keys))), 1)
        buckets = (keys >> np.uint64(shift)).astype(np.int64)
        sizes = np.bincount(buckets, minlength=1 << (64 - shift))
        grid = HashGrid(
            lanes(keys),
            lanes(irradiance.astype(np.float32)[None]),
            opaque(len(keys) - 1, UInt),
            lanes((np.cumsum(sizes) - sizes).astype(np.uint32)),
            opaque(shift, UInt64),
        )
        dr.eval(grid)
        return grid

    def _chosen(self) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Keys, irradiance (N, 3) and numbers of samples of the entries that are looked up.

        Entries are judged from the smallest size up, and the samples of a chosen one are left out of larger
        ones. Each sample thus counts where paths end that find no smaller entry, as it did itself. If the
        larger ones were means of all samples, places that few paths reach would have the light of those that
        many reach.

        What an entry happens to have found decides nothing: if lit entries were preferred and dark ones were
        not, the scene would have more light than it has. The variance of an estimate is that of all entries
        in the next larger one together, each about its own mean, and its error is relative to their light.
        Where none has found any, all are too few: rare light is missed by chance.
        """
        # List each smallest entry at every level, with the key of the next larger one.
        chain = np.column_stack([self.keys, self.parents])
        row, level = np.nonzero(chain[:, :LEVELS] != NO_PARENT)
        own, above = chain[row, level], chain[row, level + 1]
        above = np.where(above != NO_PARENT, above, own)
        size = (own & np.uint64(SIZE_BITS)).astype(np.uint8)

        values = np.column_stack([self.sums, self.squares, self.counts])
        is_left = np.ones(len(self.keys), np.bool_)  # smallest entries that no chosen one contains
        keys, means, samples = [np.zeros(0, np.uint64)], [np.zeros((0, 3))], [np.zeros(0)]
        for one in np.unique(size):
            # Sum up what is left in each entry of this size.
            left = np.flatnonzero((size == one) & is_left[row])
            entries, first, place = np.unique(own[left], return_index=True, return_inverse=True)
            *sums, squares, counts = (np.bincount(place, of, len(entries)) for of in values[row[left]].T)
            irradiance = np.stack(sums, axis=1) / counts[:, None]
            mean = irradiance @ REC709_LUMINANCE
            deviation = np.maximum(squares - counts * np.square(mean), 0.0)  # sum of squared deviations

            # Judge it together with the others in the next larger entry.
            _, group = np.unique(above[left[first]], return_inverse=True)
            freedom = np.maximum(np.bincount(group, np.maximum(counts - 1.0, 0.0)), 1.0)
            variance = (np.bincount(group, deviation) / freedom)[group]
            light = (np.bincount(group, counts * mean) / np.bincount(group, counts))[group]
            is_chosen = (counts >= MIN_SAMPLES) & (np.sqrt(variance / counts) < MAX_ERROR * light)

            is_left[row[left]] = ~is_chosen[place]
            keys.append(entries[is_chosen])
            means.append(irradiance[is_chosen])
            samples.append(counts[is_chosen].astype(np.float64))
        return np.concatenate(keys), np.concatenate(means), np.concatenate(samples)
