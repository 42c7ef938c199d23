"""Runs from end to end: continued, refused, repaired, shared out; always the same bytes."""

from __future__ import annotations

import dataclasses
import json
import shutil
from functools import partial

import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import (
    NoSpaceError,
    RunFolderError,
    SceneError,
    SettingsError,
    UnfinishedError,
)
from enfilade.images import open_sequence
from enfilade.methods.base import Output, Pass, TaskId
from enfilade.monitor import Silence
from enfilade.runs.executor import Workers
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job, read_job
from enfilade.runs.plan import plan
from enfilade.runs.render import Shard, _video_notes, prepare, render, render_shard
from enfilade.scene.opener import Scene
from enfilade.scene.preflight import Preflight
from enfilade.settings import (
    SECTIONS,
    LimitSettings,
    OutputSettings,
    Settings,
    TraceSettings,
    VideoSettings,
    ViewingSettings,
    WarpSettings,
)
from support.toy_method import Light, Toy
from support.toys import Recorder, attempts, digest, flip, little_room, order, slide, toy_job


@pytest.fixture
def job(tmp_path):
    return toy_job(tmp_path)


@pytest.fixture
def run(tmp_path):
    return tmp_path / "run"


def changed(job, kind, **values):
    return dataclasses.replace(job, settings=job.settings.replace(kind, **values))


def test_a_finished_run_is_not_done_again(job, run, tmp_path, whole, monkeypatch):
    summary = render(job, run, Silence())
    before = {
        file: file.read_bytes() for file in run.rglob("*") if file.is_file() and file.name != "summary.json"
    }
    monkeypatch.setattr("enfilade.runs.scheduler.open_executor", None)
    monitor = Recorder()
    again = render(read_job(run), run, monitor)
    assert (monitor.done, monitor.said) == ([], [])
    assert {file: file.read_bytes() for file in before} == before
    assert (
        again["per_frame"]
        == summary["per_frame"]
        == json.loads((run / "summary.json").read_text())["per_frame"]
    )
    assert set(attempts(tmp_path).values()) == {1}
    assert digest(run) == whole
    assert summary["video"] == "video.mkv"
    assert len(open_sequence(run / "video.mkv")) == 4


def test_settings_that_the_method_does_not_read_do_not_orphan_a_run(job, run, tmp_path, whole):
    render(job, run, Silence())
    other = changed(job, WarpSettings, max_magnification=2.0)
    render(other, run, Silence())
    assert digest(run) == whole
    assert set(attempts(tmp_path).values()) == {1}
    assert json.loads((run / "job.json").read_text())["settings"]["warp"]["max_magnification"] == 2.0


def test_settings_of_the_frames_are_refused_by_name(job, run, whole):
    render(job, run, Silence())
    before = (run / "job.json").read_bytes()
    other = changed(changed(job, TraceSettings, seed=7), OutputSettings, layers="Z")
    with pytest.raises(RunFolderError) as refused:
        render(other, run, Silence())
    assert "\n  settings.trace.seed: 0 there, 7 now" in str(refused.value)
    assert 'settings.output.layers: "forward,backward,provenance" there, "Z" now' in str(refused.value)
    assert (run / "job.json").read_bytes() == before
    assert digest(run) == whole


def test_other_settings_of_the_video_encode_again_and_nothing_else(job, run, tmp_path, whole):
    render(job, run, Silence())
    monitor = Recorder()
    summary = render(changed(job, VideoSettings, codec="prores"), run, monitor, Workers("processes", 1))
    assert monitor.done == ["clips", "video"]
    assert (summary["video"], len(open_sequence(run / "video.mov"))) == ("video.mov", 4)
    videos = [*run.glob("video.*"), *(run / "clips").iterdir()]
    assert sorted(file.name for file in videos) == ["0001.mov", "video.mov"]
    assert set(attempts(tmp_path).values()) == {1}
    render(job, run, Silence())
    assert digest(run) == whole


