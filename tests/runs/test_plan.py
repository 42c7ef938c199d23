"""Forecasts: the analysis of the whole path, and a dry run of an excerpt."""

from __future__ import annotations

import dataclasses

import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera
from enfilade.errors import InputError, SettingsError
from enfilade.runs import plan as module
from enfilade.runs.job import Job
from enfilade.runs.plan import EXCERPT_PIXELS, excerpt_of, forecast, plan
from support.toys import Recorder, slide, toy_job


class Stages(Recorder):
    def progress(self, name, done, total):
        self.done.append((name, done, total))


def test_a_plan(tmp_path):
    monitor = Stages()
    job = toy_job(tmp_path, path=slide(20, cuts=(6,)))
    made = plan(job, monitor)
    assert (made.method, made.frames, made.keyframes) == ("toy", tuple(range(1, 21)), ())
    assert made.tasks == {"analysis": 2, "light": 20, "mean": 2, "frames": 20, "clips": 1, "video": 1}
    assert (made.excerpt_frames, made.excerpt_size) == (9, (8, 6))
    assert 0.0 < made.seconds < 3600.0
    assert made.rays == {"camera": 1.0}
    assert made.traced_percent["total"] == 0.0
    assert len(made.mean_speed_deg_s) == len(made.slow_percent) == len(made.specular_percent) == 20
    assert monitor.done == [
        *(("analysis", n, 20) for n in range(1, 21)),
        ("dry run", 0, 1),
        ("dry run", 1, 1),
    ]
    assert list(made.to_dict()) == [field.name for field in dataclasses.fields(made)]


def test_a_dry_run_is_multiplied(tmp_path, monkeypatch):
    """Tasks of the method count by number, those of the analysis and the video by frames; all by pixels."""
    costs = {"analysis": 3.0, "light": 5.0, "mean": 7.0, "frames": 11.0, "clips": 13.0, "video": 1.0}

    class Run:
        @staticmethod
        def read(_folder):
            return Run()

        def lines(self):
            for name, wall_s in costs.items():
                yield {"pass": name, "cost": {name: {"wall_s": wall_s, "cpu_s": 2.0 * wall_s}}}

    job = toy_job(tmp_path, path=slide(18, cuts=(9,), size=(400, 400)))
    monkeypatch.setattr(module, "RunFolder", Run)
    monkeypatch.setattr(module, "render", lambda *_: {"traced_percent": {}, "rays": {}})
    made = plan(job, Stages())
    expected = 3.0 * 18 / 9 + 5.0 * 18 + 7.0 * 2 + 11.0 * 18 + 13.0 * 18 / 9 + 1.0
    assert made.excerpt_size == (200, 200)
    assert made.seconds == pytest.approx(4.0 * expected)
    assert made.cpu_seconds == pytest.approx(8.0 * expected)


def test_the_median_task_of_a_pass_counts():
    costs = [{"a": {"wall_s": s, "cpu_s": 0.0}, "b": {"wall_s": 1.0, "cpu_s": 2.0}} for s in (90.0, 3.0, 4.0)]
    assert forecast([{"pass": "frames", "cost": cost} for cost in costs], {"frames": 10}) == (50.0, 20.0)


@pytest.mark.parametrize(
    ("size", "tables", "words"),
    [
        ((65, 48), {"video": {"codec": "av1"}}, "65x48"),
        ((64, 48), {"video": {"codec": "ffv1", "view": "Film"}}, "Film"),
        ((64, 48), {"viewing": {"black_cd_m2": 900.0}}, "less than peak_cd_m2"),
    ],
)
def test_wrong_input_is_refused_before_the_scene_is_loaded(tmp_path, monkeypatch, size, tables, words):
    monkeypatch.setattr(Job, "open_renderer", lambda _: pytest.fail("the scene was loaded"))
    with pytest.raises(InputError, match=words):
        plan(toy_job(tmp_path, path=slide(3, size=size), **tables), Recorder())


def test_a_scene_that_the_method_can_not_render_is_refused(tmp_path):
    with pytest.raises(SettingsError, match=r"can't render .*wall' does not separate lobes"):
        plan(toy_job(tmp_path, method="decoupled"), monitor := Stages())
    assert monitor.done == []


def test_an_excerpt_is_of_the_longest_shot_without_repeated_poses():
    poses = slide(40).cameras
    cameras = (*poses[:6], *[poses[6]] * 30, *poses[7:14])
    path = CameraPath(cameras, tuple(range(1, len(cameras) + 1)), 24.0, frozenset({3}))
    assert excerpt_of(path).numbers == (5, 6, 7, *range(37, 43))
    assert excerpt_of(slide(4)).numbers == (1, 2, 3, 4)
    assert excerpt_of(CameraPath((poses[0],) * 5, tuple(range(5)), 24.0)).numbers == (0,)


def test_an_excerpt_is_small():
    pose = slide(1).cameras[0].world_from_camera
    path = CameraPath((Camera(pose, 50.0, 1920, 1080),), (1,), 24.0)
    small = excerpt_of(path)
    assert small.width * small.height == pytest.approx(EXCERPT_PIXELS, rel=0.02)
    assert small.width / small.height == pytest.approx(16 / 9, rel=0.02)
