"""Forecasts: the analysis of the whole path, and dry runs of an excerpt in two sizes."""

from __future__ import annotations

import dataclasses
import multiprocessing
import signal
import tempfile

import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera
from enfilade.errors import InputError, SettingsError
from enfilade.runs.job import Job
from enfilade.runs.plan import DryRun, excerpt_of, forecast, forecast_rays, plan, scaled
from support.toys import Recorder, order, slide, toy_job


class Stages(Recorder):
    def progress(self, name, done, total):
        self.done.append((name, done, total))


def test_a_plan(tmp_path):
    monitor = Stages()
    job = toy_job(tmp_path, path=slide(20, cuts=(6,)))
    made = plan(job, monitor)
    assert (made.method, made.frames, made.keyframes) == ("toy", tuple(range(1, 21)), ())
    assert made.tasks == {"analysis": 2, "light": 20, "mean": 2, "frames": 20, "clips": 1, "video": 1}
    assert (made.excerpt_frames, made.excerpt_size, made.analyzed_size) == (4, (8, 6), (8, 6))
    assert 0.0 < made.seconds < 3600.0
    assert made.rays == pytest.approx({"camera": 1.0})
    assert made.traced_percent["total"] == 0.0
    assert len(made.mean_speed_deg_s) == len(made.slow_percent) == len(made.specular_percent) == 20
    assert monitor.done == [
        *(("analysis", n, 20) for n in range(1, 21)),
        *(("dry run", n, 2) for n in range(3)),
    ]
    assert list(made.to_dict()) == [field.name for field in dataclasses.fields(made)]


def test_folders_of_a_killed_plan_are_removed_by_the_next(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    spawn = multiprocessing.get_context("spawn")
    killed = spawn.Process(target=_killed_in_a_dry_run, args=(tmp_path,))
    killed.start()
    killed.join()
    assert killed.exitcode == -signal.SIGKILL
    assert list(tmp_path.glob("*enfilade*"))
    plan(toy_job(tmp_path / "job"), Stages())
    assert not list(tmp_path.glob("*enfilade*"))


def _killed_in_a_dry_run(folder):
    tempfile.tempdir = str(folder)
    job = toy_job(folder / "job")
    order(folder / "job", light_1="kill")
    plan(job, Stages())


def test_velocities_are_those_of_the_viewing_conditions(tmp_path):
    near, far = (
        plan(toy_job(tmp_path, viewing={"distance_m": distance_m}), Stages()) for distance_m in (0.5, 1.0)
    )
    assert near.mean_speed_deg_s == pytest.approx([2.0 * speed for speed in far.mean_speed_deg_s])
    assert min(far.mean_speed_deg_s[1:]) > 0.0


def test_the_scene_is_loaded_once(tmp_path, monkeypatch):
    """Loading and tracing kernels are the larger part of the cost of a plan."""
    opened, really = [], Job.open_renderer
    monkeypatch.setattr(Job, "open_renderer", lambda job: opened.append(job) or really(job))
    plan(toy_job(tmp_path, path=slide(20)), Stages())
    assert len(opened) == 1


def line(name, *seconds):
    return [{"pass": name, "cost": {name: {"wall_s": s, "cpu_s": 2.0 * s}}} for s in seconds]


def test_a_fixed_cost_and_a_cost_of_each_pixel_are_extrapolated():
    """Two sizes give the line; the first task of a pass, which compiles kernels, does not count."""
    small = DryRun(100, line("light", 90.0, 3.0, 3.0), {})
    large = DryRun(300, line("light", 80.0, 4.0, 6.0), {})
    assert forecast(small, large, 500, {"light": 10}, {}) == (10 * 7.0, 10 * 14.0)
    assert forecast(small, large, 500, {"light": 10}, {"light": 0.5}) == (10 * 5.0, 10 * 10.0)


def test_the_compilation_of_the_only_task_of_a_pass_does_not_count():
    small, large = DryRun(100, line("irradiance", 90.0), {}), DryRun(300, line("irradiance", 4.0), {})
    assert forecast(small, large, 500, {"irradiance": 1}, {}) == (4.0, 8.0)


def test_rays_are_weighted_by_the_number_of_tasks():
    """Keyframes are rarer in a walkthrough than in its excerpt."""
    lines = [
        {"pass": "irradiance", "rays": {"irradiance": 800}},
        {"pass": "shading", "rays": {"camera": 200}},
    ]
    run = DryRun(100, [*lines, *lines], {})
    rays = forecast_rays(run, 50, {"irradiance": 10, "shading": 50}, {"irradiance": 0.5})
    assert rays == pytest.approx({"irradiance": 8.0 * 0.5 * 10 / 50, "camera": 2.0})


def test_frames_as_small_as_the_excerpt_cost_as_much():
    run = DryRun(48, line("light", 5.0, 3.0), {})
    assert forecast(run, run, 48, {"light": 2}, {}) == (6.0, 12.0)


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
    cameras = (*poses[:6], *[poses[6]] * 30, *poses[7:9])
    path = CameraPath(cameras, tuple(range(1, len(cameras) + 1)), 24.0, frozenset({3}))
    assert excerpt_of(path).numbers == (5, 6, 7, 37)
    assert excerpt_of(slide(3)).numbers == (1, 2, 3)
    assert excerpt_of(CameraPath((poses[0],) * 5, tuple(range(5)), 24.0)).numbers == (0,)


def test_a_scaled_path_is_small_and_never_larger():
    pose = slide(1).cameras[0].world_from_camera
    path = CameraPath((Camera(pose, 50.0, 1920, 1080),), (1,), 24.0)
    small = scaled(path, 16_000)
    assert small.width * small.height == pytest.approx(16_000, rel=0.02)
    assert small.width / small.height == pytest.approx(16 / 9, rel=0.02)
    assert (scaled(path, 10**9).width, small.numbers, small.fps) == (1920, (1,), 24.0)
