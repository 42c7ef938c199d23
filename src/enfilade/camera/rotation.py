"""Rotations as matrices, quaternions and rotation vectors, many at a time.

A rotation vector is the axis times the angle in radians. SciPy has all this; to read it takes as long as
everything else that a command does before it can refuse its input.
"""

from __future__ import annotations

import numpy as np

from enfilade.camera.pinhole import Matrix


def from_quaternion(quaternion: Matrix) -> Matrix:
    """The rotation of a quaternion w x y z of any length but 0, (4,) float64, as (3, 3) float64."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def from_vector(vectors: Matrix) -> Matrix:
    """The rotations of rotation vectors (N, 3) float64, by Rodrigues' formula, as (N, 3, 3) float64."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    along = np.sinc(angle / np.pi)  # sin(angle) / angle
    twice = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2  # (1 - cos(angle)) / angle^2
    result: Matrix = np.eye(3) + along * cross + twice * (cross @ cross)
    return result


def to_vector(rotations: Matrix) -> Matrix:
    """Rotation vectors (N, 3) float64 of rotations (N, 3, 3) float64, none longer than pi."""
    quaternion = _to_quaternion(rotations)
    real, imaginary = quaternion[:, :1], quaternion[:, 1:]
    imaginary = np.where(real < 0.0, -imaginary, imaginary)  # the shorter way round
    sine = np.linalg.norm(imaginary, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.abs(real))
    return imaginary * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 2.0)


def _to_quaternion(rotations: Matrix) -> Matrix:
    """Unit quaternions w x y z, by the largest of their components (Shepperd 1978)."""
    (a, b, c), (d, e, f), (g, h, i) = rotations.transpose(1, 2, 0)
    products = np.array(  # 4 q q^T: each row is a quaternion, the longest the most exact
        [
            [1.0 + a + e + i, h - f, c - g, d - b],
            [h - f, 1.0 + a - e - i, b + d, c + g],
            [c - g, b + d, 1.0 - a + e - i, f + h],
            [d - b, c + g, f + h, 1.0 - a - e + i],
        ]
    )
    largest = np.argmax(products[range(4), range(4)], axis=0)
    chosen = products[largest, :, np.arange(len(rotations))]
    result: Matrix = chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
    return result
