# SPDX-License-Identifier: GPL-3.0-or-later
"""Mean intensity of IES profiles (IESNA LM-63): Mitsuba has no emitter for them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

LUMENS_PER_WATT = 177.83  # by which Cycles converts
DIRECTIONS = 1800  # polar angles of which the mean is taken


def mean_factor(node: Any) -> float | None:
    """Mean over all directions of an IES Texture node of constant strength; None if it can't be read."""
    strength = node.inputs["Strength"]
    if node.mode == "INTERNAL":
        text = node.ies.as_string() if node.ies else ""
    else:
        import bpy

        file = Path(bpy.path.abspath(node.filepath))
        text = file.read_text(errors="replace") if file.is_file() else ""
    candela = None if strength.is_linked else mean_intensity(text)
    return None if candela is None else candela * strength.default_value * 4.0 * math.pi / LUMENS_PER_WATT


def mean_intensity(text: str) -> float | None:
    """Mean of a profile over all directions, candela; None if it is malformed.

    Polar angles that a profile leaves out are dark. It repeats its azimuths around the axis.
    """
    _, _, rest = text.partition("TILT=")
    tilt, _, rest = rest.partition("\n")
    try:
        numbers = np.array(rest.replace(",", " ").split(), np.float64)
        if tilt.strip() == "INCLUDE":
            numbers = numbers[2 + 2 * int(numbers[1]) :]
        scale, polar, azimuths = numbers[2] * numbers[10], int(numbers[3]), int(numbers[4])
        known, azimuth, intensity = np.split(numbers[13:], [polar, polar + azimuths])
        rows = intensity[: polar * azimuths].reshape(azimuths, polar)
    except (ValueError, IndexError):
        return None
    angles = (np.arange(DIRECTIONS) + 0.5) * math.pi / DIRECTIONS
    of_polar = [np.interp(np.degrees(angles), known, row, left=0.0, right=0.0) for row in rows]
    means = np.array(of_polar) @ np.sin(angles) / np.sin(angles).sum()
    if azimuths == 1:
        return float(scale * means[0])
    steps = np.diff(azimuth)
    return float(scale * (0.5 * (means[1:] + means[:-1]) @ steps / steps.sum()))
