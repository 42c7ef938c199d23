# SPDX-License-Identifier: GPL-3.0-or-later
"""Mean intensity of IES profiles (IESNA LM-63): Mitsuba has no emitter for them."""

from __future__ import annotations

import math

import numpy as np

LUMENS_PER_WATT = 177.83  # by which Cycles converts
DIRECTIONS = 1800  # polar angles of which the mean is taken
TYPE_C = 1  # of profiles: polar angles from the axis on


def mean_factor(text: str, kind: str, cone: float = math.pi) -> float | None:
    """What a profile multiplies the light of a lamp by, on average over the directions that it lights.

    Parameters
    ----------
    text
        Content of an IES file.
    kind
        Of the lamp: ``POINT``, ``SPOT`` or ``AREA``.
    cone
        Angle of a spot, radians.

    Returns
    -------
    float or None
        None if the profile is malformed, or of another type than C.
    """
    angles = (np.arange(DIRECTIONS) + 0.5) * math.pi / DIRECTIONS
    weights = np.sin(angles)
    if kind == "AREA":
        weights *= np.maximum(np.cos(angles), 0.0)
    elif kind == "SPOT":
        weights *= angles < 0.5 * cone
    candela = _mean_by_angle(text, np.degrees(angles))
    if candela is None or not weights.any():
        return None
    return float(candela @ weights / weights.sum()) * 4.0 * math.pi / LUMENS_PER_WATT


def _mean_by_angle(text: str, angles: np.ndarray) -> np.ndarray | None:
    """Mean around the axis at polar angles, degrees; candela (N,).

    Angles that a profile leaves out are dark.
    """
    _, _, rest = text.partition("TILT=")
    tilt, _, rest = rest.partition("\n")
    try:
        numbers = np.array(rest.replace(",", " ").split(), np.float64)
        if tilt.strip() == "INCLUDE":
            numbers = numbers[2 + 2 * int(numbers[1]) :]
        scale = numbers[2] * numbers[10] * numbers[11]
        polar, azimuths, kind = (int(number) for number in numbers[3:6])
        known, azimuth, intensity = np.split(numbers[13:], [polar, polar + azimuths])
        rows = scale * intensity[: polar * azimuths].reshape(azimuths, polar)
    except (ValueError, IndexError, OverflowError):
        return None
    steps = np.diff(azimuth)
    is_ordered = bool((np.diff(known) > 0.0).all() and (steps > 0.0).all())
    if kind != TYPE_C or polar < 1 or azimuths < 1 or not is_ordered or not np.isfinite(rows).all():
        return None
    by_angle = np.stack([np.interp(angles, known, row, left=0.0, right=0.0) for row in rows])
    return by_angle[0] if azimuths == 1 else steps @ (by_angle[1:] + by_angle[:-1]) / (2.0 * steps.sum())
