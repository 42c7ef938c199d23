"""Entries of the hash grid: sums of estimates, and which of them are used."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.decoupled.hash_grid import LEVELS, SIZE_MASK, HashGrid

MIN_SAMPLES, MAX_ERROR = 4, 0.5  # fewest, and largest relative standard error, of an entry that is used
MAX_ENTRIES = 1 << 22  # that are uploaded; where there are more, they need more samples
QUANTUM = 2.0**-30  # of estimates after exposure: sums up to 2^23 are exact in the 53 bits of a float64


@dataclass(frozen=True, eq=False)
class Entries:
    """Sums of estimates of irradiance over pi, by entry; mostly of the size that the estimates' paths have.

    Attributes
    ----------
    keys : (N,) uint64
        Rising, each once.
    sums : (N, 3 or 6) float64
        Of all light; then without emitters that cast sharp shadows where the scene has any.
    squares : (N,) float64
        Sums of the squared luminance of all light.
    counts : (N,) float64
        Numbers of estimates, each times its weight.
    larger : (N, LEVELS) uint64
        Keys of the larger entries around each, each of twice the size of the one before. Points are not
        looked up in the last one.
    """

    keys: npt.NDArray[np.uint64]
    sums: npt.NDArray[np.float64]
    squares: npt.NDArray[np.float64]
    counts: npt.NDArray[np.float64]
    larger: npt.NDArray[np.uint64]

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
        levels : ``1 + LEVELS`` of (N,) uint64
            Keys of each estimate: of the entry of its own size, and of larger ones.
        irradiance : (N, 3 or 6)
            Over pi, as of `sums`.
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
                (np.square(light[:, :3] @ REC709_LUMINANCE), QUANTUM * unit**2),
            )
        )
        keys, *larger = (level[is_finite] for level in levels)
        return Entries.joined([Entries(keys, light, squares, np.ones(len(light)), np.column_stack(larger))])

    def weighted(self, weight: float) -> Entries:
        """The entries as if each estimate had been made so often; a fraction of few bits keeps sums exact."""
        if weight == 1:
            return self
        sums, squares, counts = (np.multiply(of, weight) for of in (self.sums, self.squares, self.counts))
        return replace(self, sums=sums, squares=squares, counts=counts)

    def without(self, others: Entries) -> Entries:
        """The entries at which a lookup finds none of some others."""
        chain = np.column_stack([self.keys, self.larger[:, : LEVELS - 1]])
        own = ~np.isin(chain, others.keys).any(axis=1)
        return Entries(self.keys[own], self.sums[own], self.squares[own], self.counts[own], self.larger[own])

    @staticmethod
    def joined(parts: Sequence[Entries]) -> Entries:
        """Sum up several lists of entries; of none, the empty list."""
        empty, larger = np.zeros(0, np.uint64), np.zeros((0, LEVELS), np.uint64)
        width = max((part.sums.shape[1] for part in parts), default=3)
        parts = [part for part in parts if len(part.keys)]
        parts = [Entries(empty, np.zeros((0, width)), np.zeros(0), np.zeros(0), larger), *parts]
        keys, first, place = np.unique(
            np.concatenate([part.keys for part in parts]), return_index=True, return_inverse=True
        )
        sums, squares, counts, larger = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("sums", "squares", "counts", "larger")
        )
        totals: Any = [np.bincount(place, v, len(keys)) for v in (*sums.T, squares, counts)]
        return Entries(keys, np.stack(totals[:-2], axis=1), totals[-2], totals[-1], larger[first])

    def upload(self) -> HashGrid | None:
        """Upload the entries with enough samples; None if there are none."""
        min_samples = MIN_SAMPLES
        keys, irradiance = self.chosen(min_samples)
        while len(keys) > MAX_ENTRIES:  # their samples go to larger ones
            min_samples *= 2
            keys, irradiance = self.chosen(min_samples)
        return HashGrid.of(keys, irradiance) if len(keys) else None

    def chosen(self, min_samples: int) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.float64]]:
        """Keys and irradiance (N, 3 or 6) of the entries that are looked up.

        Entries are chosen from the smallest size up, and the samples of a chosen one are left out of larger
        ones: they contain what is left to them, and lookups that are distributed as the samples are find as
        much light. If larger entries were means of all samples, places that few paths reach would have the
        light of places that many reach.

        They are judged in groups, those of one size inside the next larger entry: the variance of a sample is
        that of the group, each entry about its own mean, and the error is relative to the light of the group.
        If each were judged by its own samples, those that missed light by chance would be left out and those
        that found it kept, or the other way round. Groups that have found no light are left out, since a few
        paths miss rare light.

        Parameters
        ----------
        min_samples
            Of an entry.
        """
        values = np.column_stack([self.sums, self.squares, self.counts])
        chain = np.column_stack([self.keys, self.larger])
        sizes = (chain[:, :LEVELS] & np.uint64(SIZE_MASK)).astype(np.uint8)
        is_left = np.ones(len(self.keys), np.bool_)  # rows whose samples no chosen entry has
        keys, means = [np.zeros(0, np.uint64)], [np.zeros((0, self.sums.shape[1]))]
        for size in np.unique(sizes):
            # Sum up the samples that are left in each entry of this size.
            row, level = np.nonzero((sizes == size) & is_left[:, None])
            entries, first, place = np.unique(chain[row, level], return_index=True, return_inverse=True)
            *sums, squares, counts = (np.bincount(place, of, len(entries)) for of in values[row].T)
            irradiance = np.stack(sums, axis=1) / counts[:, None]
            mean = irradiance[:, :3] @ REC709_LUMINANCE
            deviation = np.maximum(squares - counts * np.square(mean), 0.0)  # sum of squared deviations

            # Judge each with its group.
            _, group = np.unique(chain[row[first], level[first] + 1], return_inverse=True)
            freedom = np.maximum(np.bincount(group, np.maximum(counts - 1.0, 0.0)), 1.0)
            variance = np.bincount(group, deviation) / freedom
            group_mean = np.bincount(group, counts * mean) / np.bincount(group, counts)
            error = np.sqrt(variance[group] / counts)
            is_chosen = (counts >= min_samples) & (error < MAX_ERROR * group_mean[group])

            is_left[row] = ~is_chosen[place]
            keys.append(entries[is_chosen])
            means.append(irradiance[is_chosen])
        return np.concatenate(keys), np.concatenate(means)
