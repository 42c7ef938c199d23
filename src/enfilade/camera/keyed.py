"""Keyed poses: a short JSON format of times, eyes, and targets or rotations (docs/formats.md).

Values are interpolated by PCHIP (Fritsch and Butland 1984): the velocity is continuous, no coordinate leaves
the range of the two keys around it, and the camera is at rest between two equal keys. Rotations follow the
cumulative cubic Bézier curve of Kim, Kim and Shin, "A General Construction Scheme for Unit Quaternion Curves
with Simple High Order Derivatives", SIGGRAPH 1995, with the angular velocities of PCHIP at the keys.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from enfilade.camera.fields import ANY, FOV_DEG, FPS, JsonObject
from enfilade.camera.frames import MOST_FRAMES
from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, Matrix, look_at
from enfilade.errors import CameraPathError

CLOCK_TOLERANCE = 1e-6  # of a frame: times are decimal, frames fall at n / fps
DECIMALS = 9  # of a time in seconds: 0.1 s and a hold of 0.2 s end at 0.3 s
UNIT_TOLERANCE = 0.01  # of a quaternion's length


@dataclass(frozen=True, eq=False)
class Key:
    """A pose at a time."""

    time_s: float
    eye: Matrix  # (3,)
    up: Matrix  # (3,)
    target: Matrix | None  # (3,)
    rotation: Rotation  # world from camera; towards the target, if there is one
    fov_deg: float  # vertical
    is_cut: bool  # a new shot begins here


def read_keyed(document: JsonObject, size: tuple[int, int], fps: float | None = None) -> CameraPath:
    """Cameras at the time of every frame; `fps` replaces the file's frame rate, not its duration."""
    document.allow_only("format", "fps", "size", "up", "seconds", "frames", "keys")
    own_fps = document.number("fps", FPS, default=fps)
    fps = fps or own_fps
    keys = _read_keys(document)
    count = _frame_count(document, keys, own_fps, fps)
    times = keys[0].time_s + np.arange(count) / fps

    cut_keys = [k for k, key in enumerate(keys) if k > 0 and key.is_cut]
    shots = [keys[a:b] for a, b in pairwise([0, *cut_keys, len(keys)])]
    begins = np.array([shot[0].time_s for shot in shots]) - CLOCK_TOLERANCE / fps
    starts = np.searchsorted(times, begins)  # equal for a shot too short for a frame
    cameras: list[Camera] = []
    for shot, now in zip(shots, np.split(times, starts[1:]), strict=True):
        try:
            cameras += _sample(shot, now, size)
        except CameraPathError as error:
            raise document.error(f"between two keys {error}; add a key there or move the target") from error
    cuts = frozenset(int(start) for start in starts if 0 < start < count)
    return CameraPath(tuple(cameras), tuple(range(1, count + 1)), fps, cuts)


def _read_keys(document: JsonObject) -> list[Key]:
    """Keys in order of time; a hold adds a copy at its end."""
    up = document.array("up", (3,), default=(0.0, 1.0, 0.0))
    keys: list[Key] = []
    for entry in document.objects("keys", "key"):
        key = _read_key(entry, up, keys[-1].fov_deg if keys else None)
        if keys and (key.time_s < keys[-1].time_s or (key.time_s == keys[-1].time_s and not key.is_cut)):
            raise entry.error(
                f"time {key.time_s:g} must follow {keys[-1].time_s:g}, the end of the previous key"
            )
        keys.append(key)
        end_s = round(key.time_s + entry.number("hold", (0.0, ANY[1]), default=0.0), DECIMALS)
        if end_s > key.time_s:
            keys.append(replace(key, time_s=end_s, is_cut=False))
    return keys


def _read_key(entry: JsonObject, up: Matrix, last_fov_deg: float | None) -> Key:
    entry.allow_only("time", "eye", "target", "rotation", "up", "fov", "hold", "cut")
    eye, up, target = entry.array("eye", (3,)), entry.array("up", (3,), default=up), None
    if ("target" in entry) == ("rotation" in entry):
        raise entry.error("give either a target or a rotation")
    if "target" in entry:
        target = entry.array("target", (3,))
        try:
            rotation = Rotation.from_matrix(look_at(eye, target, up)[:3, :3])
        except CameraPathError as error:
            raise entry.error(str(error)) from error
    else:
        quaternion = entry.array("rotation", (4,))
        if abs(length := np.linalg.norm(quaternion) - 1.0) > UNIT_TOLERANCE:
            raise entry.error(f"rotation has length {1.0 + length:.4g}; expected a unit quaternion w x y z")
        rotation = Rotation.from_quat(quaternion, scalar_first=True)
    time_s = round(entry.number("time"), DECIMALS)
    fov_deg = entry.number("fov", FOV_DEG, default=last_fov_deg)
    return Key(time_s, eye, up, target, rotation, fov_deg, entry.flag("cut"))


