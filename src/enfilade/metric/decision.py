"""From contrasts of a band's channels to what they add to the pool: masking, by either rule."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

import numpy as np
import numpy.typing as npt

from enfilade.metric.comparison import Pool
from enfilade.metric.cortex import Band
from enfilade.metric.gathered import BandWeight
from enfilade.metric.masking import masked_difference_squared
from enfilade.metric.options import Fitted, MetricOptions
from enfilade.metric.pooling import raised
from enfilade.metric.pyramid import halved_shape
from enfilade.metric.spatial import Aperture
from enfilade.metric.transducer import energy_difference, transduced_difference

__all__ = ["Channel", "Decision", "Masking", "RawChannel"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


Channel: TypeAlias = tuple[Float32Array, Float32Array | None, Float32Array]


@dataclass(frozen=True, eq=False)
class RawChannel:
    """A channel as the transform gives it, for the kernel (`metric.kernels`).

    Attributes
    ----------
    reference, difference : (padded height, padded width) float32
        Of the reference and of test - reference.
    weight : () or (h', w') float32
        From responses to contrasts in units of the threshold.
    weight_step : int
        1 where the map has every sample, 2 where it has every second.
    start : int
        First row and column that count.
    shape : tuple of int
        Height and width that count.
    """

    reference: Float32Array
    difference: Float32Array
    weight: Float32Array
    weight_step: int
    start: int
    shape: tuple[int, int]

    def error(self, step: int) -> Float32Array:
        """What differs in energy, at every `step`-th sample, a multiple of `weight_step`.

        The last samples may lie one beyond the image, in its border.
        """
        rows, columns = halved_shape(self.shape, step)
        weight = self.weight
        if weight.ndim:
            apart = step // self.weight_step
            weight = weight[::apart, ::apart][:rows, :columns]
        down, across = (slice(self.start, self.start + step * count, step) for count in (rows, columns))
        reference, difference = (
            np.multiply(plane[down, across], weight) for plane in (self.reference, self.difference)
        )
        return energy_difference(reference, np.add(difference, reference, out=difference))[2]


@dataclass(frozen=True)
class Masking:
    """How contrast hides contrast.

    Attributes
    ----------
    options : MetricOptions
        Departures from the paper.
    fitted : Fitted
        Numbers of the transducer.
    mask_slope : float
        Slope of threshold elevation.
    channel_exponent : float
        Exponent with which the J of channels are summed.
    """

    options: MetricOptions
    fitted: Fitted
    mask_slope: float
    channel_exponent: float

    @property
    def semi_saturation(self) -> float:
        """Of the transducer, z."""
        fitted = self.fitted
        return fitted.semi_saturation if self.is_broad else fitted.narrow_semi_saturation

    @property
    def weighs_gathered(self) -> bool:
        """Whether energies are gathered before they are compared, so that weights can be applied then."""
        return self.options.transducer and self.options.spatial_pooling

    @property
    def is_broad(self) -> bool:
        """Whether neighbouring bands mask."""
        return self.options.broad_masking and self.weighs_gathered


class Decision:
    """Decides, band after band, what adds to one comparison's pool.

    Parameters
    ----------
    pool : Pool
        Where to.
    masking : Masking
        By which rule.
    aperture : Aperture or None
        What gathers energies, with spatial pooling.
    """

    def __init__(self, pool: Pool, masking: Masking, aperture: Aperture | None) -> None:
        self._pool = pool
        self._masking = masking
        self._aperture = aperture
        self._waiting: list[tuple[Band, list[Float32Array]]] = []

    def add(
        self,
        band: Band,
        channels: Iterable[Channel | RawChannel],
        weight: BandWeight | None = None,
        *,
        is_transient: bool = False,
    ) -> None:
        """Add the channels of one band; bands come finest first.

        Parameters
        ----------
        band : Band
            The band.
        channels : iterable of (reference, test, difference), each (h, w) float32
            Test may be None where it is reference + difference.
            One of each orientation, signed, contrasts in units of the threshold, or responses that
            `weight` brings there; overwritten. The difference is what counts of test - reference.
        weight : BandWeight or None
            Applied to what was gathered; only with a transducer and an aperture.
        is_transient : bool
            Whether this is the change since the last frame, which nothing masks.
        """
        if not self._masking.options.transducer:
            for channel in channels:
                elevated = self._elevated(*cast(Channel, channel))
                self._pool.add(band.level, elevated, band.reduction, is_transient=is_transient)
            return
        stacks = self._energies(band, channels, weight)
        if is_transient or not self._masking.is_broad:
            self._transduce(band, stacks, (), is_transient=is_transient)
            return
        self._waiting.append((band, stacks))
        if len(self._waiting) > 1:
            finer, (before, energies), coarser = self._waiting[:-2], self._waiting[-2], self._waiting[-1:]
            self._transduce(before, energies, [stacks for _, stacks in finer + coarser])
            del self._waiting[:-2]

    def close(self) -> None:
        """Decide what waited for a neighbour; call once, after the last band."""
        if self._waiting:
            *finer, (band, energies) = self._waiting
            self._transduce(band, energies, [stacks for _, stacks in finer])
            self._waiting.clear()

    def _transduce(
        self,
        band: Band,
        stacks: list[Float32Array],
        beside: Sequence[list[Float32Array]],
        *,
        is_transient: bool = False,
    ) -> None:
        share = self._masking.fitted.neighbour_share
        inhibitions = [np.zeros_like(stacks[kind]) for kind in (0, 1)]
        for other in beside:
            for kind, inhibition in enumerate(inhibitions):
                np.add(inhibition, _spread(other[kind], len(inhibition), share), out=inhibition)
        jnd = transduced_difference(
            *stacks,
            semi_saturation=self._masking.semi_saturation,
            beside=(inhibitions[0], inhibitions[1]) if beside else None,
        )
        if self._masking.channel_exponent != 1.0:
            jnd **= np.float32(self._masking.channel_exponent)
        reduction = band.reduction if self._aperture is None else self._aperture.reduction
        self._pool.add(band.level, jnd.sum(axis=0), reduction, is_transient=is_transient)

    def _elevated(
        self, reference: Float32Array, test: Float32Array | None, difference: Float32Array
    ) -> Float32Array:
        test = reference + difference if test is None else test
        # Mutual masking: the smaller contrast of the two images masks.
        np.abs(reference, out=reference)
        np.minimum(reference, np.abs(test, out=test), out=reference)
        squared = masked_difference_squared(difference, reference, self._masking.mask_slope)
        return squared if self._masking.options.ripple_free else raised(squared)

    def _energies(
        self,
        band: Band,
        channels: Iterable[Channel | RawChannel],
        weight: BandWeight | None,
    ) -> list[Float32Array]:
        """Energies of reference and test and their difference, gathered, each (n, h, w)."""
        stacks: tuple[list[Float32Array], ...] = ([], [], [])
        for channel in channels:
            if isinstance(channel, RawChannel):
                maps = self._summed(band, channel, weight)
            else:
                maps = self._compared(band, channel, weight)
            for stack, energy in zip(stacks, maps, strict=True):
                stack.append(energy)
        if self._aperture is None:
            return [np.stack(stack) for stack in stacks]
        gathered = [self._aperture.gather(np.stack(stack), band.reduction) for stack in stacks]
        if weight is not None:
            power = weight.power()
            gathered = [energies * power for energies in gathered]
        return gathered

    def _compared(self, band: Band, channel: Channel, weight: BandWeight | None) -> tuple[Float32Array, ...]:
        """Energies of one channel, on the aperture's grid if there is one."""
        reference, _, difference = channel
        maps = energy_difference(reference, np.add(difference, reference, out=difference))
        if self._aperture is None:
            return maps
        area = self._pool.area(band.reduction)
        if area is not None:
            maps[2][...] *= area
        if weight is not None:
            weight.note(maps[2])
        return tuple(self._aperture.coarse(energy, band.reduction) for energy in maps)

    def _summed(self, band: Band, channel: RawChannel, weight: BandWeight | None) -> tuple[Float32Array, ...]:
        """The same by the kernel, for images that are judged whole."""
        from enfilade.metric.kernels import MOST_SUMMED, gathered_energies

        aperture = cast(Aperture, self._aperture)
        if weight is not None:
            weight.note(channel.error(weight.samples_apart), weight.samples_apart)
        summed = min(max(aperture.reduction // band.reduction, 1), MOST_SUMMED)
        maps = gathered_energies(
            channel.reference,
            channel.difference,
            channel.weight,
            weight_step=channel.weight_step,
            start=channel.start,
            shape=channel.shape,
            summed=summed,
        )
        return tuple(aperture.coarse(energy, band.reduction * summed) for energy in maps)


def _spread(energies: Float32Array, orientations: int, share: float) -> Float32Array:
    """What channels of a neighbouring band add to the inhibition of each orientation.

    The base, which has none, gives each a sixth, and takes the mean of all.
    """
    if len(energies) == orientations:
        return np.float32(share) * energies
    total: Float32Array = energies.sum(axis=0, keepdims=True)
    return np.float32(share / max(len(energies), orientations)) * total