def test_damaged_files_are_found_by_verifying_and_missing_ones_at_once(job, run, tmp_path, whole):
    render(job, run, Silence())
    flip(run / "frames" / "0002.exr")
    flip(run / "light" / "0003.exr")
    monitor = Recorder()
    render(job, run, monitor)
    assert monitor.done == []  # their sizes are right
    render(job, run, monitor, is_verified=True)
    assert monitor.said == [
        f"{name} is missing or damaged: its task is done again, if it is still needed"
        for name in ("light/0003.exr", "frames/0002.exr")
    ]
    assert sorted(monitor.done) == ["frames", "light"]
    (run / "mean" / "0001.npz").unlink(missing_ok=True)
    (run / "mean" / "0001.exr").unlink(missing_ok=True)
    (run / "frames" / "0004.exr").write_bytes(b"short")
    render(job, run, monitor)
    assert sorted(monitor.done[2:]) == ["frames", "mean"]
    assert RunFolder.read(run).damaged() == []
    assert digest(run) == whole
    counts = attempts(tmp_path)
    assert {name for name, count in counts.items() if count == 2} == {
        "light-3",
        "mean-1",
        "frames-2",
        "frames-4",
    }


def test_records_of_a_finished_run_may_be_deleted(job, run, tmp_path, whole):
    render(job, run, Silence())
    shutil.rmtree(run / "light")
    shutil.rmtree(run / "mean")
    monitor = Recorder()
    render(job, run, monitor)
    assert monitor.done == []
    render(changed(job, VideoSettings, codec="prores"), run, monitor)
    assert monitor.done == ["clips", "video"]
    (run / "frames" / "0002.exr").unlink()
    render(job, run, monitor)
    assert sorted(set(monitor.done[2:])) == ["clips", "frames", "light", "mean", "video"]
    assert attempts(tmp_path)["frames-1"] == 1
    assert digest(run) == whole


@pytest.mark.parametrize("place", [400, -1])
def test_damaged_lines_of_the_ledger_cost_their_task_and_no_more(job, run, tmp_path, whole, place):
    render(job, run, Silence())
    flip(run / "ledger.jsonl", place)
    monitor = Recorder()
    render(job, run, monitor)
    assert len(monitor.done) == 1
    assert [("damaged and left out" in text) for text in monitor.said] == ([True] if place > 0 else [])
    assert digest(run) == whole
    assert sum(attempts(tmp_path).values()) <= len(attempts(tmp_path)) + 1


def test_a_prepared_run_says_what_is_to_be_known(job, run, monkeypatch):
    monkeypatch.setattr(Scene, "preflight", lambda *_: Preflight("", ["the sky is left out"]))
    monitor = Recorder()
    prepare(job, run, monitor, has_preflight=True)
    assert monitor.said == ["the sky is left out"]


def test_a_damaged_job_is_written_again(job, run, whole):
    prepare(job, run)
    (run / "job.json").write_text("{")
    with pytest.raises(RunFolderError, match=r"job\.json is damaged"):
        render(read_job(run), run, Silence())
    render(job, run, Silence())
    assert digest(run) == whole
    render(read_job(run), run, Silence())


def test_an_edited_job_is_another_run(job, run):
    prepare(job, run)
    text = (run / "job.json").read_text()
    (run / "job.json").write_text(text.replace('"seed": 0', '"seed": 1'))
    with pytest.raises(RunFolderError, match=r"settings\.trace\.seed: 0 there, 1 now"):
        render(read_job(run), run, Silence())
    with pytest.raises(RunFolderError, match="is not that with which the run began"):
        render_shard(run, Shard("analysis"), Silence())


def test_two_commands_on_one_folder(job, run, whole):
    def second():
        with pytest.raises(RunFolderError, match="another command is writing"):
            render(job, run, Silence())
        with pytest.raises(RunFolderError, match="another command is writing"):
            render_shard(run, Shard("light"), Silence())

    render(job, run, Recorder(3, second))
    assert digest(run) == whole


def test_an_interrupted_command_is_continued(job, run, tmp_path, whole):
    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(job, run, Recorder(4, interrupt))
    render(job, run, Silence())
    assert digest(run) == whole
    assert set(attempts(tmp_path).values()) == {1}


