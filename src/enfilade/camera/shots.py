"""Poses of all frames of a path, as a file gives them, before an image size is chosen."""

from __future__ import annotations

from dataclasses import dataclass

from enfilade.camera.pinhole import Matrix


@dataclass(frozen=True, eq=False)
class Shots:
    """Poses of all frames of a path.

    Attributes
    ----------
    poses : (N, 4, 4) float64
        World from camera.
    fov_deg : (N,) float64
        Vertical, degrees.
    fps : float
    size : tuple of int, optional
        Width and height that the file asks for, pixels.
    aspect : float, optional
        Width by height; of `size`, where there is one.
    cuts : frozenset of int
        Indices of frames that begin a new shot.
    """

    poses: Matrix
    fov_deg: Matrix
    fps: float
    size: tuple[int, int] | None
    aspect: float | None
    cuts: frozenset[int]
