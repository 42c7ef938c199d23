"""Several commands share a run: each step after the one before, in any order within; the run is the same."""

import dataclasses
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from enfilade.camera.path import CameraPath
from enfilade.errors import RunFolderError, SettingsError, UnfinishedError
from enfilade.files import read_json, write_json
from enfilade.monitor import Silence
from enfilade.pipeline.crew import Crew
from enfilade.pipeline.farm import submit, write_template
from enfilade.pipeline.share import Share, _Patience, do_share, go_on
from enfilade.pipeline.walkthrough import prepare, render
from enfilade.store import Run
from enfilade.store.lock import Lock
from scenes_analytic import room, room_walk
from small_runs import Told, Watcher, children, job_of
from support.analytic_scene import write_scene

NOISY = dataclasses.replace(room(specular=True), noise=0.05)
OPENJD = Path(sys.executable).with_name("openjd")
WORKER = Crew("processes", 1)


def make_job(folder):
    walk = room_walk(13, size=(48, 36))
    where = [0, 1, 2, 3, 3, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 12]  # with rests, which are copied
    path = CameraPath(tuple(walk.cameras[i] for i in where), tuple(range(1, len(where) + 1)), 30.0)
    tables = {"masks": {"split_percent": 10.0}, "trace": {"spp": 8}, "viewing": {"diagonal_m": 0.02}}
    return job_of(folder, NOISY, path, **tables)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    render(make_job(folder), folder / "run", Silence())
    assert any(line.get("verdict", {}).get("is_split") for line in Run.existing(folder / "run").lines())
    return Run.existing(folder / "run").digest()


@pytest.fixture(autouse=True)
def pauses(monkeypatch):
    """Nobody waits for others, but where a test says for how long; then these are the pauses."""
    made = []
    monkeypatch.setattr("enfilade.pipeline.share.PATIENCE_S", 0.0)
    monkeypatch.setattr("enfilade.pipeline.share.time.sleep", made.append)
    return made


@pytest.fixture
def begun(tmp_path):
    prepare(make_job(tmp_path), tmp_path / "run")
    return tmp_path / "run"


def share(folder, *which, crew=None, monitor=None):
    do_share(folder, Share(*which), monitor or Silence(), crew or Crew())


def flip(file):
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 4
    file.write_bytes(data)


def test_a_unit_that_kills_its_worker_does_not_kill_its_task(whole, begun):
    def kill():
        os.kill(children()[0], signal.SIGKILL)

    monitor = Watcher(1, kill)
    share(begun, "plan", crew=WORKER)
    share(begun, "keyframes", crew=WORKER, monitor=monitor)
    assert monitor.left < 0
    assert any("killed by SIGKILL; it is tried again" in text for text in monitor.said)
    go_on(begun, Silence(), Crew())
    assert Run.existing(begun).digest() == whole


@pytest.mark.parametrize("count", [1, 3])
def test_shares_in_any_order_make_the_same_run(whole, begun, count):
    share(begun, "plan")
    for step in ("keyframes", "segments", "frames"):
        for number in reversed(range(1, count + 1)):
            share(begun, step, number, count)
            share(begun, step, number, count)  # nothing is left for a second try
    assert len(list((begun / "parts").glob("*.jsonl"))) == 1 + 3 * count
    summary = go_on(begun, Silence(), Crew())
    assert Run.existing(begun).digest() == whole
    assert (begun / summary["video"]).exists()
    assert not list((begun / "parts").glob("*.jsonl"))


@pytest.mark.parametrize("step", ["keyframes", "segments", "frames", "clips"])
def test_a_step_before_the_plan_says_which_comes_first(begun, step):
    with pytest.raises(UnfinishedError, match=rf"step '{step}' comes after step 'plan', .* --step plan"):
        share(begun, step, 1, 2)
    assert not list(Run.existing(begun).lines())


def test_a_step_that_comes_too_early_says_what_it_waits_for(begun):
    share(begun, "plan")
    with pytest.raises(UnfinishedError, match=r"1 units of step 'segments' wait for .*: segment 8-13"):
        share(begun, "segments", 1, 2)
    with pytest.raises(UnfinishedError, match=r"units of step 'frames' wait for"):
        share(begun, "frames", 1, 2)
    with pytest.raises(SettingsError, match="no step 'light'; it has plan, keyframes, segments, frames"):
        share(begun, "light")
    with pytest.raises(SettingsError, match="no chunk 3 of 2"):
        share(begun, "frames", 3, 2)


