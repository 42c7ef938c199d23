"""Interpolation between keys: continuous velocity, no overshoot, and a real stop where two keys are equal.

Values go by PCHIP (Fritsch and Butland 1984, as SciPy has it): a cubic whose slope at a key is the
weighted harmonic mean of the slopes beside it, or zero where they differ in sign. Each coordinate stays
between its keys. Rotations take the same slopes for their rotation vectors, and between keys the
cumulative cubic Bézier curve of Kim, Kim and Shin, "A General Construction Scheme for Unit Quaternion
Curves with Simple High Order Derivatives", SIGGRAPH 1995.
"""

from __future__ import annotations

import numpy as np

from enfilade.camera import Matrix, look_at


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
    from scipy.interpolate import PchipInterpolator

    if len(knots) == 1:
        return np.repeat(values, len(times), axis=0)
    with np.errstate(over="ignore"):  # the reciprocal of a denormal slope; its mean is rightly 0
        result: Matrix = PchipInterpolator(knots, values, axis=0)(times)
    return result


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
    return np.stack([look_at(e, a, u)[:3, :3] for e, a, u in zip(eyes, aims, upward, strict=True)])


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
    from scipy.interpolate import PchipInterpolator
    from scipy.spatial.transform import Rotation

    if len(knots) == 1:
        return np.repeat(rotations, len(times), axis=0)
    # turns between keys as rotation vectors, and angular velocities at the keys, in the camera's own axes
    at_key = Rotation.from_matrix(rotations)
    turn = (at_key[:-1].inv() * at_key[1:]).as_rotvec()
    travelled = np.concatenate([np.zeros((1, 3)), np.cumsum(turn, axis=0)])
    with np.errstate(over="ignore"):
        rate = PchipInterpolator(knots, travelled, axis=0).derivative()(knots)

    # control rotations of the cubic Bézier curve of each interval
    span = np.diff(knots)[:, None]
    leave = Rotation.from_rotvec(rate[:-1] * span / 3.0)
    arrive = Rotation.from_rotvec(rate[1:] * span / 3.0)
    middle = leave.inv() * Rotation.from_rotvec(turn) * arrive.inv()

    # cumulative Bernstein weights at each time's place in its interval
    k = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    u = ((times - knots[k]) / span[k, 0])[:, None]
    first, second, third = 1.0 - (1.0 - u) ** 3, u**2 * (3.0 - 2.0 * u), u**3
    curve = (
        at_key[k]
        * Rotation.from_rotvec(first * leave.as_rotvec()[k])
        * Rotation.from_rotvec(second * middle.as_rotvec()[k])
        * Rotation.from_rotvec(third * arrive.as_rotvec()[k])
    )
    result: Matrix = curve.as_matrix()
    return result
