"""The context of a shot: its keyframes, and the hash grid along the path."""

from types import SimpleNamespace

import numpy as np
import pytest

from enfilade.arrays import Array3f, Float, UInt
from enfilade.camera.path import CameraPath, Segment
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.hash_grid import LEVELS, entry_key
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.settings import Settings
from support.in_memory import analysis_of

SPACING = 8


def path_of(count):
    cameras = tuple(Camera(look_at((f, 0, 4), (f, 0, 0)), 45.0, 8, 6) for f in range(count))
    return CameraPath(cameras, tuple(range(count)), 24.0)


def hash_grid_light(count):
    """What lookups at one point find along a shot whose keyframes found 1, 2, 3 ... there, and the grids."""
    at = Array3f(0.1), Array3f(0, 0, 1), UInt(1), Float(0.5)
    levels = [np.repeat(np.array(entry_key(*at, level)), 16) for level in range(LEVELS + 1)]
    keyframes = range(0, SPACING * count, SPACING)
    entries = {k: Entries.of(levels, np.full((16, 3), 1.0 + k // SPACING)) for k in keyframes}
    path = path_of(keyframes[-1] + 1)
    walk = SimpleNamespace(path=path, settings=Settings())
    inputs = SimpleNamespace(record=lambda _, k: entries[k])
    segments = [Segment(k, k + SPACING) for k in keyframes[:-1]]
    shot = ShotContext(0, segments, inputs, walk, None, None)
    assert shot.frames == len(path)
    grids = [shot.hash_grid(frame) for frame in range(len(path))]
    return np.array([np.array(grid.lookup(*at)[0])[0, 0] for grid in grids]), grids


def test_entries_of_keyframes_fade_along_the_path():
    light, _ = hash_grid_light(16)
    assert light[0] < 5.0
    assert light[-1] > 12.0
    assert (np.diff(light) >= -1e-5).all()
    assert np.diff(light).max() < 0.3  # 1 where a keyframe is replaced in one step


def test_shots_of_few_keyframes_have_one_hash_grid():
    light, grids = hash_grid_light(8)
    assert light == pytest.approx(4.5)
    assert all(grid is grids[0] for grid in grids)


def test_the_last_segment_is_not_short():
    assert Decoupled().keyframes(analysis_of(path_of(18))) == [0, 8, 17]
