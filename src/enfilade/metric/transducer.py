"""Visual masking by a transducer: faint masks facilitate a little, strong ones hide (Legge and Foley 1980).

A channel's response to the integrated contrast energy E is R = (1 + z) E / (z + N^0.8). The inhibiting
energy N is the channel's own, that of the two neighbouring orientations and a fraction of that of the same
orientation in the two neighbouring bands (Foley 1994 and Watson and Solomon 1997, J. Opt. Soc. Am. A 14,
have pools of about this breadth). Energy is in units of the threshold's, so that R = 1 at threshold. R
grows with the square of faint contrasts and the power 0.4 of strong ones; so a faint mask lowers the
threshold (by less than observers show: 1 to 2 dB instead of 5), and with strong masks the threshold rises
with the power 0.6.

Two images differ in a channel by their energies, and by how much of the pattern has changed besides (moved,
or been replaced at equal energy):

    J = abs(R(E') - R(E'')) + (D - abs(E' - E'')) (R'/E' + R''/E'') / 2,

D the integrated abs(c' abs(c') - c'' abs(c'')), which is abs(E' - E'') where only contrast differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enfilade.records import F32

# Contrast enters squared and is inhibited with the power 1.6: the difference 0.4 is that of Legge and
# Foley 1980, J. Opt. Soc. Am. 70, whose exponents are 2.4 and 2.
INHIBITION_EXPONENT = 0.8  # no unit, of energy


def energy_difference(reference: F32, test: F32) -> tuple[F32, F32, F32]:
    """Energies c''^2, c'^2 and abs(c' abs(c') - c'' abs(c'')) of contrasts c'', c' in thresholds.

    The contrasts are overwritten.
    """
    difference = np.abs(test)
    difference *= test
    difference -= np.abs(reference) * reference
    np.abs(difference, out=difference)
    return np.square(reference, out=reference), np.square(test, out=test), difference


@dataclass(frozen=True)
class Transducer:
    """The response function and its constants; no unit, of energy in units of the threshold's.

    Attributes
    ----------
    semi_saturation : float
        z, above 0: fitted to the ten masks of Foley 1994, together with `neighbour_fraction`
        (`studies/observers/fits.py`).
    neighbour_fraction : float
        Inhibition by a neighbouring band, relative to a neighbouring orientation; 0 or more.
    """

    semi_saturation: float = 1.3
    neighbour_fraction: float = 0.5

    def difference(self, energies: F32, neighbours: Sequence[F32] = ()) -> F32:
        """J of all orientations of a band.

        Parameters
        ----------
        energies : (3, n, ...) float32
            E'', E' and D of the band, integrated, by orientation; n is 6, in the base 1.
        neighbours : sequence of (3, m, ...) float32
            Those of the neighbouring bands.

        Returns
        -------
        (n, ...) float32
            JND, 0 or more; exactly 0 where the energies are equal and the difference 0. Swapping the
            images changes nothing.
        """
        energy_reference, energy_test, difference = energies
        gain_reference, gain_test = (
            self._gain(energies[image], [other[image] for other in neighbours]) for image in (0, 1)
        )
        jnd: F32 = np.abs(energy_test * gain_test - energy_reference * gain_reference)
        structure = difference - np.abs(energy_test - energy_reference)
        np.maximum(structure, np.float32(0.0), out=structure)
        jnd += structure * (np.float32(0.5) * (gain_reference + gain_test))
        return jnd

    def _gain(self, energy: F32, neighbours: Sequence[F32]) -> F32:
        """R / E of all orientations of a band, (n, ...) -> (n, ...)."""
        inhibition = energy.copy()
        for other in neighbours:
            inhibition += self._from_band(other, len(energy))
        if len(energy) > 1:
            inhibition += np.roll(energy, 1, axis=0)
            inhibition += np.roll(energy, -1, axis=0)
        np.maximum(inhibition, np.float32(0.0), out=inhibition)
        inhibition **= np.float32(INHIBITION_EXPONENT)
        inhibition += np.float32(self.semi_saturation)
        return np.float32(1.0 + self.semi_saturation) / inhibition

    def _from_band(self, energy: F32, orientations: int) -> F32:
        """Inhibition by a neighbouring band; the base gives each orientation a sixth, and takes the mean."""
        if len(energy) == orientations:
            return np.float32(self.neighbour_fraction) * energy
        total: F32 = energy.sum(axis=0, keepdims=True)
        return np.float32(self.neighbour_fraction / max(len(energy), orientations)) * total
