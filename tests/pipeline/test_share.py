"""Several commands share a run: each step after the one before, in any order within; the run is the same."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import pytest

from enfilade.errors import RunFolderError, SettingsError, UnfinishedError
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


@pytest.mark.slow
def test_submitit_makes_the_same_run(whole, begun):
    assert len(submit(begun, "local", 2, {"timeout_min": 5})) == 1 + 3 * 2 + 1 + 1  # the clip and the video
    assert Run.existing(begun).digest() == whole
