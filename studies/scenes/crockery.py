"""Crockery and vessels of a kitchen: cups, plates, tins, jars, pans and a tap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.scenes.solids import Mesh, Point2, Vector, block, join, lathe, span
from studies.scenes.sweeps import tube


def cup(segments: int) -> Mesh:
    """Return a cup, 9 cm high, with its handle towards +x."""
    profile: list[Point2] = [
        (0.0, 0.0),
        (0.026, 0.0),
        (0.028, 0.006),
        (0.038, 0.02),
        (0.042, 0.05),
        (0.042, 0.09),
        (0.039, 0.09),
        (0.038, 0.05),
        (0.033, 0.022),
        (0.0, 0.012),
    ]
    angles = np.linspace(-0.45 * np.pi, 0.45 * np.pi, 7)
    loop: list[Vector] = [
        (0.041 + 0.026 * float(np.cos(a)), 0.0, 0.05 + 0.026 * float(np.sin(a))) for a in angles
    ]
    return join([lathe(profile, 2 * segments).bare(), tube(loop, 0.0045, max(segments // 2, 6))])


def plate(radius: float, segments: int) -> Mesh:
    """Return a plate with a raised rim."""
    profile: list[Point2] = [
        (0.0, 0.0),
        (0.6, 0.0),
        (0.66, 0.02),
        (0.98, 0.13),
        (1.0, 0.15),
        (0.98, 0.16),
        (0.68, 0.06),
        (0.62, 0.04),
        (0.0, 0.04),
    ]
    return lathe([(radius * r, radius * z) for r, z in profile], 3 * segments).bare()


def tin(radius: float, height: float, segments: int) -> tuple[Mesh, Mesh]:
    """Return a tin's body and its lid."""
    body = lathe([(0.0, 0.0), (radius, 0.0), (radius, height)], 2 * segments)
    lid: list[Point2] = [
        (radius, height),
        (radius + 0.002, height),
        (radius + 0.002, height + 0.016),
        (radius - 0.004, height + 0.02),
        (0.012, height + 0.02),
        (0.014, height + 0.03),
        (0.0, height + 0.034),
    ]
    return body.bare(), lathe(lid, 2 * segments).bare()


def jar(radius: float, height: float, fill: float, segments: int) -> tuple[Mesh, Mesh, Mesh]:
    """Return a storage jar's wall of thin glass, what fills a fraction of it, and its lid."""
    neck = 0.82 * radius
    wall: list[Point2] = [
        (0.0, 0.0),
        (radius - 0.006, 0.0),
        (radius, 0.006),
        (radius, 0.86 * height),
        (neck, 0.95 * height),
        (neck, height),
    ]
    inside, level = radius - 0.004, fill * 0.86 * height
    goods = lathe([(0.0, 0.004), (inside, 0.004), (inside, level), (0.0, 1.06 * level)], 2 * segments)
    lid = lathe(
        [
            (neck, height - 0.004),
            (neck + 0.004, height),
            (neck + 0.004, height + 0.02),
            (0.0, height + 0.024),
        ],
        2 * segments,
    )
    return lathe(wall, 2 * segments).bare(), goods.bare(), lid.bare()


def tumbler(segments: int) -> Mesh:
    """Return a drinking glass of solid glass, a closed surface."""
    profile: list[Point2] = [
        (0.0, 0.0),
        (0.029, 0.0),
        (0.031, 0.003),
        (0.037, 0.108),
        (0.0362, 0.11),
        (0.0345, 0.108),
        (0.029, 0.016),
        (0.0, 0.014),
    ]
    return lathe(profile, 3 * segments).bare()


def saucepan(radius: float, height: float, segments: int) -> Mesh:
    """Return an open pan with its handle towards -y."""
    profile: list[Point2] = [
        (0.0, 0.0),
        (0.95 * radius, 0.0),
        (radius, 0.01),
        (radius, height),
        (1.03 * radius, height + 0.004),
        (0.98 * radius, height),
        (0.97 * radius, 0.012),
        (0.0, 0.008),
    ]
    handle = span(
        (-0.011, -radius - 0.19, 0.82 * height), (0.011, -0.98 * radius, 0.82 * height + 0.012), 0.004
    )
    return join([lathe(profile, 3 * segments).bare(), handle])


def tap(segments: int) -> Mesh:
    """Return a mixer tap with a tall bent spout towards -y, 0.34 high."""
    base = lathe(
        [(0.0, 0.0), (0.028, 0.0), (0.028, 0.01), (0.022, 0.016), (0.022, 0.09), (0.0, 0.10)], 2 * segments
    )
    angles = np.linspace(0.0, np.pi, 13)
    bend: list[Vector] = [
        (0.0, -0.09 + 0.09 * float(np.cos(a)), 0.25 + 0.09 * float(np.sin(a))) for a in angles
    ]
    spout = tube([(0.0, 0.0, 0.06), (0.0, 0.0, 0.16), *bend, (0.0, -0.18, 0.20)], 0.0115, 2 * segments)
    lever = tube([(0.02, 0.0, 0.07), (0.05, 0.0, 0.08), (0.09, 0.0, 0.10)], (0.009, 0.006, 0.005), segments)
    return join([base.bare(), spout, lever])


def basin(length: float, width: float, depth: float) -> Mesh:
    """Return an open sink of sheet metal, its rim at z = 0, centred on the origin."""
    x, y, wall = length / 2, width / 2, 0.006
    sides = [
        span((-x, -y, -depth), (x, -y + wall, 0.0), 0.001),
        span((-x, y - wall, -depth), (x, y, 0.0), 0.001),
        span((-x, -y, -depth), (-x + wall, y, 0.0), 0.001),
        span((x - wall, -y, -depth), (x, y, 0.0), 0.001),
        span((-x, -y, -depth - wall), (x, y, -depth), 0.001),
    ]
    rim = [
        span((-x - 0.02, s * (y + 0.005) - 0.015, 0.0), (x + 0.02, s * (y + 0.005) + 0.015, 0.004), 0.001)
        for s in (-1, 1)
    ]
    rim += [
        span((s * (x + 0.005) - 0.015, -y, 0.0), (s * (x + 0.005) + 0.015, y, 0.004), 0.001) for s in (-1, 1)
    ]
    return join([*sides, *rim])


def fronts(widths: Sequence[float], height: float) -> tuple[Mesh, Mesh]:
    """Return a row of cupboard doors from x = 0, faces towards -y, and their handles."""
    doors, handles = [], []
    x = 0.0
    for width in widths:
        doors.append(span((x + 0.002, -0.02, 0.0), (x + width - 0.002, 0.0, height), 0.003))
        inset = span((x + 0.06, -0.026, 0.06), (x + width - 0.06, -0.018, height - 0.06), 0.005)
        doors.append(inset)
        bar = block((0.11, 0.012, 0.012), 0.003).at(x + width / 2, -0.045, height - 0.035)
        posts = [
            block((0.01, 0.028, 0.01), 0.002).at(x + width / 2 + s, -0.033, height - 0.034)
            for s in (-0.045, 0.045)
        ]
        handles += [bar, *posts]
        x += width
    return join(doors), join(handles)
