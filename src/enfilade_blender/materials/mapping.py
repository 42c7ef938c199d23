# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions from Blender's parameters to Mitsuba's."""

from __future__ import annotations

import math

import numpy as np

from enfilade_blender.materials.values import Matrix3


def interface_ior(ior: float, level: float) -> float:
    """Index of refraction of the Principled BSDF's interface; its level scales the reflectance at the normal.

    Parameters
    ----------
    ior
    level : float
        Specular IOR Level, 0.5 leaves the reflectance as it is.
    """
    reflectance = min(((ior - 1.0) / (ior + 1.0)) ** 2 * 2.0 * max(level, 0.0), 0.99)
    root = math.sqrt(reflectance)
    return (1.0 + root) / (1.0 - root)


def thin_ior(ior: float) -> float:
    """Index of refraction of a pane that reflects as much along its normal as one interface of an index.

    A pane whose sides reflect r each reflects 2 r / (1 + r).
    """
    reflectance = min(((ior - 1.0) / (ior + 1.0)) ** 2, 0.99)
    root = math.sqrt(reflectance / (2.0 - reflectance))
    return (1.0 + root) / (1.0 - root)


def conductor_ior(reflectance: np.ndarray, tint: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Complex index of refraction of a metal that reflects as Blender's does.

    Blender's metals have Schlick's reflectance, multiplied near 82 degrees by a tint (Kutz et al. 2021,
    F82). Of the indices with a reflectance along the normal (Gulbrandsen 2014), those nearest to it over all
    directions are taken.

    Parameters
    ----------
    reflectance : (3,) float64
        Along the normal, 0..1; kept below 1.
    tint : (3,) float64
        Specular Tint, 0..1.

    Returns
    -------
    eta, k : (3,) float64
    """
    r, edges = np.clip(reflectance, 0.0, 0.999)[:, None], np.linspace(0.0, 1.0, 65)[None]
    eta = edges * (1.0 - r) / (1.0 + r) + (1.0 - edges) * (1.0 + np.sqrt(r)) / (1.0 - np.sqrt(r))
    k = np.sqrt(np.maximum((r * (eta + 1.0) ** 2 - (eta - 1.0) ** 2) / (1.0 - r), 0.0))
    cosines = (np.arange(32) + 0.5) / 32
    wanted = np.stack([_f82(float(r[i, 0]), float(tint[i]), cosines) for i in range(len(r))])
    found = conductor_reflectance(eta[..., None], k[..., None], cosines)
    best = np.argmin(((found - wanted[:, None]) ** 2 * cosines).sum(axis=-1), axis=1)
    rows = np.arange(len(r))
    return eta[rows, best], k[rows, best]


def conductor_reflectance(eta: np.ndarray, k: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Fresnel's reflectance of unpolarized light by a conductor."""
    c2, s2 = cosine**2, 1.0 - cosine**2
    first = eta**2 - k**2 - s2
    both = np.sqrt(first**2 + 4.0 * eta**2 * k**2)
    a = np.sqrt(np.maximum(0.5 * (both + first), 0.0))
    across = (both + c2 - 2.0 * a * cosine) / (both + c2 + 2.0 * a * cosine)
    along = across * (c2 * both + s2**2 - 2.0 * a * cosine * s2) / (c2 * both + s2**2 + 2.0 * a * cosine * s2)
    reflectance: np.ndarray = 0.5 * (across + along)
    return reflectance


def _f82(reflectance: float, tint: float, cosine: np.ndarray) -> np.ndarray:
    """Schlick's reflectance, lowered to `tint` of itself where the cosine is 1/7."""
    schlick = reflectance + (1.0 - reflectance) * (1.0 - cosine) ** 5
    at_edge = reflectance + (1.0 - reflectance) * (6.0 / 7.0) ** 5
    lowered = at_edge * (1.0 - tint) / ((6.0 / 7.0) ** 6 / 7.0)
    return np.clip(schlick - lowered * cosine * (1.0 - cosine) ** 6, 0.0, 1.0)


def mixed_slope(slopes: np.ndarray, strength: float) -> float:
    """Share of the mean of slopes that remains where normals are mixed with those of the surface.

    Of a slope s and a strength k remains k s / (k + (1 - k) sqrt(1 + s^2)).
    """
    mixed = slopes / (strength + (1.0 - strength) * np.sqrt(1.0 + slopes**2))
    return strength * float(mixed.sum() / max(slopes.sum(), 1e-12))


def uv_matrix(
    kind: str, location: tuple[float, ...], rotation: tuple[float, ...], scale: tuple[float, ...]
) -> Matrix3:
    """Map of the node Mapping on texture coordinates (u, v, 0): of its kinds POINT, VECTOR and TEXTURE."""
    a, b, c = rotation
    x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    turn = z @ y @ x
    if kind == "TEXTURE":
        inverse = np.array([1.0 / s if s else 0.0 for s in scale])
        linear = np.diag(inverse) @ turn.T
        shift = -linear @ np.array(location)
    else:
        linear, shift = turn @ np.diag(scale), np.array(location)
    return _rows(np.array([[*linear[0, :2], shift[0]], [*linear[1, :2], shift[1]], [0.0, 0.0, 1.0]]))


def product(first: Matrix3, second: Matrix3) -> Matrix3:
    """Map that applies `second`, then `first`."""
    return _rows(np.array(first) @ np.array(second))


def is_invertible(matrix: Matrix3) -> bool:
    """Whether a map has an inverse that single precision holds."""
    return bool(abs(np.linalg.det(matrix)) > 1e-9)


def spot_ramp(half_angle: float, blend: float) -> tuple[float, float]:
    """Angles (outer, inner; radians) of a linear ramp with the width of Blender's spot of a blend.

    Blender's spot is a smoothstep of the cosine, over the share `blend` of ``1 - cos(half_angle)``.
    """
    edge = math.cos(half_angle)
    top = edge + (1.0 - edge) * min(max(blend, 1e-4), 1.0)
    quarter, rest = edge + 0.25 * (top - edge), edge + 0.75 * (top - edge)
    low, high = math.acos(quarter), math.acos(rest)  # smoothstep is 0.156 and 0.844 there
    slope = (0.84375 - 0.15625) / max(low - high, 1e-9)
    middle = 0.5 * (low + high)
    return middle + 0.5 / slope, max(middle - 0.5 / slope, 0.0)


def _rows(matrix: np.ndarray) -> Matrix3:
    a, b, c = (tuple(float(x) for x in row) for row in matrix)
    return (a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2])
