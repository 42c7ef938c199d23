"""The architecture of a hall: columns, beams, stairs, balustrades and coffers."""

from __future__ import annotations

import numpy as np

from studies.scenes.solids import (
    Floats,
    Mesh,
    Point2,
    Vector,
    arch,
    block,
    extrude,
    join,
    lathe,
    span,
    surface,
)
from studies.scenes.sweeps import tube


def column(height: float, radius: float, segments: int) -> tuple[Mesh, Mesh]:
    """Return a column's shaft, which swells slightly, and its base and capital."""
    low, high = 1.1 * radius, height - 1.3 * radius
    rise = np.linspace(0.0, 1.0, 7)
    shaft = lathe(
        [(radius * (1 - 0.14 * float(t) ** 1.7), low + (high - low) * float(t)) for t in rise], 2 * segments
    )
    shaft = shaft.tiled(1.0, 2.0)
    base: list[Point2] = [
        (0.0, 0.45),
        (1.42, 0.45),
        (1.50, 0.52),
        (1.50, 0.60),
        (1.40, 0.68),
        (1.22, 0.74),
        (1.16, 0.84),
        (1.22, 0.92),
        (1.20, 1.00),
        (1.06, 1.06),
        (1.0, 1.12),
    ]
    foot = lathe([(r * radius, z * radius) for r, z in base], 2 * segments)
    head: list[Point2] = [
        (0.85, -1.32),
        (0.93, -1.30),
        (0.95, -1.22),
        (0.88, -1.18),
        (0.90, -1.0),
        (1.0, -0.8),
        (1.2, -0.58),
        (1.32, -0.5),
        (1.34, -0.42),
        (0.0, -0.42),
    ]
    bell = lathe([(r * radius, height + z * radius) for r, z in head], 2 * segments)
    plinth = block((3.1 * radius, 3.1 * radius, 0.46 * radius), 0.012)
    abacus = block((2.9 * radius, 2.9 * radius, 0.43 * radius), 0.012)
    return shaft, join([foot.bare(), bell.bare(), plinth, abacus.at(0, 0, height - 0.43 * radius)])


def stair(start: float, low_y: float, high_y: float, run: float, rise: float, steps: int) -> Mesh:
    """Return a straight flight that climbs towards +x, solid below, with rounded nosings."""
    pieces = []
    for k in range(steps):
        x, z = start + k * run, k * rise
        pieces.append(span((x, low_y, max(z - 0.55, 0.0)), (x + run + 0.01, high_y, z + rise - 0.03), 0.002))
        pieces.append(
            span((x - 0.03, low_y - 0.02, z + rise - 0.035), (x + run, high_y + 0.02, z + rise), 0.012)
        )
    return join(pieces)


def stringer(start: float, y: float, run: float, rise: float, steps: int) -> Mesh:
    """Return the cheek of a flight at one side, a sloping plate 0.12 thick."""
    length, height = run * steps, rise * steps
    outline = [
        (start - 0.25, 0.0),
        (start + 0.95, 0.0),
        (start + length, height - 0.62),
        (start + length, height + 0.06),
        (start - 0.05, 0.22),
        (start - 0.25, 0.22),
    ]
    return extrude(outline, 0.12).turned(90, "x").at(0, y + 0.06)


def runner(start: float, y: float, width: float, run: float, rise: float, steps: int) -> Mesh:
    """Return a carpet that follows a flight of stairs."""
    points: list[Point2] = [(start - 0.6, 0.012)]
    for k in range(steps):
        x, z = start + k * run - 0.04, (k + 1) * rise + 0.012
        points += [(x, k * rise + 0.012), (x, z)]
    points.append((start + steps * run + 2.2, steps * rise + 0.012))
    line = np.array(points)

    def cloth(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        at = v * (len(line) - 1)
        index = np.arange(len(line))
        return (np.interp(at, index, line[:, 0]), y + width * (0.5 - u), np.interp(at, index, line[:, 1]))

    return surface(cloth, 2, len(line) - 1)


def pane(corners: tuple[Vector, Vector, Vector, Vector]) -> Mesh:
    """Return a single sheet of glass between four corners."""
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def balustrade(start: Vector, end: Vector, bays: int, segments: int) -> tuple[Mesh, Mesh]:
    """Return a balustrade's panes and its metal, from one point of the edge to another.

    The panes stand upright also where the edge climbs.
    """
    a, b = np.array(start), np.array(end)
    panes, metal = [], []

    def point(t: float, lift: float) -> Vector:
        x, y, z = a + (b - a) * t
        return (float(x), float(y), float(z) + lift)

    for k in range(bays):
        t0, t1 = (k + 0.04) / bays, (k + 0.96) / bays
        panes.append(pane((point(t0, 0.08), point(t1, 0.08), point(t1, 0.93), point(t0, 0.93))))
    for k in range(bays + 1):
        t = k / bays
        metal.append(tube([point(t, 0.0), point(t, 0.5), point(t, 1.0)], 0.018, segments))
        metal.append(block((0.09, 0.09, 0.02)).at(*point(t, 0.0)))
    for lift, radius in ((1.02, 0.030), (0.05, 0.012)):
        metal.append(tube([point(0.0, lift), point(0.5, lift), point(1.0, lift)], radius, segments))
    return join(panes), join(metal)


def coffers(low: Point2, high: Point2, z: float, bays: tuple[int, int]) -> Mesh:
    """Return a grid of deep moulded beams, open between, its underside at height z."""
    beams = []
    for axis in (0, 1):
        other = 1 - axis
        for at in np.linspace(low[axis], high[axis], bays[axis] + 1):
            for half, bottom, top in ((0.14, 0.08, 0.40), (0.20, 0.24, 0.30), (0.10, 0.0, 0.10)):
                start, end = [0.0, 0.0, z + bottom], [0.0, 0.0, z + top]
                start[axis], end[axis] = float(at) - half, float(at) + half
                start[other], end[other] = low[other], high[other]
                beams.append(span((start[0], start[1], start[2]), (end[0], end[1], end[2]), 0.015))
    return join(beams)


def arched_frame(width: float, height: float, bar: float, depth: float, segments: int) -> Mesh:
    """Return the surround of a round-arched opening, lying face up, its foot at the origin."""
    outer = arch(width + 2 * bar, height + bar, (width + 2 * bar) / 2, segments)
    inner = [(x, y + 0.002) for x, y in arch(width, height, width / 2, segments)]
    return extrude(outer, depth, [inner])


def knot(radius: float, thickness: float, steps: int, sides: int) -> Mesh:
    """Return a trefoil knot about the origin, standing upright."""
    t = np.linspace(0.0, 2 * np.pi, steps + 1)
    x, y = np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t)
    line = np.stack([x, 0.9 * np.sin(3 * t), y], axis=1) * radius / 3.0
    points: list[Vector] = [(float(p[0]), float(p[1]), float(p[2])) for p in line]
    return tube(points, thickness, sides)
