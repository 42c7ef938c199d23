"""Interpolation between keys: continuous velocity, no overshoot, and a real stop where two keys are equal.

Values go by PCHIP (Fritsch and Butland 1984): a cubic whose slope at a key is the weighted harmonic mean
of the slopes beside it, or zero where they differ in sign. Each coordinate stays between its keys. It is
the curve of SciPy's ``PchipInterpolator``, which takes the better part of a second to import. Rotations
take the same slopes for their rotation vectors, and between keys the cumulative cubic Bézier curve of Kim,
Kim and Shin, "A General Construction Scheme for Unit Quaternion Curves with Simple High Order
Derivatives", SIGGRAPH 1995.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from enfilade.camera.pinhole import Matrix, look_at
from enfilade.camera.rotation import from_vector, to_vector


def interpolate_values(knots: Matrix, values: Matrix, times: Matrix) -> Matrix:
    """PCHIP of each column.

    Parameters
    ----------
    knots : (K,) float64
        Rising, seconds.
    values : (K, C) float64
    times : (N,) float64
        Within the knots.

    Returns
    -------
    (N, C) float64
    """
    if len(knots) == 1:
        return np.repeat(values, len(times), axis=0)
    k, u, span = _places(knots, times)
    slope, rise = slopes(knots, values), np.diff(values, axis=0)[k]
    leave, arrive = span * slope[k], span * slope[k + 1]
    bend = 3.0 * rise - 2.0 * leave - arrive + u * (leave + arrive - 2.0 * rise)
    result: Matrix = values[k] + u * (leave + u * bend)
    return result


def slopes(knots: Matrix, values: Matrix) -> Matrix:
    """Slopes of PCHIP at the knots.

    Parameters
    ----------
    knots : (K,) float64
        Rising, two at least.
    values : (K, C) float64

    Returns
    -------
    (K, C) float64
        In units of the values per unit of the knots.
    """
    span = np.diff(knots)[:, None]
    chord = np.diff(values, axis=0) / span
    if len(knots) == 2:
        return np.repeat(chord, 2, axis=0)
    before, after = chord[:-1], chord[1:]
    is_turn = np.sign(before) * np.sign(after) <= 0.0
    first, second = span[:-1] + 2.0 * span[1:], 2.0 * span[:-1] + span[1:]
    with np.errstate(over="ignore"):  # the reciprocal of a denormal slope; its mean is rightly 0
        inverse = first / np.where(is_turn, 1.0, before) + second / np.where(is_turn, 1.0, after)
    inner = np.where(is_turn, 0.0, (first + second) / inverse)
    start = _end_slope(span[0], span[1], chord[0], chord[1])
    end = _end_slope(span[-1], span[-2], chord[-1], chord[-2])
    return np.concatenate([start[None], inner, end[None]])


def _end_slope(span: Matrix, next_span: Matrix, chord: Matrix, next_chord: Matrix) -> Matrix:
    """The parabola's slope through the last three values, kept within what overshoots nothing."""
    slope = ((2.0 * span + next_span) * chord - span * next_chord) / (span + next_span)
    is_limited = (np.sign(chord) != np.sign(next_chord)) & (np.abs(slope) > 3.0 * np.abs(chord))
    result: Matrix = np.where(is_limited, 3.0 * chord, slope)
    return np.where(np.sign(slope) != np.sign(chord), 0.0, result)


def _places(knots: Matrix, times: Matrix) -> tuple[npt.NDArray[np.intp], Matrix, Matrix]:
    """Each time's interval (N,), its place therein from 0 to 1 (N, 1), and the interval's length (N, 1)."""
    k = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    span = np.diff(knots)[k, None]
    return k, (times - knots[k])[:, None] / span, span


def interpolate_aims(knots: Matrix, targets: Matrix, ups: Matrix, times: Matrix, eyes: Matrix) -> Matrix:
    """Rotations that look from given eyes at the interpolated targets.

    Parameters
    ----------
    knots : (K,) float64
    targets, ups : (K, 3) float64
    times : (N,) float64
    eyes : (N, 3) float64

    Returns
    -------
    (N, 3, 3) float64

    Raises
    ------
    CameraPathError
        At some time the eye meets its target, or the view is along up.
    """
    aims = interpolate_values(knots, targets, times)
    upward = interpolate_values(knots, ups, times)
    return look_at(eyes, aims, upward)[:, :3, :3]


def interpolate_rotations(knots: Matrix, rotations: Matrix, times: Matrix) -> Matrix:
    """Rotations with continuous angular velocity; the shorter way round between keys.

    Parameters
    ----------
    knots : (K,) float64
    rotations : (K, 3, 3) float64
    times : (N,) float64

    Returns
    -------
    (N, 3, 3) float64
    """
    if len(knots) == 1:
        return np.repeat(rotations, len(times), axis=0)
    # turns between keys as rotation vectors, and angular velocities at the keys, in the camera's own axes
    turn = to_vector(rotations[:-1].transpose(0, 2, 1) @ rotations[1:])
    travelled = np.concatenate([np.zeros((1, 3)), np.cumsum(turn, axis=0)])
    rate, span = slopes(knots, travelled), np.diff(knots)[:, None]

    # control rotations of the cubic Bézier curve of each interval
    leave, arrive = rate[:-1] * span / 3.0, rate[1:] * span / 3.0
    middle = to_vector(from_vector(-leave) @ from_vector(turn) @ from_vector(-arrive))

    # cumulative Bernstein weights at each time's place in its interval
    k, u, _ = _places(knots, times)
    first, second, third = 1.0 - (1.0 - u) ** 3, u**2 * (3.0 - 2.0 * u), u**3
    parts = [
        from_vector(weight * part[k]) for weight, part in ((first, leave), (second, middle), (third, arrive))
    ]
    result: Matrix = rotations[k] @ parts[0] @ parts[1] @ parts[2]
    return result
