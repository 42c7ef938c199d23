"""Furniture; each piece stands on z = 0 with its front towards -y unless stated otherwise."""

from __future__ import annotations

import numpy as np

from studies.scenes.joinery import BEAD
from studies.scenes.solids import (
    Floats,
    Mesh,
    Point2,
    Vector,
    block,
    cushion,
    join,
    lathe,
    span,
    sphere,
    surface,
    upright,
)
from studies.scenes.sweeps import frame, tube

# A turned leg: (radius, height) as fractions of its length's 0.045 and 1.
TURNING: list[Point2] = [
    (0.0, 0.0),
    (0.35, 0.0),
    (0.42, 0.01),
    (0.40, 0.05),
    (0.55, 0.09),
    (0.55, 0.11),
    (0.40, 0.13),
    (0.48, 0.30),
    (0.66, 0.60),
    (0.72, 0.70),
    (0.50, 0.76),
    (0.46, 0.77),
    (0.78, 0.79),
    (0.78, 0.81),
    (0.5, 0.83),
    (0.62, 0.88),
    (0.62, 0.9),
    (0.0, 0.9),
]


def turned_leg(height: float, radius: float, segments: int) -> Mesh:
    """Return a lathe-turned leg with a square head."""
    turned = lathe([(r * radius / 0.78, z * height) for r, z in TURNING], segments)
    head = block((1.8 * radius, 1.8 * radius, 0.14 * height)).at(0, 0, 0.86 * height)
    return join([turned.bare(), head])


def table(length: float, width: float, height: float, segments: int) -> Mesh:
    """Return a table with an apron and turned legs."""
    x, y = length / 2 - 0.09, width / 2 - 0.09
    legs = [turned_leg(height - 0.03, 0.042, segments).at(a, b) for a in (-x, x) for b in (-y, y)]
    top = block((length, width, 0.032), 0.01).at(0, 0, height - 0.032)
    low, high = height - 0.13, height - 0.03
    apron = [span((-x, s * y - 0.012, low), (x, s * y + 0.012, high)) for s in (-1, 1)]
    apron += [span((s * x - 0.012, -y, low), (s * x + 0.012, y, high)) for s in (-1, 1)]
    return join([top, *legs, *apron])


