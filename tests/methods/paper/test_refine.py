"""Refinement: segments that are split, the keyframes that this inserts, and where it ends."""

import json
from functools import cache

import drjit as dr
import numpy as np
import pytest
import scipy.fft

from enfilade.camera.path import Segment
from enfilade.methods.paper.keyframe import trace_keyframe
from enfilade.methods.paper.method import Paper
from enfilade.methods.paper.refine import Refinement, SegmentResult, leaf_of
from enfilade.metric import HalvesAqm
from enfilade.records import Geometry, Keyframe, Provenance
from support.closed_room import opened_room, room_path
from support.example_scenes import slide
from support.in_memory import run_passes, walk_of
from support.planted_wall import FRAMES, PlantedWall, planted_path

SIZE = (32, 24)


@pytest.fixture(scope="module")
def renderer(tmp_path_factory):
    return opened_room(tmp_path_factory.mktemp("room"))


def visible_percent(monkeypatch, percent):
    """Let segments have visible differences as a function of their length."""

    def compare(self, segment, _keyframe):
        middle = self._walk.path.middle(segment)
        found = 0.0 if middle is None else percent(segment.last - segment.first)
        ends = segment.first, segment.last, segment.depth
        return SegmentResult(*ends, middle=middle, percent_visible=found, is_split=found > 10.0)

    monkeypatch.setattr(Refinement, "compare", compare)


@pytest.mark.parametrize(("frames", "inserted"), [(3, [1]), (5, [1, 2, 3]), (4, [1, 2])])
def test_split_segments_have_a_keyframe_in_the_middle(renderer, monkeypatch, frames, inserted):
    visible_percent(monkeypatch, lambda length: 10.0 * length)
    walk = walk_of(room_path(frames, SIZE), renderer, sampling={"spp": 2}, keyframes={"spacing": frames - 1})
    found = run_passes(Paper(), walk)
    assert found.frames_of("segments") == inserted
    for frame in inserted:
        assert (found.record("frames", frame).provenance == Provenance.KEYFRAME).all()
    assert np.isfinite(found.colors).all()


def test_splitting_goes_on_until_the_limit_holds(renderer, monkeypatch):
    visible_percent(monkeypatch, lambda _: 50.0)
    walk = walk_of(room_path(9, SIZE), renderer)
    results = Refinement(walk).refine(Segment(0, 8), pytest.fail)
    leaves = [r for r in results if not r.is_split]
    assert [(r.first, r.last) for r in leaves] == [(k, k + 1) for k in range(8)]
    assert leaf_of([*results, SegmentResult(8, 10, 0, 9)], 9).middle == 9


def refined(change, *, spp, seed, limit=10.0):
    """Refinement of a walk along a wall that changes between frames 4 and 5."""
    tables = {"sampling": {"spp": spp}, "trace": {"seed": seed}, "masks": {"split_percent": limit}}
    walk = walk_of(planted_path(), PlantedWall(change, noise=1.0), viewing={"diagonal_m": 0.05}, **tables)

    @cache
    def keyframe(frame):
        return Keyframe(walk.view(frame).geometry, trace_keyframe(walk, frame))

    return Refinement(walk).refine(Segment(0, FRAMES - 1), keyframe)


@pytest.mark.parametrize("change", ["shadow", "highlight", "texture"])
def test_a_change_is_found_and_split_with_8_paths(change):
    results = refined(change, spp=8, seed=1)
    assert {(r.first, r.last) for r in results if r.is_split} >= {(0, 8), (4, 8), (4, 6)}
    assert not next(r for r in results if (r.first, r.last) == (0, 4)).is_split


def test_noise_of_4_paths_is_no_difference():
    # `studies/cases/README.md` has more trials.
    for seed in range(3):
        (result,) = refined("none", spp=4, seed=seed)
        assert result.percent_visible < 5.0


def test_segments_whose_keyframes_show_nothing_of_the_middle_are_split():
    path = slide(5, step=20.0, size=SIZE)
    walk = walk_of(path, PlantedWall("none", noise=0.0))
    results = Refinement(walk).refine(
        Segment(0, 4), lambda frame: Keyframe(walk.view(frame).geometry, trace_keyframe(walk, frame))
    )
    assert {(r.first, r.last) for r in results if r.is_split} == {(0, 4), (0, 2), (2, 4)}
    assert all(r.percent_visible is None for r in results)
    table = json.loads(json.dumps(results[0].to_table((1, 2, 3, 4, 5))))
    assert SegmentResult.from_table(table, (1, 2, 3, 4, 5)) == results[0]


@pytest.mark.parametrize(("change", "count"), [("none", 1), ("highlight", 2)])
def test_the_metric_judges_masks_of_specular_shapes_and_then_the_rest(monkeypatch, change, count):
    compare, times = HalvesAqm.compare_each, []
    monkeypatch.setattr(
        HalvesAqm, "compare_each", lambda *of, **more: times.append(0) or compare(*of, **more)
    )
    walk = walk_of(planted_path(), PlantedWall(change, noise=0.0), viewing={"diagonal_m": 0.05})
    if change == "highlight":
        monkeypatch.setattr(Geometry, "is_specular", property(lambda of: of.shape_index > 0))
    Refinement(walk).compare(
        Segment(0, 2), lambda frame: Keyframe(walk.view(frame).geometry, trace_keyframe(walk, frame))
    )
    assert len(times) == count


def test_no_more_threads_than_dr_jit_has(monkeypatch):
    compare, threads = HalvesAqm.compare_each, []
    monkeypatch.setattr(
        HalvesAqm,
        "compare_each",
        lambda *of, **more: threads.append(scipy.fft.get_workers()) or compare(*of, **more),
    )
    walk = walk_of(planted_path(), PlantedWall("none", noise=0.0), viewing={"diagonal_m": 0.05})
    for count in (1, 4):
        dr.set_thread_count(count)
        Refinement(walk).compare(
            Segment(0, 2), lambda frame: Keyframe(walk.view(frame).geometry, trace_keyframe(walk, frame))
        )
    assert threads == [1, 2]


def test_results_survive_a_table_of_frame_numbers():
    result = SegmentResult(0, 4, 1, 2, frozenset({7, 3}), 12.5, 8.0, is_split=True)
    numbers = (10, 20, 30, 40, 50)
    assert SegmentResult.from_table(result.to_table(numbers), numbers) == result
    assert result.to_table(numbers)["middle"] == 30
