"""Workers: from a task to its ledger line."""

from __future__ import annotations

import numpy as np
import pytest

from enfilade.errors import RunFolderError
from enfilade.methods.base import Method, Output, Pass, Task
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.runs.render import prepare
from enfilade.runs.worker import Worker, analysis_of
from support.toys import toy_job


@pytest.fixture
def opened(tmp_path):
    job = toy_job(tmp_path, 20)
    prepare(job, tmp_path / "run")
    with RunFolder.share(tmp_path / "run") as run:
        yield job, run


def test_a_line_has_all_that_the_ledger_keeps(opened):
    job, run = opened
    worker = Worker(job, run)
    line = worker.do(Task("light", 2))
    assert list(line) == ["pass", "frame", "rays", "files", "cost"]
    assert (line["pass"], line["frame"], line["rays"]) == ("light", 3, {"camera": 48})
    assert list(line["files"]) == ["light/0003.exr"]
    assert set(line["cost"]) == {"light", "trace", "files"}
    assert all(set(spent) == {"wall_s", "cpu_s"} for spent in line["cost"].values())
    assert worker.do(Task("light", 3))["cost"]["light"]["wall_s"] < 60.0  # the clock began anew


def test_the_analysis_of_the_whole_path_is_read_from_the_ledger(opened):
    job, run = opened
    worker = Worker(job, run)
    run.finish(worker.do(Task("analysis", 0)))
    with pytest.raises(RunFolderError, match="not analyzed yet"):
        analysis_of(job, run)
    run.finish(worker.do(Task("analysis", 16)))
    found = analysis_of(job, run)
    assert len(found.frames) == 20
    assert found.frames[1].speed_px == pytest.approx(0.01 * job.path.cameras[0].focal_px / 4.0, rel=1e-3)


def test_a_video_needs_no_scene(opened, monkeypatch):
    job, run = opened
    monkeypatch.setattr(Job, "open_renderer", lambda _: pytest.fail("the scene was loaded"))
    Worker(job, run).prepare(Task("clips", 0))
    with pytest.raises(pytest.fail.Exception):
        Worker(job, run).prepare(Task("light", 0))


def test_only_tasks_of_the_video_open_its_view(opened, monkeypatch):
    job, run = opened
    monkeypatch.setattr("enfilade.runs.job.view_identity", lambda _: pytest.fail("the view was opened"))
    Worker(job, run).do(Task("analysis", 0))
    with pytest.raises(pytest.fail.Exception):
        Worker(job, run).do(Task("clips", 0))


class Talkative(Method):
    """A method whose tasks return given metadata."""

    name = "talkative"
    passes = (Pass("frames"),)
    metadata: dict

    def tasks(self, _analysis):
        return ()

    def run(self, _task, _inputs, _walk):
        return Output(metadata=self.metadata)


@pytest.mark.parametrize(
    ("metadata", "words"),
    [({"files": {}}, "names of the ledger's own: files"), ({"x": np.float32("nan")}, "not JSON compliant")],
)
def test_metadata_that_the_ledger_can_not_keep(opened, monkeypatch, metadata, words):
    job, run = opened
    method = Talkative()
    method.metadata = metadata
    monkeypatch.setattr(Job, "opened_method", lambda _: method)
    with pytest.raises(ValueError, match=words):
        Worker(job, run).do(Task("frames", 0))


class Undeclared(Method):
    """A pass that reads another without saying so."""

    name = "undeclared"
    passes = (Pass("mean"), Pass("frames"))

    def tasks(self, _analysis):
        return ()

    def run(self, _task, inputs, _walk):
        return Output(metadata=inputs.metadata("mean", 0))


def test_a_pass_reads_what_it_declares(opened, monkeypatch):
    job, run = opened
    monkeypatch.setattr(Job, "opened_method", lambda _: Undeclared())
    with pytest.raises(ValueError, match="'frames' does not declare that it reads 'mean'"):
        Worker(job, run).do(Task("frames", 0))


def test_facts_of_another_process_are_found_even_if_its_files_are_lost(opened):
    job, run = opened
    worker = Worker(job, RunFolder.read(run.folder))
    with pytest.raises(KeyError, match="mean 1 is not finished"):
        worker._inputs.metadata("mean", 0)
    lost = {"mean/0001.exr": {"bytes": 1, "sha256": ""}}
    run.finish({"pass": "mean", "frame": 1, "mean": 0.5, "files": lost, "cost": {}})
    assert worker._inputs.metadata("mean", 0)["mean"] == 0.5
    with pytest.raises(KeyError, match="no finished task has written"):
        worker._inputs.record("light", 0)
