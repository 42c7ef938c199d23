"""Sudden cuts in a path that does not mark them: a jump of the pose out of all proportion to its neighbours.

The step into a frame is a cut when its rotation, or its translation,

* is more than ``RATIO`` times the largest step of the ``NEIGHBOURS`` before and of as many after it, and
* exceeds a floor: ``LEAST_TURN_DEG``, or ``LEAST_MOVE`` of the extent of the whole path.

A smooth passage, however fast, has steps like its own on at least one side, and so has motion that
begins or ends at a stop. The first and the last step have neighbours on one side alone and are never
cuts; nor are two jumps within ``NEIGHBOURS`` frames, which can't be told from a short fast motion. A cut
that is missed costs time, not quality: what no keyframe sees is traced.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from enfilade.camera.pinhole import Matrix

RATIO = 6.0  # smooth paths of some frames keep below 3; cuts of real walkthroughs lie above 10
NEIGHBOURS = 3  # steps looked at on each side
LEAST_TURN_DEG = 5.0
LEAST_MOVE = 0.01  # of the diagonal of the box around all eyes


def find_jumps(poses: Matrix) -> frozenset[int]:
    """Indices of frames that begin a new shot.

    Parameters
    ----------
    poses : (N, 4, 4) float64
        World from camera.
    """
    if len(poses) < 4:
        return frozenset()
    eyes = poses[:, :3, 3]
    move = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
    turn = _turns_deg(poses[:, :3, :3])
    extent = float(np.linalg.norm(np.ptp(eyes, axis=0)))
    is_jump = _stands_out(turn, LEAST_TURN_DEG) | _stands_out(move, LEAST_MOVE * extent)
    return frozenset(int(i) + 1 for i in np.flatnonzero(is_jump))


def _turns_deg(rotations: Matrix) -> Matrix:
    """Angle from each rotation to the next, (N-1,) degrees."""
    # |A - B| of two rotations is sqrt(8) sin(angle / 2): exact at small angles, where arccos is not
    chord = np.linalg.norm(np.diff(rotations, axis=0), axis=(1, 2))
    angles: Matrix = np.degrees(2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0)))
    return angles


def _stands_out(steps: Matrix, floor: float) -> npt.NDArray[np.bool_]:
    """Steps far larger than all their neighbours, (N,) bool."""
    largest = np.zeros_like(steps)
    for offset in range(1, NEIGHBOURS + 1):
        largest[offset:] = np.maximum(largest[offset:], steps[:-offset])
        largest[:-offset] = np.maximum(largest[:-offset], steps[offset:])
    result = (steps > floor) & (steps > RATIO * largest)
    result[[0, -1]] = False
    return result
