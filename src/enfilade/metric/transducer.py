"""Visual masking by a transducer: faint masks help a little, strong ones hide (Legge and Foley 1980).

A channel's response to the contrast energy E that the eye gathers is R = (1 + z) E / (z + N^0.8), in
which N is the energy that inhibits it: its own and that of the two neighbouring orientations. Energy
is in units of the threshold's, so that R = 1 at threshold. R grows with the square of faint contrasts
and the power 0.4 of strong ones; so a faint mask makes a target a little easier to see (by less than
people say: 1 to 2 dB instead of 5), and with strong masks the threshold rises with the power 0.6.

Two images differ in a channel by how much more energy one has, and by how much of its pattern has
changed besides (moved, or been replaced at equal energy):

    J = abs(R(E') - R(E'')) + (D - abs(E' - E'')) (R'/E' + R''/E'') / 2,

D the gathered abs(c' abs(c') - c'' abs(c'')), which is abs(E' - E'') where only contrast differs.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

__all__ = ["energy_difference", "transduced_difference"]

Float32Array: TypeAlias = npt.NDArray[np.float32]

# Contrast enters squared and is inhibited with the power 1.6: the difference 0.4 is that of Legge and
# Foley 1980, J. Opt. Soc. Am. 70, whose exponents are 2.4 and 2.
INHIBITION_EXPONENT = 0.8  # no unit, of energy
# The one number that was fitted, to the ten masks of Foley 1994, J. Opt. Soc. Am. A 11: 1.4 dB RMS
# through the whole metric, and not above 1.6 dB from 0.6 to 0.85.
SEMI_SATURATION = 0.7  # z, no unit


def energy_difference(reference_jnd: Float32Array, test_jnd: Float32Array) -> tuple[Float32Array, ...]:
    """Energies of a channel in both images, and what differs, before they are gathered.

    Parameters
    ----------
    reference_jnd, test_jnd : (...) float32
        Contrast in units of its threshold, signed. Overwritten.

    Returns
    -------
    energy_reference, energy_test, difference : (...) float32
        c''^2, c'^2 and abs(c' abs(c') - c'' abs(c'')).
    """
    signed = np.abs(test_jnd)
    signed *= test_jnd
    difference = np.abs(reference_jnd)
    difference *= reference_jnd
    np.subtract(signed, difference, out=difference)
    np.abs(difference, out=difference)
    np.square(reference_jnd, out=reference_jnd)
    np.square(test_jnd, out=test_jnd)
    return reference_jnd, test_jnd, difference


def _gain(energy: Float32Array) -> Float32Array:
    """R / E of all orientations of a band, (n, ...) -> (n, ...)."""
    inhibition = energy.copy()
    if len(energy) > 1:
        inhibition += np.roll(energy, 1, axis=0)
        inhibition += np.roll(energy, -1, axis=0)
    np.maximum(inhibition, np.float32(0.0), out=inhibition)
    inhibition **= np.float32(INHIBITION_EXPONENT)
    inhibition += np.float32(SEMI_SATURATION)
    return np.float32(1.0 + SEMI_SATURATION) / inhibition


def transduced_difference(
    energy_reference: Float32Array, energy_test: Float32Array, difference: Float32Array
) -> Float32Array:
    """J of all orientations of a band, from gathered energies.

    Parameters
    ----------
    energy_reference, energy_test, difference : (n, ...) float32
        E'', E' and D in units of the threshold's energy, by orientation: n is 6, or 1 in the base.

    Returns
    -------
    (n, ...) float32
        JND, 0 or more; exactly 0 where the energies are equal and the difference 0. Swapping the
        images changes nothing.
    """
    gain_reference, gain_test = _gain(energy_reference), _gain(energy_test)
    jnd: Float32Array = np.abs(energy_test * gain_test - energy_reference * gain_reference)
    structure = difference - np.abs(energy_test - energy_reference)
    np.maximum(structure, np.float32(0.0), out=structure)
    gain_reference += gain_test
    gain_reference *= np.float32(0.5)
    structure *= gain_reference
    jnd += structure
    return jnd
