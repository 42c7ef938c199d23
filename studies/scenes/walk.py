"""Camera walks: a smooth curve through stations, at a varying speed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from studies.scenes.solids import Floats, Vector

FPS = 30
STEPS_PER_FRAME = 16  # of the pace's integral


@dataclass(frozen=True)
class Walk:
    """A camera path.

    Attributes
    ----------
    stations
        Positions of the eye and of its target, (eye, target), metres.
    pace
        Knots (time, pace): time from 0 to 1 over the path, pace in any unit. The pace between
        knots is smooth and without overshoot, so that motion eases in and out.
    reach
        Fraction of the curve that is walked, 0 to 1.
    fov_deg
        Vertical field of view.
    """

    stations: Sequence[tuple[Vector, Vector]]
    pace: Sequence[tuple[float, float]]
    reach: float = 1.0
    fov_deg: float = 50.0

    def poses(self, frames: int) -> Floats:
        """Return camera-to-world matrices with OpenGL axes, (frames, 4, 4)."""
        eyes, targets = (np.array([s[k] for s in self.stations]) for k in (0, 1))
        # Chord lengths of eye and gaze together keep the line's parameter near its true speed.
        chords = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
        chords += 0.5 * np.linalg.norm(np.diff(targets, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chords)])
        along = self._progress(frames) * self.reach * knots[-1]
        eye = CubicSpline(knots, eyes)(along)
        gaze = CubicSpline(knots, targets)(along)
        return np.stack([look_at(e, g) for e, g in zip(eye, gaze, strict=True)])

    def _progress(self, frames: int) -> Floats:
        """Return the fraction of the walk that is done at each frame, 0 to 1."""
        times, paces = np.array(self.pace, dtype=float).T
        fine = np.linspace(0.0, 1.0, (frames - 1) * STEPS_PER_FRAME + 1)
        pace = PchipInterpolator(times, paces)(fine)
        done = np.concatenate([[0.0], np.cumsum((pace[1:] + pace[:-1]) / 2.0)])
        return np.asarray(done[::STEPS_PER_FRAME] / done[-1])


def look_at(eye: Floats, target: Floats) -> Floats:
    """Return the camera-to-world matrix of an eye that looks at a target, z up."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(back, right), back, eye], axis=1)
    return matrix


def write_path(file: Path, poses: Floats, *, fov_deg: float, size: tuple[int, int]) -> None:
    """Write poses, (frames, 4, 4), as a nerfstudio `camera_path.json`."""
    width, height = size
    entries = [
        {
            "camera_to_world": [round(float(x), 9) for x in pose.ravel()],
            "fov": fov_deg,
            "aspect": width / height,
        }
        for pose in poses
    ]
    document = {
        "camera_type": "perspective",
        "render_width": width,
        "render_height": height,
        "fps": FPS,
        "seconds": len(poses) / FPS,
        "camera_path": entries,
    }
    file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
