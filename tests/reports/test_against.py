"""A run beside its reference: image flow is that between this run's own frames."""

import json

import numpy as np
import pytest

from enfilade.images import write_result
from enfilade.reports import against
from enfilade.reports.against import Against
from enfilade.reports.seen import SeenRun
from enfilade.settings import Settings
from enfilade.store import Run

STEP_PX = 2.0  # by which all moves from each number to the next


def made_up(folder, numbers, *, has_flow=True, **path):
    """A finished run of a grey wall that passes by."""
    settings = json.loads(json.dumps(Settings().to_tables()))
    path = {"frames": list(numbers), "size": [16, 12], "fps": 24.0, "cuts": [], **path}
    identity = {"method": "reference", "path": path, "settings": settings, "versions": {}, "scene": {}}
    with Run.open(folder, identity) as run:
        (folder / "frames").mkdir()
        for index, number in enumerate(numbers):
            flow = {name: np.zeros((12, 16, 2), np.float32) for name in ("backward", "forward")}
            if index > 0:
                flow["backward"][..., 0] = STEP_PX * (numbers[index - 1] - number)
            if index + 1 < len(numbers):
                flow["forward"][..., 0] = STEP_PX * (numbers[index + 1] - number)
            file = run.file("frames", number)
            write_result(file, np.full((12, 16, 3), 0.5, np.float32), flow if has_flow else {})
            run.finish(f"frame {number}", files=[file], facts={"frame": number})
        run.finish("video", files=[], facts={})
    return SeenRun(folder)


@pytest.fixture
def speeds(monkeypatch):
    """Pixels per frame as the metric is told, frame by frame."""
    found, really = [], against.shown

    def noting(*pair, flow, **more):
        found.append(None if flow is None else float(flow.motion[0, 0, 0]))
        return really(*pair, flow=flow, **more)

    monkeypatch.setattr(against, "shown", noting)
    return found


@pytest.mark.parametrize(
    ("of_test", "of_reference", "expected"),
    [
        (range(1, 12), range(1, 12, 5), [2.0, 2.0, 2.0]),
        (range(1, 12, 5), range(1, 12), [10.0, 10.0, 10.0]),
        (range(1, 4), range(1, 4), [2.0, 2.0, 2.0]),
        (range(1, 4), range(2, 6), [2.0, 2.0]),
    ],
    ids=["a strided reference", "a strided run", "the same frames", "overlapping frames"],
)
def test_flow_leads_to_the_neighbours_in_this_run(tmp_path, speeds, of_test, of_reference, expected):
    test, reference = made_up(tmp_path / "test", of_test), made_up(tmp_path / "reference", of_reference)
    judge = Against(test, reference, has_metric=False)
    for index in test.finished:
        judge.beside(test.frame(index))
    assert speeds == pytest.approx(expected)
    assert not judge.notes


def test_the_references_flow_serves_a_run_without(tmp_path, speeds):
    test = made_up(tmp_path / "test", range(1, 4), has_flow=False)
    judge = Against(test, made_up(tmp_path / "reference", range(1, 4)), has_metric=False)
    judge.beside(test.frame(1))
    assert speeds == [2.0]
    assert not judge.notes


def test_where_no_flow_fits_it_says_so_once(tmp_path, speeds):
    test = made_up(tmp_path / "test", range(1, 7), has_flow=False)
    judge = Against(test, made_up(tmp_path / "reference", range(1, 7, 5)), has_metric=False)
    for index in (0, 5):
        judge.beside(test.frame(index))
    assert speeds == [None, None]
    assert [note for note in judge.notes if "as if nothing moved" in note] == judge.notes[-1:]


@pytest.mark.parametrize(
    ("of_reference", "poses", "is_said"),
    [(range(1, 4), "a", False), (range(1, 4), "b", True), (range(1, 6), "b", False)],
)
def test_another_camera_path_is_told(tmp_path, of_reference, poses, is_said):
    test = made_up(tmp_path / "test", range(1, 4), poses="a")
    reference = made_up(tmp_path / "reference", of_reference, poses=poses)
    notes = Against(test, reference, has_metric=False).notes
    said = [note for note in notes if "the reference reference is of another camera path" in note]
    assert len(said) == is_said
