"""Records check their shapes, and know a little of themselves."""

import dataclasses
import json
from fractions import Fraction

import numpy as np
import pytest

from enfilade.camera.path import CameraPath, Segment
from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import CameraPathError
from enfilade.records import Flow, Frame, Geometry, Halves, Shading, SurfaceClass, Warped

H, W = 3, 4
CAMERA = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, W, H)


def floats(*shape):
    return np.zeros((H, W, *shape), np.float32)


def words(kind=np.uint32):
    return np.zeros((H, W), kind)


def geometry(**fields):
    known = {
        "depth": floats(),
        "normal": floats(3),
        "albedo": floats(3),
        "shape_index": words(),
        "surface": words(np.uint8),
    }
    return Geometry(CAMERA, **(known | fields))


def warped():
    return Warped(
        Halves(floats(3), floats(3)), floats(), words(), floats(), floats(), *(np.zeros((H, W), bool),) * 2
    )


RECORDS = [
    geometry(),
    Flow(floats(2), floats(2), has_backward=True, has_forward=True),
    Shading(floats(3), floats()),
    Halves(floats(3), floats(3)),
    warped(),
    Frame(floats(3), words(np.uint8)),
]


def arrays(record):
    return [f.name for f in dataclasses.fields(record) if isinstance(getattr(record, f.name), np.ndarray)]


@pytest.mark.parametrize(
    ("record", "name"),
    [(record, name) for record in RECORDS for name in arrays(record)],
    ids=lambda v: str(v)[:12],
)
def test_every_array_has_its_shape(record, name):
    grown = np.repeat(getattr(record, name), 2, axis=0)
    with pytest.raises(ValueError, match=r"expected|broadcast"):
        dataclasses.replace(record, **{name: grown})


@pytest.mark.parametrize("record", RECORDS, ids=lambda r: type(r).__name__)
def test_floats_are_of_single_precision(record):
    name = next(n for n in arrays(record) if getattr(record, n).dtype == np.float32)
    with pytest.raises(ValueError, match="expected float32"):
        dataclasses.replace(record, **{name: getattr(record, name).astype(np.float64)})


def test_geometry_knows_what_is_hit_and_specular():
    surface = words(np.uint8)
    surface[0] = [SurfaceClass.DIFFUSE, SurfaceClass.EMISSIVE, SurfaceClass.GLOSSY, SurfaceClass.MIRROR]
    surface[1, 0] = SurfaceClass.TRANSPARENT
    shape_index = (surface > 0).astype(np.uint32)
    g = geometry(surface=surface, shape_index=shape_index)
    assert g.is_hit.sum() == 5
    assert g.is_specular.ravel()[:5].tolist() == [False, False, True, True, True]


def test_motion_is_signed_and_speed_is_not():
    backward, forward = floats(2), floats(2)
    backward[..., 0], forward[..., 0] = -3.0, 3.0
    steady = Flow(backward, forward, has_backward=True, has_forward=True)
    assert (steady.motion[..., 0] == 3.0).all()
    assert (steady.speed == 3.0).all()
    turning = Flow(forward, forward, has_backward=True, has_forward=True)
    assert (turning.motion == 0.0).all()
    assert (turning.speed == 3.0).all()


def test_flow_at_the_ends_of_a_shot_is_that_of_its_one_neighbour():
    forward = floats(2)
    forward[...] = (3.0, 4.0)
    first = Flow(floats(2), forward, has_backward=False, has_forward=True)
    last = Flow(-forward, floats(2), has_backward=True, has_forward=False)
    for flow in (first, last):
        assert (flow.motion == forward).all()
        assert (flow.speed == 5.0).all()
    alone = Flow(floats(2), floats(2), has_backward=False, has_forward=False)
    assert (alone.speed == 0.0).all()


def test_a_path_falls_into_shots():
    path = CameraPath((CAMERA,) * 6, tuple(range(1, 7)), 24.0, frozenset({2, 5}))
    assert path.shots() == [range(2), range(2, 5), range(5, 6)]
    assert (len(path), path.width, path.height) == (6, W, H)
    assert CameraPath((CAMERA,), (1,), 24.0).shots() == [range(1)]


