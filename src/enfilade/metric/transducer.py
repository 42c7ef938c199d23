"""Visual masking by a transducer: faint masks help a little, strong ones hide (Legge and Foley 1980).

A channel's response to the contrast energy E that the eye gathers is R = (1 + z) E / (z + N^0.8), in
which N is the energy that inhibits it: its own, that of the two neighbouring orientations and, with broad
masking, a share of that of the same orientation in the two neighbouring bands (Foley 1994 and Watson and
Solomon 1997, J. Opt. Soc. Am. A 14, have pools of about this breadth). Energy
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


def _gain(energy: Float32Array, beside: Float32Array | None, semi_saturation: float) -> Float32Array:
    """R / E of all orientations of a band, (n, ...) -> (n, ...)."""
    inhibition = energy.copy() if beside is None else energy + beside
    if len(energy) > 1:
        inhibition += np.roll(energy, 1, axis=0)
        inhibition += np.roll(energy, -1, axis=0)
    np.maximum(inhibition, np.float32(0.0), out=inhibition)
    inhibition **= np.float32(INHIBITION_EXPONENT)
    inhibition += np.float32(semi_saturation)
    return np.float32(1.0 + semi_saturation) / inhibition


def transduced_difference(
    energy_reference: Float32Array,
    energy_test: Float32Array,
    difference: Float32Array,
    *,
    semi_saturation: float,
    beside: tuple[Float32Array, Float32Array] | None = None,
) -> Float32Array:
    """J of all orientations of a band, from gathered energies.

    Parameters
    ----------
    energy_reference, energy_test, difference : (n, ...) float32
        E'', E' and D in units of the threshold's energy, by orientation: n is 6, or 1 in the base.
    semi_saturation : float
        z, above 0 (`metric.options.Fitted`).
    beside : two of (n, ...) float32, optional
        Energy of other bands that inhibits these channels besides, in the reference and in the test.

    Returns
    -------
    (n, ...) float32
        JND, 0 or more; exactly 0 where the energies are equal and the difference 0. Swapping the
        images changes nothing.
    """
    beside_reference, beside_test = beside or (None, None)
    gain_reference = _gain(energy_reference, beside_reference, semi_saturation)
    gain_test = _gain(energy_test, beside_test, semi_saturation)
    jnd: Float32Array = np.abs(energy_test * gain_test - energy_reference * gain_reference)
    structure = difference - np.abs(energy_test - energy_reference)
    np.maximum(structure, np.float32(0.0), out=structure)
    gain_reference += gain_test
    gain_reference *= np.float32(0.5)
    structure *= gain_reference
    jnd += structure
    return jnd
