"""Cuts of a path whose format does not mark them: steps far larger than the steps around them.

The step into a frame is a cut if its rotation or its translation

* exceeds ``RATIO`` times the largest of the ``NEIGHBOURS`` steps before and after it, and
* exceeds a floor: ``LEAST_TURN_DEG``, or ``LEAST_MOVE`` of the extent of the whole path.

Fast smooth motion, and motion that starts or ends at rest, has steps of similar size on at least one side.
The first and the last step are never cuts, and neither are two jumps within ``NEIGHBOURS`` frames. A missed
cut costs time, not quality: disoccluded pixels are traced.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from enfilade.camera.pinhole import Matrix

RATIO = 6.0  # smooth paths of a few frames stay below 3; cuts of real walkthroughs exceed 10
NEIGHBOURS = 3  # steps on each side
LEAST_TURN_DEG = 5.0
LEAST_MOVE = 0.01  # of the diagonal of the bounding box of all eyes


def find_cuts(poses: Matrix) -> frozenset[int]:
    """Indices of frames that begin a new shot.

    Parameters
    ----------
    poses : (N, 4, 4) float64
        World from camera.
    """
    if len(poses) < 4:
        return frozenset()
    eyes, rotations = poses[:, :3, 3], poses[:, :3, :3]
    move = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
    # |A - B| of two rotations is sqrt(8) sin(angle / 2): exact at small angles, unlike arccos
    chord = np.linalg.norm(np.diff(rotations, axis=0), axis=(1, 2))
    turn_deg = np.degrees(2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0)))
    extent = float(np.linalg.norm(np.ptp(eyes, axis=0)))
    is_cut = _stands_out(turn_deg, LEAST_TURN_DEG) | _stands_out(move, LEAST_MOVE * extent)
    return frozenset(int(i) + 1 for i in np.flatnonzero(is_cut))


def _stands_out(steps: Matrix, floor: float) -> npt.NDArray[np.bool_]:
    """Steps far larger than all their neighbours, (N,) bool."""
    windows = sliding_window_view(np.pad(steps, NEIGHBOURS), 2 * NEIGHBOURS + 1)
    largest = np.delete(windows, NEIGHBOURS, axis=1).max(axis=1)
    is_interior = np.pad(np.ones(len(steps) - 2, np.bool_), 1)
    result: npt.NDArray[np.bool_] = is_interior & (steps > floor) & (steps > RATIO * largest)
    return result