@pytest.mark.parametrize("room", [500, 3_000, 9_000, 20_000])
def test_a_full_disk_loses_nothing_that_is_finished(tmp_path, run, room):
    job = toy_job(tmp_path, path=slide(4, size=(64, 48)))
    with little_room(room), pytest.raises(NoSpaceError, match="no room on the disk"):
        render(job, run, Silence())
    assert not list(run.rglob(".*writing*"))
    done = RunFolder.read(run).digest() if (run / "run.json").exists() else ""
    monitor = Recorder()
    render(job, run, monitor)
    assert monitor.said == []
    assert RunFolder.read(run).damaged() == []
    render(job, tmp_path / "whole", Silence())
    assert digest(run) == digest(tmp_path / "whole") != done


def test_a_refused_run_leaves_nothing_behind(job, tmp_path, monkeypatch):
    def refuse(*_arguments):
        raise SceneError("it crashed")

    monkeypatch.setattr(Scene, "preflight", refuse)
    with pytest.raises(SceneError, match="it crashed"):
        render(job, tmp_path / "deep" / "run", Silence(), has_preflight=True)
    with pytest.raises(SettingsError, match="task_timeout_s"):  # before the scene is loaded
        render(
            changed(job, LimitSettings, task_timeout_s=5.0), tmp_path / "run", Silence(), has_preflight=True
        )
    with pytest.raises(SettingsError, match="view"):
        prepare(changed(job, VideoSettings, view="Film"), tmp_path / "deep" / "run")
    assert not (tmp_path / "deep").exists()
    assert not (tmp_path / "run").exists()
    prepare(job, tmp_path / "run")
    render(job, tmp_path / "run", Silence(), has_preflight=True)  # not again for a run that was begun


@pytest.mark.parametrize("has_preflight", [False, True])
def test_what_frames_will_not_show_is_told_once(tmp_path, monkeypatch, has_preflight):
    job = toy_job(tmp_path)
    (tmp_path / "notes").write_text("there is fog")
    monkeypatch.setattr(Scene, "preflight", lambda *_: Preflight(notes=["there is fog"]))
    for act in (lambda monitor, **how: render(job, tmp_path / "run", monitor, **how), partial(plan, job)):
        monitor = Recorder()
        act(monitor, has_preflight=has_preflight)
        assert monitor.said.count("there is fog") == 1


def test_the_video_is_described_before_it_is_encoded(tmp_path):
    monitor = Recorder()
    render(
        toy_job(tmp_path, path=slide(2, size=(65, 48)), video={"codec": "h264"}), tmp_path / "run", monitor
    )
    assert len(monitor.said) == 1
    assert "65x48" in monitor.said[0]


# Shards.

PASSES = ("analysis", "light", "mean", "frames", "clips")


@pytest.fixture(scope="module")
def long_whole(tmp_path_factory):
    """Digest of a run of 20 frames in two shots."""
    folder = tmp_path_factory.mktemp("long")
    render(long_job(folder), folder / "run", Silence())
    return digest(folder / "run")


def long_job(folder):
    return toy_job(folder, path=slide(20, cuts=(7,)))


@pytest.mark.parametrize("count", [1, 3])
def test_shards_in_any_order_make_the_same_run(tmp_path, run, long_whole, count):
    prepare(long_job(tmp_path), run)
    for name in PASSES:
        for number in reversed(range(1, count + 1)):
            render_shard(run, Shard(name, number, count), Silence())
            again = Recorder()
            render_shard(run, Shard(name, number, count), again)
            assert again.done == []
    summary = render(read_job(run), run, Silence())
    assert digest(run) == long_whole
    assert (run / summary["video"]).exists()
    assert set(attempts(tmp_path).values()) == {1}


def test_shards_that_come_too_early_are_refused(tmp_path, run):
    prepare(long_job(tmp_path), run)
    with pytest.raises(
        UnfinishedError, match=rf"pass 'analysis' is not finished; first run `enfilade work {run} --pass anal"
    ):
        render_shard(run, Shard("light", 1, 2), Silence())
    render_shard(run, Shard("analysis"), Silence())
    render_shard(run, Shard("light", 1, 2), Silence())
    with pytest.raises(
        UnfinishedError, match=r"pass 'light' is not finished \(light 11, light 12, .* and 5 more\)"
    ):
        render_shard(run, Shard("mean", 1, 2), Silence())
    with pytest.raises(
        SettingsError, match="no pass 'dark'; it has analysis, light, mean, frames, clips, video"
    ):
        render_shard(run, Shard("dark"), Silence())
    with pytest.raises(SettingsError, match="no shard 3 of 2"):
        Shard("frames", 3, 2)


