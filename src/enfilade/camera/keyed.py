"""Keyed poses: a short JSON format of times, eyes, targets or rotations (docs/camera-paths.md).

Between keys everything is interpolated with continuous velocity and without overshoot (interpolate.py).
A key that is held rests for so long, a key with ``cut`` begins a new shot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from enfilade.camera.fields import LARGEST_SIZE, Table
from enfilade.camera.frames import MOST_FRAMES
from enfilade.camera.interpolate import interpolate_aims, interpolate_rotations, interpolate_values
from enfilade.camera.pinhole import Matrix, look_at
from enfilade.camera.rotation import from_quaternion
from enfilade.camera.shots import Shots
from enfilade.errors import CameraPathError

FORMAT = "enfilade-path"
CLOCK_TOLERANCE = 1e-6  # of a frame: times are written in decimals, frames fall at n / fps
SUM_TOLERANCE = 1e-9  # of seconds, and relative: 0.1 s and a hold of 0.2 s end at 0.3 s

_FILE_KEYS = ("format", "fps", "size", "up", "seconds", "frames", "keys")
_KEYS = ("time", "eye", "target", "rotation", "up", "fov", "hold", "cut")


@dataclass(frozen=True, eq=False)
class Key:
    """A pose at a time.

    Attributes
    ----------
    time_s : float
        Seconds.
    eye, up : (3,) float64
    target : (3,) float64, optional
    rotation : (3, 3) float64
        World from camera; looks at the target where there is one.
    fov_deg : float
        Vertical.
    is_cut : bool
        Whether a new shot begins here.
    """

    time_s: float
    eye: Matrix
    up: Matrix
    target: Matrix | None
    rotation: Matrix
    fov_deg: float
    is_cut: bool


def read_keyed(table: Table, *, fps: float | None = None) -> Shots:
    """Read the keys and sample them at every frame's time.

    Parameters
    ----------
    table
        The whole file.
    fps
        Replaces the file's frame rate: the same motion, sampled more or less often, for as long as the
        frames last that the file asks for.

    Raises
    ------
    CameraPathError
        Something is missing, malformed, unknown or contradictory.
    """
    table.allow_only(*_FILE_KEYS)
    own = table.fps() if "fps" in table or fps is None else fps
    rate = own if fps is None else fps
    keys = _read_keys(table)
    count = _frame_count(table, keys, own, rate)
    times = keys[0].time_s + np.arange(count) / rate
    poses = np.tile(np.eye(4), (count, 1, 1))
    fov_deg = np.empty(count)
    slack = CLOCK_TOLERANCE / rate
    shots = _split(keys)
    starts = [int(np.searchsorted(times, shot[0].time_s - slack)) for shot in shots]
    for shot, a, b in zip(shots, starts, [*starts[1:], count], strict=True):
        if a < b:
            try:
                eye, rotation, fov_deg[a:b] = _sample(shot, times[a:b])
            except CameraPathError as error:
                raise table.fail(f"between two keys {error}; add a key there or move the target") from error
            poses[a:b, :3, 3], poses[a:b, :3, :3] = eye, rotation
    size = _size(table)
    return Shots(
        poses=poses,
        fov_deg=fov_deg,
        fps=rate,
        size=size,
        aspect=size[0] / size[1] if size else None,
        cuts=frozenset(a for a in starts if 0 < a < count),
    )


def _read_keys(table: Table) -> list[Key]:
    upward = table.vector("up", 3) if "up" in table else np.array([0.0, 1.0, 0.0])
    keys: list[Key] = []
    for row in table.tables("keys", "key"):
        row.allow_only(*_KEYS)
        key = _read_key(row, upward, keys[-1].fov_deg if keys else None)
        if keys and not _follows(key, keys[-1]):
            raise row.fail(
                f"time {key.time_s:g} does not follow {keys[-1].time_s:g}, the end of the key before"
            )
        keys.append(key)
        hold = row.number("hold", 0.0)
        if hold < 0.0:
            raise row.fail(f"hold is {hold:g}; it must be 0 s or more")
        if hold > 0.0:
            keys.append(replace(key, time_s=key.time_s + hold, is_cut=False))
    return keys


def _follows(key: Key, before: Key) -> bool:
    if key.is_cut and math.isclose(key.time_s, before.time_s, rel_tol=SUM_TOLERANCE, abs_tol=SUM_TOLERANCE):
        return True  # the shot before rests until the cut
    return key.time_s > before.time_s


def _read_key(row: Table, upward: Matrix, last_fov_deg: float | None) -> Key:
    eye = row.vector("eye", 3)
    up = row.vector("up", 3) if "up" in row else upward
    if ("target" in row) == ("rotation" in row):
        raise row.fail("give either a target or a rotation")
    if "target" in row:
        target = row.vector("target", 3)
        rotation = _aim(row, eye, target, up)
    else:
        target = None
        rotation = _rotation(row)
    fov_deg = row.fov() if "fov" in row else last_fov_deg
    if fov_deg is None:
        raise row.fail("fov is missing; the first key must give the vertical field of view in degrees")
    return Key(
        time_s=row.number("time"),
        eye=eye,
        up=up,
        target=target,
        rotation=rotation,
        fov_deg=fov_deg,
        is_cut=row.flag("cut"),
    )


def _aim(row: Table, eye: Matrix, target: Matrix, up: Matrix) -> Matrix:
    try:
        return look_at(eye, target, up)[:3, :3]
    except CameraPathError as error:
        raise row.fail(str(error)) from error


def _rotation(row: Table) -> Matrix:
    quaternion = row.vector("rotation", 4)
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 0.01:
        raise row.fail(f"rotation is a unit quaternion w x y z; this one has length {length:.4g}")
    return from_quaternion(quaternion)


def _frame_count(table: Table, keys: list[Key], own_fps: float, fps: float) -> int:
    """Frames at a rate; how long so many frames last that a file asks for, its own rate says."""
    if "seconds" in table and "frames" in table:
        raise table.fail("give seconds or frames, not both")
    span = keys[-1].time_s - keys[0].time_s
    if "frames" in table:
        exact = table.integer("frames", least=1, most=MOST_FRAMES) * (fps / own_fps)
    elif "seconds" in table:
        exact = table.positive("seconds") * fps
    elif span == 0.0:
        raise table.fail("one key is a camera at rest; say how long by seconds, frames or the key's hold")
    else:
        exact = span * fps + 1.0  # the last key is shown
    if exact > MOST_FRAMES:
        raise table.fail(f"{exact:.0f} frames are too many; at most {MOST_FRAMES} can be rendered")
    return max(math.floor(exact + CLOCK_TOLERANCE), 1)


def _size(table: Table) -> tuple[int, int] | None:
    if "size" not in table:
        return None
    width, height = table.vector("size", 2)
    if not all(v.is_integer() and 1 <= v <= LARGEST_SIZE for v in (width, height)):
        raise table.fail(f"size is {width:g}x{height:g}; each side must be 1 to {LARGEST_SIZE} whole pixels")
    return int(width), int(height)


def _split(keys: list[Key]) -> list[list[Key]]:
    shots: list[list[Key]] = []
    for key in keys:
        if not shots or key.is_cut:
            shots.append([])
        shots[-1].append(key)
    return shots


def _sample(shot: list[Key], times: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Eyes (N, 3), rotations (N, 3, 3) and fields of view (N,) at the times, in one shot."""
    knots = np.array([key.time_s for key in shot])
    now = np.clip(times, knots[0], knots[-1])  # before a cut, and after the last key, the camera rests
    eyes = np.stack([key.eye for key in shot])
    eye = interpolate_values(knots, eyes, now)
    targets = [key.target for key in shot if key.target is not None]
    if len(targets) == len(shot):
        ups = np.stack([key.up for key in shot])
        rotation = interpolate_aims(knots, np.stack(targets), ups, now, eye)
    else:
        rotation = interpolate_rotations(knots, np.stack([key.rotation for key in shot]), now)
    # the tangent of half the angle is the image's size: a zoom of even steps looks even
    scale = np.log(np.tan(np.radians(0.5 * np.array([[key.fov_deg] for key in shot]))))
    fov_deg = 2.0 * np.degrees(np.arctan(np.exp(interpolate_values(knots, scale, now)[:, 0])))
    return eye, rotation, fov_deg
