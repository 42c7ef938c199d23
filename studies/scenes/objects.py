"""Small objects: lamps, vases, plants and fruit."""

from __future__ import annotations

import numpy as np

from studies.scenes.solids import Floats, Mesh, Point2, join, lathe, sphere, surface
from studies.scenes.sweeps import tube

VASES: dict[str, list[Point2]] = {
    "bottle": [
        (0.0, 0.0),
        (0.06, 0.0),
        (0.085, 0.04),
        (0.09, 0.10),
        (0.07, 0.17),
        (0.03, 0.22),
        (0.025, 0.30),
        (0.034, 0.32),
        (0.028, 0.32),
        (0.02, 0.30),
        (0.0, 0.25),
    ],
    "jar": [
        (0.0, 0.0),
        (0.05, 0.0),
        (0.07, 0.02),
        (0.105, 0.10),
        (0.11, 0.15),
        (0.09, 0.21),
        (0.07, 0.23),
        (0.078, 0.25),
        (0.070, 0.25),
        (0.06, 0.22),
        (0.0, 0.1),
    ],
    "bowl": [
        (0.0, 0.0),
        (0.05, 0.0),
        (0.05, 0.012),
        (0.12, 0.04),
        (0.17, 0.09),
        (0.18, 0.10),
        (0.172, 0.10),
        (0.11, 0.045),
        (0.0, 0.025),
    ],
    "pot": [
        (0.0, 0.0),
        (0.13, 0.0),
        (0.15, 0.02),
        (0.19, 0.30),
        (0.205, 0.31),
        (0.205, 0.36),
        (0.19, 0.365),
        (0.18, 0.33),
        (0.0, 0.32),
    ],
}


def vase(kind: str, segments: int, scale: float = 1.0) -> Mesh:
    """Return a thrown vessel: `bottle`, `jar`, `bowl` or `pot`."""
    return lathe([(scale * r, scale * z) for r, z in VASES[kind]], segments)


def pendant(drop: float, segments: int) -> tuple[Mesh, Mesh, Mesh]:
    """Return a pendant lamp's shade, fittings and bulb; the shade's rim is at z = 0."""
    outer: list[Point2] = [
        (0.235, 0.0),
        (0.24, 0.004),
        (0.236, 0.02),
        (0.21, 0.07),
        (0.16, 0.12),
        (0.10, 0.155),
        (0.055, 0.18),
        (0.045, 0.20),
    ]
    inner = [(r - 0.006, max(z - 0.006, 0.0)) for r, z in reversed(outer)]
    shade = lathe([*inner, *outer], 3 * segments)
    cap = lathe(
        [(0.05, 0.19), (0.052, 0.21), (0.035, 0.23), (0.03, 0.28), (0.012, 0.30), (0.0, 0.30)], 2 * segments
    )
    cord = tube([(0, 0, 0.29), (0, 0, drop / 2), (0, 0, drop - 0.03)], 0.006, 8)
    cup = lathe([(0.0, drop - 0.05), (0.03, drop - 0.05), (0.055, drop - 0.02), (0.06, drop)], 2 * segments)
    fittings = join(m.bare() for m in (cap, cord, cup))
    return shade, fittings, sphere(0.055, 2 * segments).at(0, 0, 0.075)


def floor_lamp(segments: int) -> tuple[Mesh, Mesh]:
    """Return a standard lamp's stand and its shade of cloth."""
    stand = lathe(
        [
            (0.0, 0.0),
            (0.15, 0.0),
            (0.155, 0.012),
            (0.14, 0.025),
            (0.05, 0.035),
            (0.02, 0.06),
            (0.014, 0.10),
            (0.012, 0.70),
            (0.02, 0.72),
            (0.012, 0.74),
            (0.011, 1.45),
            (0.0, 1.46),
        ],
        2 * segments,
    )

    def drum(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        radius = (0.23 - 0.07 * v) * (1 + 0.012 * np.cos(2 * np.pi * 40 * u))
        return radius * np.cos(2 * np.pi * u), radius * np.sin(2 * np.pi * u), 1.32 + 0.30 * v

    return stand.bare(), surface(drum, 8 * segments, 2)


def foliage(leaves: int, height: float, spread: float, seed: int, width: float = 0.055) -> Mesh:
    """Return arching leaves that spring from the origin."""
    random = np.random.default_rng(seed)
    blades = []
    for k in range(leaves):
        turn = 137.5 * k + float(random.uniform(-20, 20))
        lean = float(random.uniform(0.25, 1.0))
        tall = height * float(random.uniform(0.65, 1.0)) * (1.1 - 0.45 * lean)
        reach, wide = spread * lean, width * float(random.uniform(0.7, 1.2))

        def blade(
            u: Floats, v: Floats, tall: float = tall, reach: float = reach, wide: float = wide
        ) -> tuple[Floats, Floats, Floats]:
            along = reach * v**1.4
            half = wide * np.sin(np.pi * np.clip(0.06 + 0.94 * v, 0, 1)) ** 0.7
            across = (u - 0.5) * 2 * half
            fold = 0.5 * np.abs(u - 0.5) * half
            rise = tall * (v - 0.42 * (reach / spread) * v**3)
            return along, across, rise + fold

        blades.append(surface(blade, 2, 9).turned(turn))
    return join(blades)


def tree(height: float, seed: int, leaves: int, segments: int) -> tuple[Mesh, Mesh]:
    """Return an indoor tree's trunk and branches, and its leaves."""
    random = np.random.default_rng(seed)
    wood = [
        tube(
            [(0, 0, 0), (0.02, 0.01, height * 0.3), (-0.02, 0.03, height * 0.6), (0.0, 0.02, height * 0.85)],
            (0.045, 0.036, 0.028, 0.012),
            segments,
        )
    ]
    crown = []
    for k in range(14):
        angle, base = 2.4 * k, height * (0.42 + 0.032 * k)
        reach = 0.30 * height * float(random.uniform(0.5, 1.0)) * (1.15 - 0.04 * k)
        tip = (reach * float(np.cos(angle)), reach * float(np.sin(angle)), base + 0.22 * height)
        knee = (0.55 * tip[0], 0.55 * tip[1], base + 0.13 * height)
        wood.append(tube([(0.0, 0.02, base), knee, tip], (0.014, 0.009, 0.004), 6))
        for part in (0.45, 0.7, 1.0):
            spot = np.array([0, 0.02, base]) * (1 - part) + np.array(tip) * part
            tuft = foliage(
                leaves, 0.13 * height, 0.11 * height, seed + 31 * k + int(10 * part), 0.012 * height
            )
            crown.append(tuft.at(*(float(c) for c in spot)))
    return join(wood), join(crown)


def fruit(count: int, radius: float, seed: int, segments: int) -> Mesh:
    """Return a heap of fruit for a bowl that stands at the origin."""
    random = np.random.default_rng(seed)
    balls = []
    for k in range(count):
        ring, lift = (0.085, 0.075) if k < count - 2 else (0.03, 0.13)
        angle = 2 * np.pi * k / max(count - 2, 1) + float(random.uniform(-0.2, 0.2))
        ball = sphere(radius * float(random.uniform(0.9, 1.1)), segments)
        balls.append(ball.at(ring * float(np.cos(angle)), ring * float(np.sin(angle)), lift))
    return join(balls)
