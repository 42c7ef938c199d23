"""Several commands share a run: each step after the one before, in any order within; the run is the same."""

import dataclasses
import json
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from enfilade.errors import EnfiladeError, RunFolderError, SettingsError, UnfinishedError
from enfilade.monitor import Silence
from enfilade.pipeline.crew import Crew
from enfilade.pipeline.farm import submit, template, write_template
from enfilade.pipeline.share import Share, do_share, go_on
from enfilade.pipeline.walkthrough import prepare, render
from enfilade.records import CameraPath
from enfilade.store import Run
from scenes_analytic import room, room_walk
from small_runs import job_of

NOISY = dataclasses.replace(room(specular=True), noise=0.05)
OPENJD = Path(sys.executable).with_name("openjd")


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


@pytest.fixture
def begun(tmp_path):
    prepare(make_job(tmp_path), tmp_path / "run")
    return tmp_path / "run"


def share(folder, *which):
    do_share(folder, Share(*which), Silence(), Crew())


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


def test_a_scene_that_has_changed_is_refused(begun):
    scene = begun.parent / "scene.analytic.json"
    scene.write_text(scene.read_text().replace('"noise": 0.05', '"noise": 0.06'))
    with pytest.raises(RunFolderError, match="not the one with which the run began"):
        share(begun, "plan")


def test_a_damaged_job_is_said(begun):
    (begun / "job.json").write_text('{"scene": 3}')
    with pytest.raises(RunFolderError, match=r"job\.json is damaged"):
        share(begun, "plan")


def test_the_template_is_one_of_open_job_description(begun):
    write_template(begun, begun / "farm.json", chunks=2)
    made = json.loads((begun / "farm.json").read_text())
    assert made == template(begun, 2)
    assert [step["name"] for step in made["steps"]] == [
        "plan",
        "keyframes",
        "segments",
        "frames",
        "clips",
        "video",
    ]
    line = [str(OPENJD), "check", str(begun / "farm.json")]
    done = subprocess.run(line, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_template_run_by_open_job_description_makes_the_same_run(whole, begun):
    write_template(begun, begun / "farm.json", chunks=2)
    line = [str(OPENJD), "run", str(begun / "farm.json"), "--step", "video", "--run-dependencies"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout[-3000:]
    assert "openjd_progress: 100.0" in done.stdout
    assert Run.existing(begun).digest() == whole


class Cluster:
    """Stands for submitit: notes when each task is given to it and when it is waited for."""

    def __init__(self, failing=""):
        self.failing, self.events, self.parameters = failing, [], []
        self.helpers = SimpleNamespace(CommandFunction=list)
        self.core = SimpleNamespace(utils=SimpleNamespace(UncompletedJobError=TimeoutError))
        self.AutoExecutor = lambda **_: SimpleNamespace(
            update_parameters=lambda **given: self.parameters.append(given),
            batch=nullcontext,
            submit=self._submit,
        )

    def _submit(self, line):
        number = str(sum(what == "given" for what, _ in self.events))
        self.events.append(("given", number))
        return SimpleNamespace(job_id=number, exception=lambda: self._ended(number, line))

    def _ended(self, number, line):
        self.events.append(("ended", number))
        return RuntimeError("no memory") if self.failing in line else None


def test_tasks_on_this_machine_come_one_after_the_other(begun, monkeypatch):
    cluster = Cluster()
    monkeypatch.setitem(sys.modules, "submitit", cluster)
    jobs = submit(begun, "local", 3, {})
    assert jobs == [str(n) for n in range(1 + 3 * 3 + 1 + 1)]
    assert cluster.events == [(what, job) for job in jobs for what in ("given", "ended")]
    monkeypatch.setitem(sys.modules, "submitit", Cluster(failing="segments"))
    with pytest.raises(EnfiladeError, match="step 'segments' failed: no memory"):
        submit(begun, "local", 3, {})


def test_slurm_gets_all_tasks_of_a_step_at_once_and_holds_the_next_until_they_are_done(begun, monkeypatch):
    cluster = Cluster()
    monkeypatch.setitem(sys.modules, "submitit", cluster)
    assert cluster.events == [("given", job) for job in submit(begun, "slurm", 2, {"timeout_min": 5})]
    after = [given.get("slurm_additional_parameters") for given in cluster.parameters]
    held = ["0", "1:2", "3:4", "5:6", "7"]  # plan, keyframes, segments, frames, the clip
    assert after == [None, *({"dependency": f"afterok:{jobs}"} for jobs in held)]


@pytest.mark.slow
def test_submitit_makes_the_same_run(whole, begun):
    assert len(submit(begun, "local", 2, {"timeout_min": 5})) == 1 + 3 * 2 + 1 + 1  # the clip and the video
    assert Run.existing(begun).digest() == whole