class Held(Toy):
    """All frames of `light` are copies of the first one, as of a pose that is held."""

    passes = (Pass("light", Light, reads=("light",)), *Toy.passes[1:])
    copies = tuple(TaskId("light", frame) for frame in (1, 2, 3))

    def tasks(self, analysis):
        for task in super().tasks(analysis):
            needs = (TaskId("light", 0),) if task.id in self.copies else task.needs
            yield dataclasses.replace(task, needs=needs)

    def run(self, task, inputs, walk):
        if task.id in self.copies:
            return Output({task.frame: inputs.record("light", 0)})
        return super().run(task, inputs, walk)


def test_a_task_is_in_the_shard_of_those_that_it_needs(tmp_path, run, monkeypatch):
    monkeypatch.setattr("enfilade.runs.job.open_method", lambda _name: Held())
    prepare(toy_job(tmp_path), run)
    render_shard(run, Shard("analysis"), Silence())
    monitor = Recorder()
    for number in (2, 1):
        render_shard(run, Shard("light", number, 2), monitor)
    assert monitor.done == ["light"] * 4


def test_a_shard_makes_damaged_files_of_earlier_passes_again(tmp_path, run, long_whole):
    prepare(long_job(tmp_path), run)
    for name in PASSES[:3]:
        render_shard(run, Shard(name), Silence())
    flip(run / "light" / "0003.exr")
    flip(run / "light" / "0004.exr")
    (run / "light" / "0005.exr").unlink()
    monitor = Recorder()
    render_shard(run, Shard("frames", 1, 2), monitor)
    assert monitor.done.count("light") == 3
    render(read_job(run), run, Silence())
    assert digest(run) == long_whole


def test_a_shard_with_a_task_that_fails_does_the_rest(tmp_path, run, long_whole):
    order(tmp_path, light_2="raise raise raise")
    prepare(long_job(tmp_path), run)
    render_shard(run, Shard("analysis"), Silence())
    with pytest.raises(UnfinishedError, match="light 2"):
        render_shard(run, Shard("light"), Silence())
    with pytest.raises(UnfinishedError, match=r"pass 'light' is not finished \(light 2\)"):
        render_shard(run, Shard("mean"), Silence())
    assert render(read_job(run), run, Silence())["frames"] == 20
    assert digest(run) == long_whole


BALL = '<shape type="sphere"/><emitter type="{}"/>'


@pytest.mark.parametrize(("emitter", "black"), [("point", [2, 3]), ("constant", [])])
def test_frames_that_show_nothing_are_told_of(tmp_path, emitter, black):
    """Frames 2 and 3 of a path look away from the only surface."""
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{BALL.format(emitter)}</scene>')
    toward, away = look_at((0, 0, 4), (0, 0, 0)), look_at((0, 0, 4), (0, 0, 8))
    cameras = tuple(Camera(pose, 50.0, 16, 12) for pose in (toward, away, away))
    settings = Settings.from_tables({"sampling": {"spp": 1}, "video": {"codec": "ffv1"}}, SECTIONS)
    job = Job(Scene(tmp_path / "scene.xml"), CameraPath(cameras, (1, 2, 3), 24.0), settings, "reference")
    summary = render(job, tmp_path / "run", monitor := Recorder())
    told = [text for text in monitor.said if "show no surface" in text]
    assert [text.partition(", and the scene")[0] for text in told] == ["frames 2-3 show no surface"] * bool(
        black
    )
    assert [n for n in summary["black_frames"] if n > 1] == black


@pytest.mark.parametrize(
    ("method", "white", "count"), [("decoupled", 1.0, 0), ("decoupled", 8.0, 1), ("paper", 8.0, 0)]
)
def test_contrasts_judged_for_another_view_than_the_video_has_are_told(job, method, white, count):
    settings = job.settings.replace(ViewingSettings, white=white)
    notes = _video_notes(dataclasses.replace(job, method=method, settings=settings))
    assert len(notes) == count
    assert all("--set viewing.white=1 is nearer to it" in note for note in notes)