@pytest.mark.parametrize("crew", [Crew(), Crew("processes", 1)], ids=["in-process", "processes"])
def test_what_an_earlier_step_wrote_is_mended_by_the_task_that_needs_it(whole, begun, crew):
    share(begun, "plan")
    for step in ("keyframes", "segments"):
        share(begun, step)
    numbers = [int(file.stem) for file in sorted((begun / "keyframes").glob("*.exr"))]
    flip(begun / "raw" / "0002.exr")  # found when it is read; then what it is made from is found
    flip(begun / "keyframes" / f"{numbers[0]:04d}.exr")
    (begun / "keyframes" / f"{numbers[1]:04d}.exr").unlink()
    (begun / "raw" / "0003.exr").unlink()
    monitor = Told()
    share(begun, "frames", 1, 2, crew=crew, monitor=monitor)
    assert any("raw/0002.exr is missing or damaged" in text for text in monitor.said)
    assert any("made again here: " in text and "raw 3" in text for text in monitor.said)
    share(begun, "frames", 2, 2, crew=crew)
    flip(begun / "frames" / "0008.exr")
    (begun / "raw" / "0008.exr").unlink()
    share(begun, "clips", crew=crew)
    go_on(begun, Silence(), Crew())
    assert Run.existing(begun).damaged() == []
    assert Run.existing(begun).digest() == whole


def test_what_is_lost_and_not_needed_is_left_to_others(begun):
    share(begun, "plan")
    share(begun, "keyframes")
    share(begun, "segments")
    (begun / "raw" / "0016.exr").unlink()
    share(begun, "frames", 1, 4)
    assert not (begun / "raw" / "0016.exr").exists()


class Releasing(list):
    """Stands for `time.sleep`: notes the pauses, and does something in one of them."""

    def __init__(self, act, after):
        super().__init__()
        self.act, self.after = act, after

    def __call__(self, seconds):
        self.append(seconds)
        if len(self) == self.after:
            self.act()


@pytest.fixture
def patient(monkeypatch):
    def wait(act, after):
        pauses = Releasing(act, after)
        monkeypatch.setattr("enfilade.pipeline.share.PATIENCE_S", 120.0)
        monkeypatch.setattr("enfilade.pipeline.share.time.sleep", pauses)
        return pauses

    return wait


GONE = '{"host": "another", "pid": 7, "started": "2026-01-01T00:00:00+00:00"}'


def test_the_lock_of_a_host_that_is_gone_is_waited_for(begun, patient):
    share(begun, "plan")
    dead, monitor = Lock(begun, part="keyframes-1-of-2"), Told()
    (begun / "parts" / "keyframes-1-of-2.lock").write_text(GONE)
    pauses = patient(dead.release, 5)
    share(begun, "keyframes", 1, 2, monitor=monitor)
    assert pauses == [2.0, 4.0, 8.0, 15.0, 15.0]
    assert "waiting up to 120 s: another command is writing " in monitor.said[0]
    assert "process 7 on another, since 2026" in monitor.said[0]
    assert not any("waiting" in text for text in monitor.said[1:])


def test_the_last_task_of_a_farm_waits_for_the_lock_too(whole, begun, patient):
    share(begun, "plan")
    dead = Lock(begun)
    pauses = patient(dead.release, 2)
    go_on(begun, Silence(), Crew())
    assert len(pauses) == 2
    assert Run.existing(begun).digest() == whole


def test_a_lock_that_stays_is_no_wrong_input(begun):
    share(begun, "plan")
    holder = Lock(begun, part="keyframes-1-of-2")
    with pytest.raises(UnfinishedError, match="another command is writing"):
        share(begun, "keyframes", 1, 2)
    with pytest.raises(UnfinishedError, match="another command is writing"):
        go_on(begun, Silence(), Crew())
    holder.release()


def test_a_run_that_was_never_shared_is_refused_at_once(begun, patient):
    holder, pauses = Lock(begun), patient(lambda: None, 1)
    with pytest.raises(RunFolderError, match="another command is writing"):
        go_on(begun, Silence(), Crew())
    with pytest.raises(RunFolderError, match="another command is writing"):
        share(begun, "plan")
    holder.release()
    assert pauses == []


