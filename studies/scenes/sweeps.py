"""Profiles swept along lines: mouldings, frames, rails and wires."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.scenes.solids import Floats, Mesh, Point2, Vector


def moulding(profile: Sequence[Point2], line: Sequence[Point2], closed: bool = False) -> Mesh:
    """Sweep a profile along a level line, with mitred corners.

    Parameters
    ----------
    profile
        Points (out, z), metres; `out` is measured to the left of the line. List them from the
        bottom up for a moulding that faces left, from the inner edge up and over to the outer
        one for a frame.
    line
        Corners (x, y) of the line.
    closed
        Whether the last corner joins the first.
    """
    corners = np.array(line, dtype=float)
    steps = np.roll(corners, -1, axis=0) - corners
    if not closed:
        steps[-1] = steps[-2]
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    after = np.stack([-steps[:, 1], steps[:, 0]], axis=1)
    before = np.roll(after, 1, axis=0)
    if not closed:
        before[0] = after[0]
    # A mitre leans so that the profile keeps its width on both sides of the corner.
    mitre = (before + after) / (1.0 + np.sum(before * after, axis=1, keepdims=True))
    out, height = np.array(profile, dtype=float).T
    flat = corners[:, None, :] + mitre[:, None, :] * out[None, :, None]
    level = np.broadcast_to(height[None, :, None], (*flat.shape[:2], 1))
    positions = np.concatenate([flat, level], axis=2)
    rows, columns = positions.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    following = np.roll(index, -1, axis=0) if closed else index[1:]
    leading = index if closed else index[:-1]
    a, b = leading[:, :-1].ravel(), leading[:, 1:].ravel()
    c, d = following[:, 1:].ravel(), following[:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(positions.reshape(-1, 3), faces)


def frame(width: float, height: float, profile: Sequence[Point2]) -> Mesh:
    """Return a mitred frame about (0, 0) in the xy plane; `out` of the profile points inwards."""
    x, y = width / 2, height / 2
    return moulding(profile, [(-x, -y), (x, -y), (x, y), (-x, y)], closed=True)


def tube(points: Sequence[Vector], radius: float | Sequence[float], sides: int) -> Mesh:
    """Return a round rod along a line of points, closed at both ends."""
    line = np.array(points, dtype=float)
    radii = np.broadcast_to(np.asarray(radius, dtype=float), (len(line),))
    tangents = np.gradient(line, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    angles = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    side = _across(tangents[0])
    rings = []
    for centre, tangent, r in zip(line, tangents, radii, strict=True):
        # Carry the side vector along, so that the rings do not twist.
        side = side - tangent * float(side @ tangent)
        side /= np.linalg.norm(side)
        over = np.cross(tangent, side)
        rings.append(centre + r * (np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * over))
    positions = np.concatenate([*rings, line[:1], line[-1:]])
    index = np.arange(len(line) * sides).reshape(len(line), sides)
    a, d = index[:-1].ravel(), index[1:].ravel()
    b, c = np.roll(index[:-1], -1, axis=1).ravel(), np.roll(index[1:], -1, axis=1).ravel()
    first, last = len(line) * sides, len(line) * sides + 1
    caps = [
        np.stack([np.full(sides, first), np.roll(index[0], -1), index[0]], axis=1),
        np.stack([np.full(sides, last), index[-1], np.roll(index[-1], -1)], axis=1),
    ]
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1), *caps])
    return Mesh(positions, faces)


def _across(direction: Floats) -> Floats:
    """Return some vector that is not along `direction`."""
    across: Floats = np.eye(3)[int(np.argmin(np.abs(direction)))]
    return across