def tablecloth(length: float, width: float, height: float, overhang: float, cells: int) -> Mesh:
    """Return a cloth over a table top, hanging in soft folds."""

    def cloth(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        a = (u - 0.5) * (length + 2 * overhang)
        b = (v - 0.5) * (width + 2 * overhang)
        x, y = np.clip(a, -length / 2, length / 2), np.clip(b, -width / 2, width / 2)
        over_x, over_y = np.abs(a - x), np.abs(b - y)
        drop = np.maximum(over_x, over_y)
        fold = 0.012 + 0.10 * drop * (1 + np.sin(27 * np.where(over_x > over_y, b, a)))
        corner = np.minimum(over_x, over_y)
        x = x + np.sign(a) * np.where(over_x > 0, np.minimum(drop, fold) + 0.5 * corner, 0)
        y = y + np.sign(b) * np.where(over_y > 0, np.minimum(drop, fold) + 0.5 * corner, 0)
        return x, y, height + 0.004 - np.maximum(drop - 0.006, 0.0)

    return surface(cloth, cells, cells)


def chair(segments: int) -> Mesh:
    """Return a ladder-back chair, 0.44 wide, its seat at 0.45."""
    front = [turned_leg(0.44, 0.022, segments).at(s * 0.19, -0.19) for s in (-1, 1)]
    back = [
        tube(
            [(s * 0.18, 0.20, 0.0), (s * 0.185, 0.19, 0.45), (s * 0.185, 0.21, 0.70), (s * 0.18, 0.26, 0.98)],
            (0.017, 0.021, 0.018, 0.014),
            segments,
        )
        for s in (-1, 1)
    ]
    finials = [sphere(0.021, segments).at(s * 0.18, 0.262, 0.99) for s in (-1, 1)]
    seat = block((0.44, 0.43, 0.035), 0.012).at(0, 0, 0.425)

    def slat(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        x = 0.36 * (u - 0.5)
        edge = 2 * np.pi * v
        bow = 0.03 * np.cos(np.pi * (u - 0.5))
        tall = 0.028 + 0.012 * np.cos(np.pi * (u - 0.5))
        return x, bow + 0.008 * np.sin(edge), tall * np.cos(edge)

    rungs = [surface(slat, 8, 8).at(0, 0.185 + 0.035 * k, 0.60 + 0.15 * k) for k in range(3)]
    bars = [tube([(-0.19, y, 0.16), (0.0, y, 0.16), (0.19, y, 0.16)], 0.010, segments) for y in (-0.19, 0.2)]
    bars += [
        tube([(s * 0.187, -0.19, 0.21), (s * 0.187, 0.0, 0.21), (s * 0.187, 0.2, 0.21)], 0.010, segments)
        for s in (-1, 1)
    ]
    loose = [*front, *back, *finials, seat, *rungs, *bars]
    return join(m.bare() for m in loose)


def sofa(width: float, segments: int) -> tuple[Mesh, Mesh]:
    """Return a sofa's body and its wooden feet."""
    half, depth = width / 2, 0.88
    pieces = [span((-half + 0.02, -depth / 2 + 0.03, 0.12), (half - 0.02, depth / 2, 0.32), 0.03)]
    for s in (-1, 1):
        arm = span(
            (min(s * half, s * (half - 0.17)), -depth / 2, 0.12),
            (max(s * half, s * (half - 0.17)), depth / 2, 0.60),
            0.05,
        )
        roll = tube(
            [(s * (half - 0.085), y, 0.60) for y in (-depth / 2, 0.0, depth / 2)], 0.105, 2 * segments
        )
        pieces += [arm, roll]
    pieces.append(span((-half + 0.1, depth / 2 - 0.2, 0.12), (half - 0.1, depth / 2, 0.80), 0.06))
    inner = width - 0.36
    for k in range(3):
        x = -inner / 2 + inner * (k + 0.5) / 3
        seat = cushion((inner / 3 - 0.004, 0.66, 0.17), 3 * segments, 0.22).at(x, -0.09, 0.31)
        rest = cushion((inner / 3 - 0.004, 0.44, 0.20), 3 * segments, 0.25).turned(78, "x")
        pieces += [m.bare() for m in (seat, rest.at(x, 0.27, 0.67))]
    feet = [
        lathe([(0.0, 0.0), (0.018, 0.0), (0.03, 0.13), (0.0, 0.13)], segments).at(x, y)
        for x in (-half + 0.1, half - 0.1)
        for y in (-depth / 2 + 0.1, depth / 2 - 0.1)
    ]
    return join(m.bare() for m in pieces), join(feet)


def bookcase(size: Vector, shelves: int) -> Mesh:
    """Return an open bookcase with a plinth and a cornice; its back is at y = size[1] / 2."""
    w, d, h = size[0] / 2, size[1] / 2, size[2]
    pieces = [
        span((-w, -d, 0), (-w + 0.03, d, h)),
        span((w - 0.03, -d, 0), (w, d, h)),
        span((-w + 0.01, d - 0.015, 0.02), (w - 0.01, d, h - 0.02)),
        span((-w - 0.01, -d - 0.012, 0), (w + 0.01, d, 0.09)),
        span((-w - 0.02, -d - 0.03, h - 0.02), (w + 0.02, d, h + 0.02), 0.012),
        span((-w - 0.04, -d - 0.05, h + 0.02), (w + 0.04, d, h + 0.05), 0.012),
    ]
    pieces += [
        span((-w + 0.02, -d + 0.01, z - 0.012), (w - 0.02, d, z + 0.012)) for z in shelf_heights(h, shelves)
    ]
    pieces.append(span((-0.014, -d + 0.01, 0.08), (0.014, d, h)))
    return join(pieces)


def shelf_heights(height: float, shelves: int) -> list[float]:
    """Return the heights of a bookcase's boards, the lowest on the plinth."""
    return [float(z) for z in np.linspace(0.1, height - 0.32, shelves)]


def books(low: Vector, length: float, colours: int, seed: int) -> list[Mesh]:
    """Return a row of books along +x from a corner, spines to -y, one mesh for each colour."""
    random = np.random.default_rng(seed)
    groups: list[list[Mesh]] = [[] for _ in range(colours)]
    x = 0.0
    while x < length - 0.06:
        thick = float(random.uniform(0.018, 0.05))
        tall, deep = float(random.uniform(0.17, 0.25)), float(random.uniform(0.14, 0.19))
        volume = block((thick - 0.002, deep, tall), 0.004)
        if random.random() < 0.12:
            volume = volume.turned(-9.0, "y").at(0.02, 0)
            x += 0.03
        colour = int(random.integers(colours))
        groups[colour].append(volume.at(low[0] + x + thick / 2, low[1] + deep / 2, low[2]))
        x += thick
        if random.random() < 0.07:
            x += float(random.uniform(0.05, 0.14))
    return [join(group) for group in groups if group]


def sideboard(width: float, segments: int) -> tuple[Mesh, Mesh]:
    """Return a sideboard of four panelled doors, and its knobs and feet."""
    h, d = 0.82, 0.46
    body = [
        span((-width / 2, -d / 2, 0.14), (width / 2, d / 2, h), 0.008),
        block((width + 0.06, d + 0.05, 0.03), 0.012).at(0, 0, h),
    ]
    knobs = []
    for k in range(4):
        x = -width / 2 + width * (k + 0.5) / 4
        panel = frame(width / 4 - 0.05, h - 0.2, BEAD).at(x, (h + 0.14) / 2)
        body.append(upright(panel).at(0, -d / 2))
        side = 1 if k % 2 == 0 else -1
        knobs.append(sphere(0.016, segments).at(x + side * (width / 8 - 0.055), -d / 2 - 0.018, 0.5))
    feet = [
        turned_leg(0.15, 0.03, segments).at(x, y)
        for x in (-width / 2 + 0.07, width / 2 - 0.07)
        for y in (-d / 2 + 0.07, d / 2 - 0.07)
    ]
    return join(body), join([*[k.bare() for k in knobs], *feet])


def round_table(radius: float, height: float, segments: int) -> Mesh:
    """Return a low round table on three splayed legs."""
    top = lathe(
        [
            (0.0, height - 0.035),
            (radius - 0.03, height - 0.035),
            (radius, height - 0.015),
            (radius, height - 0.006),
            (radius - 0.006, height),
            (0.0, height),
        ],
        4 * segments,
    )
    legs = []
    for angle in (0.5, 0.5 + 2 * np.pi / 3, 0.5 + 4 * np.pi / 3):
        c, s = float(np.cos(angle)), float(np.sin(angle))
        legs.append(
            tube(
                [
                    (radius * f * c, radius * f * s, height * z)
                    for f, z in ((0.92, 0.0), (0.76, 0.5), (0.62, 0.94))
                ],
                (0.014, 0.02, 0.026),
                segments,
            )
        )
    return join(m.bare() for m in (top, *legs))
