"""A world-space hash grid of irradiance, for surfaces that no prepass image shows.

Paths from different pixels and frames end on the same such surfaces. Their estimates are summed in entries
whose keys are hashes of the quantized position and normal (Binder et al. 2018) and of the width of the path
(Bekaert et al. 2003): entries are larger where they are seen less sharply.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, UInt64, lanes, opaque

LEVELS = 3  # sizes in which points are looked up: that of their path, twice and four times that
SIZE_MASK, SIZE_OFFSET = 127, 32  # of a key: the exponent of the entry's size, plus the offset
MIN_WIDTH, MAX_WIDTH = 1e-9, 2.0**90  # of paths, scene units: exponents that these bits can hold
# Of entries: planes at round coordinates lie inside of entries of all sizes, not between two.
ORIGIN = 1.0 / 3.0
SEARCH_STEPS = (16, 8, 4, 2, 1)  # of a binary search in a bucket: up to 31 keys; the mean is at most one


@dataclass(frozen=True)
class HashGrid:
    """Irradiance by entry, on the device.

    Attributes
    ----------
    keys : UInt64
        Rising.
    irradiance : Array3f
        Irradiance over pi.
    soft : Array3f or None
        The same without emitters that cast sharp shadows; None where the scene has none.
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
    soft: Any
    last: Any
    starts: Any
    shift: Any

    @staticmethod
    def of(keys: npt.NDArray[np.uint64], irradiance: npt.NDArray[np.float64]) -> HashGrid:
        """Upload entries.

        Parameters
        ----------
        keys : (N,) uint64
            Each once, in any order; at least one.
        irradiance : (N, 3 or 6) float64
            Over pi: of all light; then without emitters that cast sharp shadows.
        """
        order = np.argsort(keys)
        keys, irradiance = keys[order], irradiance[order]
        shift = 64 - max(math.ceil(math.log2(len(keys))), 1)
        buckets = (keys >> np.uint64(shift)).astype(np.int64)
        sizes = np.bincount(buckets, minlength=1 << (64 - shift))
        light, soft = irradiance[None, :, :3], irradiance[None, :, 3:]
        grid = HashGrid(
            lanes(keys),
            lanes(light.astype(np.float32)),
            lanes(soft.astype(np.float32)) if soft.size else None,
            opaque(len(keys) - 1, UInt),
            lanes((np.cumsum(sizes) - sizes).astype(np.uint32)),
            opaque(shift, UInt64),
        )
        dr.eval(grid)
        return grid

    def lookup(
        self,
        position: Any,
        normal: Any,
        shape_index: Any,
        width: Any,
        offset: Any = None,
        where: Any = True,
        *,
        soft_only: bool = False,
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
        soft_only
            Whether emitters that cast sharp shadows are left out.

        Returns
        -------
        irradiance : Array3f
        is_found : Bool
        """
        irradiance, is_found = Array3f(0), Bool(False)
        stored = self.soft if soft_only else self.irradiance
        offsets = (0.5,) if offset is None else (offset, 0.5)
        for level in range(LEVELS):
            for moved in offsets:
                key = entry_key(position, normal, shape_index, width, level, moved)
                lane, is_here = self._search(key, Bool(where) & ~is_found)
                irradiance = dr.select(is_here, dr.gather(Array3f, stored, lane, is_here), irradiance)
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

    57 bits of a hash of the shape index, the size, the three coordinates of the entry (32 bits each) and the
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
    entry = (Array3f(position) + ORIGIN) / size + (offset - 0.5)

    # Hash shape, size and direction of the normal, then the coordinates.
    x, y, z = (UInt(Int(dr.floor(coordinate))) for coordinate in entry)
    key = _splitmix64(_packed(shape_index, UInt(exponent << 3) | _nearest_axis(normal)))
    key = _splitmix64(key ^ _packed(x, y))
    key = _splitmix64(key ^ UInt64(z))
    return (key & UInt64(2**64 - 1 - SIZE_MASK)) | UInt64(exponent + SIZE_OFFSET)


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