@pytest.mark.parametrize("hidden", ["plan-1-of-1", "keyframes-1-of-1"])
def test_what_another_host_has_done_is_waited_for_until_it_is_seen(begun, patient, hidden):
    share(begun, "plan")
    share(begun, "keyframes")
    file, away, monitor = begun / "parts" / f"{hidden}.jsonl", begun.parent / "away", Told()
    file.rename(away)
    pauses = patient(lambda: away.rename(file), 3)
    share(begun, "segments", 1, 2, monitor=monitor)
    assert len(pauses) == 3
    assert [text for text in monitor.said if "waiting up to 120 s: " in text] == [monitor.said[0]]


def test_what_is_never_seen_is_told_after_two_minutes(begun, patient, monkeypatch):
    share(begun, "plan")
    now = iter(range(0, 10_000, 30))
    monkeypatch.setattr("enfilade.pipeline.share.time.monotonic", lambda: float(next(now)))
    pauses = patient(lambda: None, 1)
    with pytest.raises(UnfinishedError, match=r"units of step 'frames' wait for .* \(after 120 s\)"):
        share(begun, "frames", 1, 2)
    assert len(pauses) == 4


def test_work_between_two_looks_does_not_count_as_waiting(pauses, monkeypatch):
    now = iter([0.0, 900.0, 1000.0, 1900.0, 1901.0])
    monkeypatch.setattr("enfilade.pipeline.share.time.monotonic", lambda: next(now))
    late = _Patience(Silence(), 120.0)
    late.wait("two units", ("a", "b"))
    late.wait("one unit", ("b",))  # a was finished since, which took a quarter of an hour
    late.wait("one unit", ("b",))
    assert pauses == [2.0, 2.0, 4.0]
    late.wait("one unit", ("b",))  # something else took as long: it is looked once more
    assert len(pauses) == 3
    with pytest.raises(UnfinishedError, match=r"one unit \(after 120 s\)"):
        late.wait("one unit", ("b",))


@pytest.mark.parametrize("crew", [Crew(), Crew("processes", 1)], ids=["in-process", "processes"])
def test_a_damaged_line_of_another_task_is_mended_by_the_command_that_is_named(whole, begun, crew):
    share(begun, "plan")
    share(begun, "keyframes")
    file = begun / "parts" / "keyframes-1-of-1.jsonl"
    first, rest = file.read_bytes().split(b"\n", 1)
    file.write_bytes(first.replace(b"keyframe", b"keyfrome") + b"\n" + rest)
    with pytest.raises(RunFolderError, match=rf"line 1 is damaged: `enfilade work {begun}`, with no other"):
        share(begun, "segments", crew=crew)
    go_on(begun, Silence(), crew)
    assert Run.existing(begun).digest() == whole


def test_a_scene_that_has_changed_is_refused(begun):
    write_scene(begun.parent / "scene.analytic", dataclasses.replace(NOISY, noise=0.06))
    with pytest.raises(RunFolderError, match="not the one with which the run began"):
        share(begun, "plan")


def test_a_video_that_this_host_can_not_encode_is_said_in_the_first_step(begun):
    job = read_json(begun / "job.json")
    job["settings"]["video"]["codec"] = "av1"
    write_json(begun / "job.json", job)
    with pytest.raises(SettingsError, match="can't encode 48x36 pixels"):
        share(begun, "plan")


def test_a_damaged_job_is_said(begun):
    (begun / "job.json").write_text('{"scene": 3}')
    with pytest.raises(RunFolderError, match=r"job\.json is damaged"):
        share(begun, "plan")


@pytest.mark.slow
def test_the_template_run_by_open_job_description_makes_the_same_run(whole, begun):
    write_template(begun, begun / "farm.json", chunks=2)
    line = [str(OPENJD), "run", str(begun / "farm.json"), "--step", "video", "--run-dependencies"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout[-3000:]
    assert "openjd_progress: 100.0" in done.stdout
    assert Run.existing(begun).digest() == whole


@pytest.mark.slow
def test_submitit_makes_the_same_run(whole, begun):
    jobs = submit(begun, "local", 2, {"timeout_min": 5}, print)
    assert len(jobs) == 1 + 3 * 2 + 1 + 1  # the clip and the video
    assert Run.existing(begun).digest() == whole
