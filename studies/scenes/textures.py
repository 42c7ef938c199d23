"""Procedural textures of the generated scenes: stone, wood, cloth, paper and tile.

Every texture is a function of its size and seed, (size, size, 3) sRGB bytes, and repeats without
a seam.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from studies.scenes.materials import Colour

Floats = npt.NDArray[np.floating]
Image8 = npt.NDArray[np.uint8]


def display(colour: Colour) -> Floats:
    """Return the display values, 0 to 1, of `#rrggbb`."""
    return np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)], dtype=np.float32)


def encoded(image: Floats) -> Image8:
    """Return display values, 0 to 1, as bytes."""
    return np.clip(np.round(image * 255.0), 0, 255).astype(np.uint8)


def blend(low: Colour | Floats, high: Colour | Floats, weight: Floats) -> Floats:
    """Return an image between two colours or images, by a weight (height, width) of 0 to 1."""
    a = display(low) if isinstance(low, str) else low
    b = display(high) if isinstance(high, str) else high
    return np.asarray(a + (b - a) * np.clip(weight, 0.0, 1.0)[..., None])


def grid(size: int) -> tuple[Floats, Floats]:
    """Return the coordinates u (to the right) and v (down) of the pixel centres, 0 to 1."""
    line = (np.arange(size, dtype=np.float32) + 0.5) / size
    u, v = np.meshgrid(line, line)
    return u, v


def noise(u: Floats, v: Floats, cells: tuple[int, int], seed: int) -> Floats:
    """Return smooth noise, 0 to 1, that repeats over the unit square."""
    across, down = cells
    lattice = np.random.default_rng(seed).random((down, across), dtype=np.float32)
    x, y = u * across, v * down
    i, j = x.astype(np.int32), y.astype(np.int32)
    s, t = x - i, y - j
    s, t = s * s * (3 - 2 * s), t * t * (3 - 2 * t)
    top = lattice[j % down, i % across] * (1 - s) + lattice[j % down, (i + 1) % across] * s
    low = lattice[(j + 1) % down, i % across] * (1 - s) + lattice[(j + 1) % down, (i + 1) % across] * s
    return np.asarray(top * (1 - t) + low * t)


def cloud(u: Floats, v: Floats, cells: int, seed: int, octaves: int = 4) -> Floats:
    """Return fractal noise, about 0 to 1."""
    total = np.zeros_like(u)
    for octave in range(octaves):
        scale = 2**octave
        total += noise(u, v, (cells * scale, cells * scale), seed + octave) / scale
    return np.asarray(total / (2 - 2 ** (1 - octaves)))


def veined(size: int, base: Colour, vein: Colour, seed: int, amount: float = 0.6) -> Image8:
    """Return marble: a clouded base with bent veins."""
    u, v = grid(size)
    bend = cloud(u, v, 3, seed, 5)
    ridge = 1 - np.abs(2 * cloud(u + 0.15 * bend, v + 0.2 * bend, 3, seed + 9, 5) - 1)
    veins = np.clip((ridge - 0.86) / 0.14, 0, 1) ** 1.5
    return encoded(blend(base, vein, amount * veins + 0.25 * amount * bend))


def chequer(size: int, colours: tuple[Colour, Colour], cells: int, seed: int, joint: float = 0.012) -> Image8:
    """Return a chequered floor of `cells` x `cells` stone tiles, each of its own shade."""
    u, v = grid(size)
    i, j = (u * cells).astype(int), (v * cells).astype(int)
    shade = np.random.default_rng(seed).normal(0.0, 0.028, (cells, cells))[j, i]
    marble = cloud(u, v, 8, seed) - 0.5
    vein = np.clip(1 - 14 * np.abs(cloud(u + 0.31 * i, v + 0.17 * j, 5, seed + 7, 4) - 0.5), 0, 1)
    image = blend(colours[0], colours[1], ((i + j) % 2).astype(float))
    image = image + (shade + 0.13 * marble)[..., None]
    image = image * (1 - 0.10 * vein)[..., None]
    edge = np.minimum.reduce([u * cells - i, 1 - (u * cells - i), v * cells - j, 1 - (v * cells - j)])
    return encoded(blend(image, "#6f675c", (edge < joint).astype(float) * 0.8))


def paving(size: int, stone: tuple[Colour, Colour, Colour], seed: int) -> Image8:
    """Return one bay of inlaid paving: a border, large slabs and a diamond at the centre."""
    u, v = grid(size)
    light, dark, accent = stone
    bend = cloud(u, v, 3, seed, 5)
    ridge = 1 - np.abs(2 * cloud(u + 0.1 * bend, v + 0.2 * bend, 4, seed + 5, 5) - 1)
    veins = np.clip((ridge - 0.85) / 0.15, 0, 1)
    x, y = np.abs(u - 0.5), np.abs(v - 0.5)
    rim, diamond = np.maximum(x, y), x + y
    image = blend(light, "#b9ab96", 0.5 * veins + 0.35 * bend)
    ink = blend(dark, "#8f8779", 0.35 * veins + 0.2 * bend)
    warm = blend(accent, "#d8b58c", 0.4 * veins + 0.3 * bend)
    image = blend(image, ink, (rim > 0.452).astype(float))
    image = blend(image, warm, ((diamond < 0.285) & (diamond > 0.245)).astype(float))
    image = blend(image, ink, (diamond < 0.13).astype(float))
    corner = (x > 0.452) & (y > 0.452)
    image = blend(image, warm, corner.astype(float))
    seams = np.minimum(np.abs(x - 0.25), np.abs(y - 0.25))
    seam = (seams < 0.0015) & (rim < 0.452) & (diamond > 0.285)
    return encoded(blend(image, "#6b6259", 0.7 * seam.astype(float)))


def wood(size: int, dark: Colour, light: Colour, seed: int, planks: int = 1) -> Image8:
    """Return wood whose grain runs along v, in planks side by side."""
    u, v = grid(size)
    plank = (u * planks).astype(int)
    shift = np.random.default_rng(seed).random(planks)[plank]
    warp = noise(u, v + shift, (4 * planks, 2), seed) * 0.12
    rings = noise(u + warp * 0.3, v + shift, (22 * planks, 1), seed + 1)
    fibre = noise(u, v + shift, (64 * planks, 6), seed + 2)
    grain = 0.6 * rings + 0.25 * fibre + 0.3 * (shift - 0.3)
    image = blend(dark, light, grain)
    edge = np.abs(u * planks - plank - 0.5) > 0.494
    return encoded(image * (1 - 0.5 * (edge & (planks > 1)))[..., None])


def parquet(size: int, dark: Colour, light: Colour, cells: int, seed: int) -> Image8:
    """Return basket-weave parquet: squares of four staves, whose grain turns from square to square.

    `cells` is the number of squares along a side; an even number repeats without a seam.
    """
    u, v = grid(size)
    i, j = (u * cells).astype(int), (v * cells).astype(int)
    s, t = u * cells - i, v * cells - j
    is_turned = (i + j) % 2 == 1
    across, along = np.where(is_turned, t, s), np.where(is_turned, s, t)
    stave = (across * 4).astype(int)
    shade = np.random.default_rng(seed).random((cells, cells, 4))[j, i, stave]
    fibre = noise((across + shade) % 1.0, (along + shade) % 1.0, (48, 3), seed + 1)
    rings = noise((across + 3 * shade) % 1.0, (along + shade) % 1.0, (14, 1), seed + 2)
    image = blend(dark, light, 0.15 + 0.45 * shade + 0.25 * rings + 0.2 * fibre)
    joint = np.minimum.reduce([across * 4 - stave, 1 - (across * 4 - stave), 4 * along, 4 * (1 - along)])
    return encoded(image * (1 - 0.55 * (joint < 0.05))[..., None])


def gingham(size: int, colour: Colour, ground: Colour, checks: int) -> Image8:
    """Return chequered cloth: bands of warp and weft that cross."""
    u, v = grid(size)
    warp = ((u * checks * 2).astype(int) % 2).astype(float)
    weft = ((v * checks * 2).astype(int) % 2).astype(float)
    thread = 0.04 * np.sin(2 * np.pi * u * checks * 16) * np.sin(2 * np.pi * v * checks * 16)
    return encoded(blend(ground, colour, 0.5 * (warp + weft) + thread))


def rug(size: int, colours: Sequence[Colour]) -> Image8:
    """Return a woven rug: stepped diamonds in a field between chequered borders."""
    knots = 120
    u, v = grid(size)
    i, j = np.floor(u * knots), np.floor(v * knots)
    x, y = np.abs(i - knots / 2 + 0.5), np.abs(j - knots / 2 + 0.5)
    rim = knots / 2 - np.maximum(x, y)
    ground, figure, accent, dark = colours
    image = np.broadcast_to(display(ground), (*u.shape, 3))
    cell = np.abs((x % 24) - 12) + np.abs((y % 24) - 12)
    image = blend(image, figure, ((cell > 7) & (cell <= 10)).astype(float))
    image = blend(image, accent, (cell < 4).astype(float))
    image = blend(image, dark, (((cell > 13) & (cell <= 14)) | (cell > 20)).astype(float))
    check = ((np.floor(i / 3) + np.floor(j / 3)) % 2) > 0
    image = blend(image, dark, (rim < 14).astype(float))
    image = blend(image, figure, ((rim < 13) & (rim > 4) & check).astype(float))
    image = blend(image, ground, (rim < 3.5).astype(float))
    weave = 0.04 * np.sin(2 * np.pi * v * knots) + 0.05 * (noise(u, v, (knots, knots), 5) - 0.5)
    return encoded(image + weave[..., None])


def trellis(size: int, ground: Colour, line: Colour, leaf: Colour) -> Image8:
    """Return wallpaper: a trellis of fine lines with a sprig in each lozenge."""
    u, v = grid(size)
    a, b = (u + v) % 1.0, (u - v) % 1.0
    lines = np.minimum(np.minimum(a, 1 - a), np.minimum(b, 1 - b))
    image = blend(ground, line, np.clip(1.6 - lines / 0.012, 0, 1))
    for cx, cy in ((0.5, 0.0), (0.0, 0.5)):
        x = (u - cx + 0.5) % 1.0 - 0.5
        y = (v - cy + 0.5) % 1.0 - 0.5
        petals = np.hypot(x, y) - 0.10 * (0.55 + 0.45 * np.cos(4 * np.arctan2(y, x)))
        image = blend(image, leaf, np.clip(0.5 - petals / 0.008, 0, 1))
        image = blend(image, ground, np.clip(0.5 - (np.hypot(x, y) - 0.022) / 0.006, 0, 1))
    return encoded(image)


def glazed(size: int, ground: Colour, ink: Colour, accent: Colour) -> Image8:
    """Return four painted wall tiles: quarter circles and stars, as around an old hearth."""
    u, v = grid(size)
    x, y = (u * 2) % 1.0, (v * 2) % 1.0
    odd = ((u * 2).astype(int) + (v * 2).astype(int)) % 2 == 1
    x = np.where(odd, 1 - x, x)
    arcs = [np.abs(np.hypot(x, y) - r) for r in (0.5, 0.66)]
    arcs += [np.abs(np.hypot(1 - x, 1 - y) - r) for r in (0.5, 0.66)]
    image = blend(ground, ink, np.clip(1.4 - np.minimum.reduce(arcs) / 0.028, 0, 1))
    star = np.hypot(x - 0.5, y - 0.5) * (1.25 - 0.45 * np.cos(4 * np.arctan2(y - 0.5, x - 0.5)))
    image = blend(image, accent, np.clip(0.5 - (star - 0.13) / 0.02, 0, 1))
    corner = np.minimum(np.hypot(x, 1 - y), np.hypot(1 - x, y))
    image = blend(image, ink, np.clip(0.5 - (corner - 0.2) / 0.02, 0, 1))
    joint = np.minimum.reduce([x, 1 - x, y, 1 - y]) < 0.014
    image = blend(image, "#a89f8f", joint.astype(float))
    return encoded(image * (0.97 + 0.05 * noise(u, v, (9, 9), 3))[..., None])


def ashlar(size: int, stone: Colour, joint: Colour, courses: int, seed: int) -> Image8:
    """Return a wall of dressed stone, two blocks to a course, each course offset by half."""
    u, v = grid(size)
    row = (v * courses).astype(int)
    x = (u * 2 + 0.5 * (row % 2)) % 2.0
    block = x.astype(int)
    shade = np.random.default_rng(seed).normal(0.0, 0.022, (courses, 2))[row, block]
    grain = 0.10 * (cloud(u, v, 6, seed, 5) - 0.5)
    edge = np.minimum(
        np.minimum(x % 1.0, 1 - x % 1.0) * courses / 2,
        np.minimum((v * courses) % 1.0, 1 - (v * courses) % 1.0),
    )
    image = np.broadcast_to(display(stone), (*u.shape, 3)) + (shade + grain)[..., None]
    return encoded(blend(image, joint, np.clip(1.5 - edge / 0.018, 0, 1) * 0.75))