def _frame_count(document: JsonObject, keys: list[Key], own_fps: float, fps: float) -> int:
    """Number of frames at a rate; `frames` counts frames at the file's own rate."""
    span_s = keys[-1].time_s - keys[0].time_s
    if "seconds" in document and "frames" in document:
        raise document.error("give seconds or frames, not both")
    if "frames" in document:
        count = document.number("frames", (1.0, MOST_FRAMES), whole=True) * (fps / own_fps)
    elif "seconds" in document:
        count = document.number("seconds", (0.0, ANY[1])) * fps
    elif span_s > 0.0:
        count = span_s * fps + 1.0  # the last key is shown
    else:
        raise document.error("a single key has no duration; give seconds, frames or the key's hold")
    if count > MOST_FRAMES:
        raise document.error(f"{count:.0f} frames are too many; at most {MOST_FRAMES} can be rendered")
    return max(math.floor(count + CLOCK_TOLERANCE), 1)


def _sample(shot: list[Key], times: Matrix, size: tuple[int, int]) -> list[Camera]:
    """Cameras of one shot at the times (N,); at rest before a cut and after the last key."""
    if len(times) == 0:
        return []
    if len(shot) == 1:
        shot = [*shot, replace(shot[0], time_s=shot[0].time_s + 1.0)]
    knots = np.array([key.time_s for key in shot])
    times = np.clip(times, knots[0], knots[-1])

    def smooth(values: Sequence[Matrix | float]) -> Matrix:
        return PchipInterpolator(knots, np.array(values))(times)

    eye = smooth([key.eye for key in shot])
    targets = [key.target for key in shot if key.target is not None]
    if len(targets) == len(shot):
        poses = look_at(eye, smooth(targets), smooth([key.up for key in shot]))
    else:
        poses = np.tile(np.eye(4), (len(times), 1, 1))
        rotations = Rotation.concatenate([key.rotation for key in shot])
        poses[:, :3, :3] = interpolate_rotations(knots, rotations, times).as_matrix()
        poses[:, :3, 3] = eye
    # the image's scale is the tangent of half the angle: a zoom is uniform in its logarithm
    zoom = smooth([math.log(math.tan(math.radians(0.5 * key.fov_deg))) for key in shot])
    fov_deg = 2.0 * np.degrees(np.arctan(np.exp(zoom)))
    return [Camera(pose, float(fov), *size) for pose, fov in zip(poses, fov_deg, strict=True)]


def interpolate_rotations(knots: Matrix, rotations: Rotation, times: Matrix) -> Rotation:
    """PCHIP for rotations: continuous angular velocity, no overshoot, the shorter way from key to key.

    SciPy's ``RotationSpline`` turns past keys at rest; ``Slerp`` has no continuous angular velocity.

    Parameters
    ----------
    knots : (K,) float64
        Increasing, at least two.
    rotations : Rotation of length K
    times : (N,) float64
        Within the knots.

    Returns
    -------
    Rotation of length N
    """
    # Compute angular velocities at the keys, in camera axes
    turn = (rotations[:-1].inv() * rotations[1:]).as_rotvec()  # (K-1, 3)
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(turn, axis=0)])
    velocity = PchipInterpolator(knots, angle).derivative()(knots)

    # Find the rotation vectors between the four control rotations of each interval
    span = np.diff(knots)[:, None]  # (K-1, 1)
    leave, arrive = velocity[:-1] * span / 3.0, velocity[1:] * span / 3.0
    rest = Rotation.from_rotvec(-leave) * Rotation.from_rotvec(turn) * Rotation.from_rotvec(-arrive)
    middle = rest.as_rotvec()

    # Evaluate the cumulative Bézier curve at the position of each time in its interval
    k = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(span) - 1)
    u = (times - knots[k])[:, None] / span[k]  # (N, 1)
    first = Rotation.from_rotvec((1.0 - (1.0 - u) ** 3) * leave[k])
    second = Rotation.from_rotvec(u**2 * (3.0 - 2.0 * u) * middle[k])
    third = Rotation.from_rotvec(u**3 * arrive[k])
    return rotations[k] * first * second * third
