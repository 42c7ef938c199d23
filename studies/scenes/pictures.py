"""Pictures: framed paintings for the walls, and the views behind the windows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studies.scenes.materials import linear
from studies.scenes.solids import Vector
from studies.scenes.textures import Floats, Image8, blend, cloud, display, encoded, grid, noise


def landscape(size: int) -> Image8:
    """Return a painted landscape: hills in layers below a warm sky."""
    u, v = grid(size)
    image = blend("#8fb4cc", "#f6dcb0", v * 1.6)
    sun = np.hypot(u - 0.68, v - 0.36)
    image = blend(image, "#fff0c8", np.clip(1.3 - sun / 0.07, 0, 1))
    hills = ("#a9bdb4", "#86a692", "#7f9a62", "#a8a35a", "#6f8450")
    for k, colour in enumerate(hills):
        crest = 0.45 + 0.11 * k - 0.16 * noise(u, np.full_like(v, 0.37), (3 + k, 4), 40 + k)
        image = blend(image, colour, np.clip((v - crest) / 0.006, 0, 1))
    strokes = 0.06 * (noise(u, v, (90, 30), 8) - 0.5)
    return encoded(image + strokes[..., None])


def composition(size: int) -> Image8:
    """Return an abstract painting: discs and bars in few colours."""
    u, v = grid(size)
    image = np.broadcast_to(display("#ece3d0"), (*u.shape, 3))
    bars = (
        ((0.10, 0.34), (0.12, 0.90), "#2f4858"),
        ((0.40, 0.92), (0.62, 0.76), "#d98f4e"),
        ((0.58, 0.64), (0.08, 0.94), "#3b3a38"),
        ((0.70, 0.92), (0.82, 0.92), "#7d8f69"),
    )
    for (left, right), (top, low), colour in bars:
        image = blend(image, colour, ((u > left) & (u < right) & (v > top) & (v < low)) * 1.0)
    for x, y, r, colour in (
        (0.62, 0.32, 0.24, "#c5523f"),
        (0.30, 0.55, 0.15, "#e6b655"),
        (0.72, 0.28, 0.10, "#ece3d0"),
    ):
        image = blend(image, colour, np.clip((r - np.hypot(u - x, v - y)) / 0.004, 0, 1))
    return encoded(image + 0.05 * (cloud(u, v, 20, 2, 3) - 0.5)[..., None])


def botanical(size: int) -> Image8:
    """Return a botanical print: a stem with paired leaves on old paper."""
    u, v = grid(size)
    image = blend("#efe6cf", "#e0d2b0", cloud(u, v, 4, 4))
    stem = np.abs(u - 0.5 - 0.04 * np.sin(4 * v))
    image = blend(image, "#4f6a43", ((stem < 0.008) & (v > 0.14) & (v < 0.9)) * 1.0)
    for k in range(6):
        y = 0.24 + 0.1 * k
        for side in (-1, 1):
            x0 = 0.5 + 0.04 * np.sin(4 * y)
            a = (u - x0) * side
            b = (v - y) + 0.45 * a
            reach = 0.16 + 0.02 * k
            half = 0.05 * np.sin(np.pi * np.clip(a / reach, 0, 1))
            leaf = np.clip((half - np.abs(b)) / 0.004, 0, 1)
            image = blend(image, "#6d8a55" if k % 2 else "#55753f", leaf)
            vein = leaf * (np.abs(b) < 0.003)
            image = blend(image, "#c5cf9f", vein)
    return encoded(image)


def garden(size: int, strength: float) -> npt.NDArray[np.float32]:
    """Return the radiance of a garden below a bright sky, (size, size, 3), top row first."""
    u, v = grid(size)
    sky = blend(linear("#c4dcf2"), linear("#f6f3ea"), np.clip(v / 0.6, 0, 1))
    trees = 0.60 - 0.10 * cloud(u, np.full_like(v, 0.2), 6, 3) - 0.03 * cloud(u, v, 24, 5)
    leaves = blend(linear("#5c7a45"), linear("#a3b877"), cloud(u, v, 40, 7))
    image = blend(sky, leaves, np.clip((v - trees) / 0.012, 0, 1))
    hedge = 0.72 - 0.015 * cloud(u, v, 30, 11)
    box = blend(linear("#47663c"), linear("#86a35d"), cloud(u, v, 60, 13))
    image = blend(image, box, np.clip((v - hedge) / 0.006, 0, 1))
    image = blend(image, linear("#b3b583"), np.clip((v - 0.84) / 0.01, 0, 1))
    return np.asarray(strength * image, dtype=np.float32)


def overcast(size: int, strength: float) -> npt.NDArray[np.float32]:
    """Return the radiance of a sky with soft clouds, (size, size, 3)."""
    u, v = grid(size)
    shape: Floats = np.clip(1.7 * cloud(u, v, 3, 21, 5) - 0.35, 0, 1)
    image = blend(linear("#a9c9ee"), linear("#fbf8f2"), shape)
    return np.asarray(strength * image, dtype=np.float32)


def horizon(size: int, strength: float, sun: Vector, *, north: float = 0.0) -> npt.NDArray[np.float32]:
    """Return the radiance of a sky in latitude and longitude, (size, size, 3), zenith first.

    Columns run from north by east, south and west. The sky is brighter around the sun, whose light travels
    along `sun`, and the sun itself is left out. Trees stand on the horizon. The north is scaled by `north`: a
    scene without windows to the north wastes no samples on it where it is dark.
    """
    u, v = grid(size)
    azimuth, polar = 2 * np.pi * u, np.pi * v
    towards = -np.array(sun) / np.linalg.norm(sun)
    x, y, z = np.sin(polar) * np.sin(azimuth), np.sin(polar) * np.cos(azimuth), np.cos(polar)
    glow = np.clip(x * towards[0] + y * towards[1] + z * towards[2], 0, 1) ** 6
    image = blend(linear("#b9d3f0"), linear("#fff2df"), 1 - np.clip(z / 0.5, 0, 1))
    image = image * (0.6 + 0.7 * glow)[..., None]
    crest = 0.02 + 0.07 * cloud(u, np.full_like(v, 0.3), 12, 5)
    leaves = blend(linear("#34472a"), linear("#7a8b55"), cloud(u, v, 32, 9))
    image = blend(image, 0.5 * leaves, np.clip((crest - z) / 0.01, 0, 1))
    image = blend(image, 0.25 * linear("#a09a80"), np.clip(-z / 0.02, 0, 1))
    return np.asarray(strength * image * np.where(y < 0.5, 1.0, north)[..., None], dtype=np.float32)
