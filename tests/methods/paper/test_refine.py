"""Refinement: segments that are split, the keyframes that this inserts, and where it ends."""

import numpy as np
import pytest

from enfilade.camera.path import Segment
from enfilade.methods.paper.method import Paper
from enfilade.methods.paper.refine import Refinement, SegmentResult, leaf_of
from enfilade.records import Provenance
from support.closed_room import opened_room, room_path
from support.in_memory import run_passes, walk_of

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


def test_splitting_ends_where_it_does_not_help(renderer, monkeypatch):
    visible_percent(monkeypatch, lambda _: 50.0)
    walk = walk_of(room_path(9, SIZE), renderer)
    results = Refinement(walk).refine(Segment(0, 8), pytest.fail)
    assert [(r.first, r.last, r.is_split) for r in results] == [(0, 8, True), (0, 4, False), (4, 8, False)]
    assert leaf_of(results, 5) == results[2]


def test_results_survive_a_table_of_frame_numbers():
    result = SegmentResult(0, 4, 1, 2, frozenset({7, 3}), 12.5, 8.0, is_split=True)
    numbers = (10, 20, 30, 40, 50)
    assert SegmentResult.from_table(result.to_table(numbers), numbers) == result
    assert result.to_table(numbers)["middle"] == 30
