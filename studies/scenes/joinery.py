"""Joinery: walls with openings, mouldings, windows, doors, panelling and curtains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from studies.scenes.solids import Floats, Mesh, Point2, extrude_parts, join, span, surface, upright
from studies.scenes.sweeps import frame, moulding

# Profiles (out, z), metres, from the bottom up; the wall is at out = 0.
SKIRTING: list[Point2] = [
    (0.0, 0.0),
    (0.022, 0.0),
    (0.022, 0.11),
    (0.016, 0.125),
    (0.014, 0.14),
    (0.006, 0.15),
    (0.0, 0.152),
]
DADO: list[Point2] = [
    (0.0, -0.035),
    (0.012, -0.03),
    (0.018, -0.012),
    (0.034, 0.0),
    (0.036, 0.012),
    (0.03, 0.02),
    (0.0, 0.022),
]
CORNICE: list[Point2] = [
    (0.0, -0.17),
    (0.015, -0.165),
    (0.02, -0.14),
    (0.035, -0.13),
    (0.05, -0.09),
    (0.085, -0.05),
    (0.11, -0.04),
    (0.115, -0.022),
    (0.15, -0.012),
    (0.155, 0.0),
]
# Profiles of frames, from the inner edge up and over to the outer one.
ARCHITRAVE: list[Point2] = [
    (0.1, 0.0),
    (0.1, 0.012),
    (0.09, 0.02),
    (0.05, 0.022),
    (0.03, 0.03),
    (0.01, 0.035),
    (0.0, 0.03),
    (0.0, 0.0),
]
GAP = 0.09  # between panels
BEAD: list[Point2] = [(0.035, 0.0), (0.03, 0.008), (0.022, 0.014), (0.012, 0.016), (0.004, 0.012), (0.0, 0.0)]
GILT: list[Point2] = [
    (0.055, 0.004),
    (0.052, 0.016),
    (0.04, 0.02),
    (0.028, 0.026),
    (0.016, 0.036),
    (0.006, 0.038),
    (0.0, 0.03),
    (0.0, 0.0),
]

NORTH, WEST, SOUTH, EAST = 0.0, 90.0, 180.0, 270.0  # rotation about z of objects on a wall


def wall(outline: shapely.Polygon, openings: Sequence[shapely.Polygon], thickness: float) -> Mesh:
    """Return an upright wall; its room side is y = 0 and it is `thickness` deep towards +y."""
    rest = shapely.difference(outline, shapely.union_all(list(openings)))
    return upright(extrude_parts(rest, thickness)).at(0.0, thickness)


def hung(mesh: Mesh, x: float, y: float, z: float, on_wall: float = NORTH) -> Mesh:
    """Stand up a piece that lies face up in the xy plane, and hang its origin at a point."""
    return upright(mesh).turned(on_wall).at(x, y, z)


def casement(width: float, height: float, columns: int, rows: int, bar: float = 0.03) -> Mesh:
    """Return a window's frame and glazing bars, upright, its foot centred on the origin."""
    half, depth, stile = width / 2, 0.06, 0.065
    pieces = [
        span((-half, 0, 0), (-half + stile, depth, height)),
        span((half - stile, 0, 0), (half, depth, height)),
        span((-half, 0, 0), (half, depth, stile * 1.3)),
        span((-half, 0, height - stile), (half, depth, height)),
        span((-stile / 2, -0.01, 0), (stile / 2, depth + 0.01, height)),
    ]
    for k in range(1, columns):
        x = -half + width * k / columns
        pieces.append(span((x - bar / 2, 0.015, 0.03), (x + bar / 2, depth - 0.015, height - 0.03)))
    for k in range(1, rows):
        z = height * k / rows
        pieces.append(span((-half + 0.03, 0.015, z - bar / 2), (half - 0.03, depth - 0.015, z + bar / 2)))
    return join(pieces)


def panelled_door(width: float, height: float) -> Mesh:
    """Return a door of six raised panels, lying face up, its foot centred on the origin."""
    leaf = span((-width / 2, 0, -0.04), (width / 2, height, 0.0))
    pieces = [leaf]
    for x in (-width / 4, width / 4):
        for low, high in ((0.08, 0.34), (0.39, 0.76), (0.81, 0.95)):
            w, h = width / 2 - 0.14, (high - low) * height - 0.04
            y = (low + high) / 2 * height
            pieces.append(frame(w, h, BEAD).at(x, y))
            pieces.append(
                span(
                    (x - w / 2 + 0.05, y - h / 2 + 0.05, -0.01),
                    (x + w / 2 - 0.05, y + h / 2 - 0.05, 0.012),
                    0.01,
                )
            )
    return join(pieces)


def panelling(length: float, low: float, high: float, count: int) -> Mesh:
    """Return a row of beaded panels for a wall, lying face up, from x = 0 to `length`."""
    bay = length / count
    height = high - low
    return join(frame(bay - GAP, height, BEAD).at((k + 0.5) * bay, (low + high) / 2) for k in range(count))


def architrave(width: float, height: float) -> Mesh:
    """Return the moulded surround of an opening, lying face up, its foot centred on the origin."""
    x = width / 2 + 0.1
    line = [(x, 0.0), (x, height + 0.1), (-x, height + 0.1), (-x, 0.0)]
    return moulding(ARCHITRAVE, line)


def ring(profile: Sequence[Point2], low: Point2, high: Point2, z: float) -> Mesh:
    """Return a moulding around the inside of a rectangular room."""
    line = [low, (high[0], low[1]), high, (low[0], high[1])]
    return moulding(profile, line, closed=True).at(0, 0, z)


def curtain(width: float, height: float, folds: int, fineness: int) -> Mesh:
    """Return a drawn curtain, upright in the xz plane, its foot centred on the origin."""

    def cloth(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        # Folds are even at the pleated head and wander towards the hem.
        wander = 0.35 * (1 - v) * np.sin(5.1 * u + 1.3)
        fold = np.sin(2 * np.pi * folds * u + wander)
        waist = 1.0 - 0.10 * np.sin(np.pi * v) ** 2
        return (width * (u - 0.5) * waist, (0.030 + 0.022 * (1 - v)) * fold, height * v + 0.0 * u)

    return surface(cloth, folds * fineness, 6)


def rosette(radius: float, petals: int, segments: int) -> Mesh:
    """Return a plaster rose for a ceiling, its face towards -z, its back on z = 0."""

    def relief(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        angle, r = 2 * np.pi * u, radius * v
        petal = 0.5 + 0.5 * np.cos(petals * angle)
        depth = 0.05 * (1 - v) ** 0.5 + 0.02 * petal * np.sin(np.pi * np.clip(v * 1.2, 0, 1))
        rim = 0.02 * np.exp(-(((v - 0.92) / 0.05) ** 2))
        return r * np.cos(angle), -r * np.sin(angle), -np.where(v < 1, depth + rim, 0.0)

    return surface(relief, segments, 14)
