"""Twin of `enfilade.methods.paper.splat`: every source pixel against every target pixel, float64."""

import numpy as np

HALF = 0.55  # half a pixel and the overlap


def parallelogram(x, y, by_x, by_y, width, height):
    """Target pixels whose centres a splat covers, and where in the source pixel those lie.

    Returns a list of (column, row, s, t).
    """
    jacobian = np.array([[by_x[0], by_y[0]], [by_x[1], by_y[1]]], float)
    if np.linalg.det(jacobian) <= 1e-6:
        return []
    row, column = np.mgrid[:height, :width].reshape(2, -1)
    s, t = np.linalg.inv(jacobian) @ (column + 0.5 - x, row + 0.5 - y)
    is_covered = (np.abs(s) <= HALF) & (np.abs(t) <= HALF)
    return list(zip(*(v[is_covered].tolist() for v in (column, row, s, t)), strict=True))


def is_within_reach(by_x, by_y, reach):
    """Whether a splat is small enough to be drawn."""
    return all(HALF * (abs(by_x[axis]) + abs(by_y[axis])) <= reach for axis in (0, 1))


def nearest(splats, width, height, reach):
    """Lane of the nearest splat over each target pixel, -1 where there is none, (H, W).

    `splats` are tuples (x, y, inverse_depth, by_x, by_y, slope, is_splat).
    """
    winner = np.full((height, width), -1)
    best = np.full((height, width), -np.inf)
    for lane, (x, y, inverse_depth, by_x, by_y, slope, is_splat) in enumerate(splats):
        if not is_splat or not is_within_reach(by_x, by_y, reach):
            continue
        for column, row, s, t in parallelogram(x, y, by_x, by_y, width, height):
            nearness = inverse_depth + s * slope[0] + t * slope[1]
            if nearness > best[row, column]:
                best[row, column] = nearness
                winner[row, column] = lane
    return winner
