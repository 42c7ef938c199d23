"""From contrasts of a band's channels to what they add to the pool: masking, by either rule."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.comparison import Pool
from enfilade.metric.cortex import Band
from enfilade.metric.masking import masked_difference_squared
from enfilade.metric.options import MetricOptions
from enfilade.metric.pooling import raised
from enfilade.metric.spatial import Aperture
from enfilade.metric.transducer import energy_difference, transduced_difference

__all__ = ["Channel", "Decision"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


Channel: TypeAlias = tuple[Float32Array, Float32Array | None, Float32Array]


class Decision:
    """Masking under some options.

    Parameters
    ----------
    options : MetricOptions
        Departures from the paper.
    mask_slope : float
        Slope of threshold elevation.
    channel_exponent : float
        Exponent with which the J of channels are summed.
    aperture : Aperture or None
        What gathers energies, with spatial pooling.
    """

    def __init__(
        self,
        options: MetricOptions,
        mask_slope: float,
        channel_exponent: float,
        aperture: Aperture | None,
    ) -> None:
        self._is_transducer = options.transducer
        self._is_energy = options.ripple_free
        self._mask_slope = mask_slope
        self._exponent = channel_exponent
        self._aperture = aperture

    def add(
        self,
        pool: Pool,
        band: Band,
        channels: Iterable[Channel],
        *,
        is_transient: bool = False,
    ) -> None:
        """Add the channels of one band to the pool.

        Parameters
        ----------
        pool : Pool
            Where to.
        band : Band
            The band.
        channels : iterable of (reference, test, difference), each (h, w) float32
            Test may be None where it is reference + difference.
            One of each orientation, contrasts in units of the threshold, signed; overwritten. The
            difference is what counts of test - reference.
        is_transient : bool
            Whether this is the change since the last frame.
        """
        if not self._is_transducer:
            for reference, test, difference in channels:
                pool.add(
                    band.level,
                    self._elevated(reference, test, difference),
                    band.reduction,
                    is_transient=is_transient,
                )
            return
        stacks = self._energies(pool, band, channels)
        jnd = transduced_difference(*stacks)
        if self._exponent != 1.0:
            jnd **= np.float32(self._exponent)
        reduction = band.reduction if self._aperture is None else self._aperture.reduction
        pool.add(band.level, jnd.sum(axis=0), reduction, is_transient=is_transient)

    def _elevated(
        self, reference: Float32Array, test: Float32Array | None, difference: Float32Array
    ) -> Float32Array:
        test = reference + difference if test is None else test
        # Mutual masking: the smaller contrast of the two images masks.
        np.abs(reference, out=reference)
        np.minimum(reference, np.abs(test, out=test), out=reference)
        squared = masked_difference_squared(difference, reference, self._mask_slope)
        return squared if self._is_energy else raised(squared)

    def _energies(
        self,
        pool: Pool,
        band: Band,
        channels: Iterable[Channel],
    ) -> list[Float32Array]:
        """Energies of reference and test and their difference, gathered, each (n, h, w)."""
        stacks: tuple[list[Float32Array], ...] = ([], [], [])
        for reference, _, difference in channels:
            maps = energy_difference(reference, np.add(difference, reference, out=difference))
            if self._aperture is not None:
                area = pool.area(band.reduction)
                if area is not None:
                    maps[2][...] *= area
                maps = tuple(self._aperture.coarse(energy, band.reduction) for energy in maps)
            for stack, energy in zip(stacks, maps, strict=True):
                stack.append(energy)
        if self._aperture is None:
            return [np.stack(stack) for stack in stacks]
        return [self._aperture.gather(np.stack(stack), band.reduction) for stack in stacks]