def test_numbers_of_numpy_become_plain_ones():
    """JSON has no others: identities and job descriptions could not be written."""
    pose = np.eye(4, dtype=np.float32)
    camera = Camera(pose, np.float32(50.0), np.int64(64), np.int32(36), tuple(np.float32([0.5, 0.25])))
    path = CameraPath((camera,) * 2, tuple(np.arange(2)), Fraction(24), frozenset(np.arange(1, 2)))
    numbers = [camera.fov_deg, camera.width, camera.height, *camera.principal_point]
    numbers += [*path.numbers, path.fps, *path.cuts]
    assert json.loads(json.dumps(numbers)) == [50.0, 64, 36, 0.5, 0.25, 0, 1, 24.0, 1]


@pytest.mark.parametrize(
    ("cameras", "numbers", "cuts", "words"),
    [
        ((), (), (), "0 cameras"),
        ((CAMERA,) * 2, (1,), (), "2 cameras with 1 numbers"),
        ((CAMERA,) * 3, (1, 3, 3), (), "frame 3 follows frame 3"),
        ((CAMERA,) * 3, (1, 3, 2), (), "frame 2 follows frame 3"),
        ((CAMERA,) * 3, (1, 2, 3), (1, 3), r"cuts at \[3\]; they are indices from 0 to 2"),
        ((CAMERA, dataclasses.replace(CAMERA, width=9)), (1, 2), (), "several image sizes"),
    ],
)
def test_paths_whose_frames_would_overwrite_each_other_are_refused(cameras, numbers, cuts, words):
    with pytest.raises(CameraPathError, match=words):
        CameraPath(cameras, numbers, 24.0, frozenset(cuts))


@pytest.mark.parametrize("first", [0, 3])
@pytest.mark.parametrize("length", [1, 2, 7, 24])
def test_segments_split_until_nothing_is_between(first, length):
    todo, seen = [Segment(first, first + length)], set()
    while todo:
        segment = todo.pop()
        seen.update((segment.first, segment.last))
        assert segment.depth <= 5  # log2 of 24, rounded up
        if len(segment.inbetweens):
            middle = segment.inbetweens[len(segment.inbetweens) // 2]
            todo.extend(segment.split(middle))
    assert seen == set(range(first, first + length + 1))


def test_progress_counts_views_and_no_rests():
    # Thirty frames at rest, then thirty steps: the first step is near the view of the rest.
    cameras = [Camera(look_at((max(step, 0), 0, 1), (0, 0, 0)), 50.0, W, H) for step in range(-29, 31)]
    path, segment = CameraPath(tuple(cameras), tuple(range(60)), 24.0), Segment(0, 38)
    assert path.distinct_inbetweens(segment) == list(range(30, 38))
    assert [path.progress(segment, frame) for frame in (30, 37)] == pytest.approx([1 / 9, 8 / 9])


def test_neighbours_and_rest_end_at_a_cut():
    other = Camera(look_at((1, 0, 1), (0, 0, 0)), 50.0, W, H)
    path = CameraPath((CAMERA, other, other, other, other, CAMERA), tuple(range(6)), 24.0, frozenset({3}))
    assert path.neighbours(0) == (None, other)
    assert path.neighbours(1) == (CAMERA, other)
    assert path.neighbours(2) == (other, None)
    assert path.neighbours(3) == (None, other)
    assert path.neighbours(5) == (other, None)
    assert [path.static_frame(frame) for frame in range(6)] == [0, 1, 1, 3, 3, 5]
    assert [path.distance(frame) for frame in range(6)] == [0, 1, 1, 2, 2, 3]
    assert not any(path.is_at_rest(frame) for frame in range(6))  # cut at frame 3


def test_three_frames_of_a_pose_are_a_rest_and_two_are_slow_motion():
    cameras = [Camera(look_at((x, 0, 1), (0, 0, 0)), 50.0, W, H) for x in (0, 0, 1, 1, 1, 2)]
    path = CameraPath(tuple(cameras), tuple(range(6)), 24.0)
    assert [path.is_at_rest(frame) for frame in range(6)] == [False, False, True, True, True, False]
