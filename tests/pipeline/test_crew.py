"""Whoever does the work, and whatever befalls them, the run is the same."""

import dataclasses
import itertools
import os
import signal
import time

import pytest

from enfilade.errors import NoSpaceError, SettingsError, UnfinishedError
from enfilade.images import open_sequence
from enfilade.monitor import Silence
from enfilade.pipeline import units, worker
from enfilade.pipeline.crew import Crew
from enfilade.pipeline.job import Job, read_job
from enfilade.pipeline.walkthrough import render
from enfilade.store import Run
from scenes_analytic import room, room_walk
from small_runs import Watcher, children, frame_bytes, job_of

NOISY = dataclasses.replace(room(specular=True), noise=0.05)


def make_job(folder):
    tables = {"masks": {"split_percent": 20.0}, "trace": {"spp": 8}, "viewing": {"diagonal_m": 0.02}}
    return job_of(folder, NOISY, room_walk(13, size=(48, 36)), **tables)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run by this process alone, never interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    render(make_job(folder), folder / "run", Silence())
    return folder / "run"


def digest(folder):
    return Run.existing(folder).digest()


def test_worker_processes_make_the_same_bytes(whole, tmp_path):
    summary = render(make_job(tmp_path), tmp_path / "run", Silence(), Crew("processes", 2))
    assert digest(tmp_path / "run") == digest(whole)
    assert frame_bytes(tmp_path / "run") == frame_bytes(whole)
    assert (tmp_path / "run" / summary["video"]).read_bytes() == (whole / summary["video"]).read_bytes()
    assert not children()


@pytest.mark.parametrize("after", [2, 20])
def test_a_worker_that_is_killed_costs_its_unit(whole, tmp_path, after):
    def kill():
        os.kill(children()[0], signal.SIGKILL)

    monitor = Watcher(after, kill)
    render(make_job(tmp_path), tmp_path / "run", monitor, Crew("processes", 2))
    assert digest(tmp_path / "run") == digest(whole)
    assert monitor.left < 0


def test_interrupted_while_workers_work(whole, tmp_path):
    def interrupt():
        raise KeyboardInterrupt

    job = make_job(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        render(job, tmp_path / "run", Watcher(30, interrupt), Crew("processes", 2))
    assert not children()
    assert len(list(Run.existing(tmp_path / "run").lines())) >= 9
    render(job, tmp_path / "run", Silence())
    assert digest(tmp_path / "run") == digest(whole)


def test_a_unit_that_always_fails_is_named_and_the_rest_is_done(whole, tmp_path, monkeypatch):
    really = worker.make_inbetween

    def poisoned(workshop, segment, verdict, frame):
        if frame == 4:
            raise ZeroDivisionError
        really(workshop, segment, verdict, frame)

    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.01)
    monitor, job = Watcher(), make_job(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(worker, "make_inbetween", poisoned)
        with pytest.raises(
            UnfinishedError, match=r"1 of the run's units .*: raw 5 \(ZeroDiv.*but for 14"
        ) as error:
            render(job, tmp_path / "run", monitor)
    assert error.value.units == ("raw 5",)
    assert len(monitor.said) == 4
    log = (tmp_path / "run" / "failed" / "raw-5.log").read_text()
    assert log.count("Traceback") == 4
    done = {line["unit"] for line in Run.existing(tmp_path / "run").lines()}
    assert {f"raw {n}" for n in range(1, 14) if n != 5} < done
    render(job, tmp_path / "run", Silence())
    assert digest(tmp_path / "run") == digest(whole)


def test_a_unit_without_memory_is_done_with_fewer_paths_in_flight(whole, tmp_path, monkeypatch):
    really, chunks = worker.make_inbetween, []

    def greedy(workshop, segment, verdict, frame):
        chunks.append(workshop.job.settings.trace.chunk)
        if chunks[-1] > 1 << 17:
            raise MemoryError
        really(workshop, segment, verdict, frame)

    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.01)
    monkeypatch.setattr(worker, "make_inbetween", greedy)
    monitor = Watcher()
    render(make_job(tmp_path), tmp_path / "run", monitor)
    assert sorted(set(chunks)) == [1 << 16, 1 << 18, 1 << 20]
    assert "with fewer paths in flight" in monitor.said[0]
    assert digest(tmp_path / "run") == digest(whole)


DAMAGED = ("keyframes/0013.exr", "raw/0004.exr", "frames/0007.exr", "run.json", "ledger.jsonl")


@pytest.mark.parametrize("crew", [Crew(), Crew("processes", 2)], ids=["in-process", "processes"])
def test_what_is_damaged_is_found_when_it_is_used_and_made_again(whole, tmp_path, crew):
    job = make_job(tmp_path)
    render(job, tmp_path / "run", Silence())
    for name in DAMAGED:
        flip(tmp_path / "run" / name)
    for number in (3, 5, 8):  # frames whose remaking reads some of the damaged ones
        (tmp_path / "run" / "frames" / f"{number:04d}.exr").unlink()
    (tmp_path / "run" / "raw" / "0012.exr").unlink()
    (tmp_path / "run" / "clips" / "0001.mp4").unlink()
    monitor = Watcher()
    render(job, tmp_path / "run", monitor, crew)
    assert digest(tmp_path / "run") == digest(whole)
    assert Run.existing(tmp_path / "run").damaged() == []
    for name in (*DAMAGED[:3], "run.json", "ledger.jsonl"):
        assert any(name in text for text in monitor.said), name


def test_what_is_damaged_while_others_have_it_in_memory_is_written_again(whole, tmp_path):
    file = tmp_path / "run" / "keyframes" / "0013.exr"

    class Damaging(Watcher):
        is_over = False

        def advance(self, count=1):
            super().advance(count)
            if file.exists() and not self.is_over:  # just recorded, and read by nobody yet
                flip(file)
                self.is_over = True

    monitor = Damaging()
    render(make_job(tmp_path), tmp_path / "run", monitor, Crew("processes", 2))
    assert any("keyframes/0013.exr is missing or damaged" in text for text in monitor.said)
    assert Run.existing(tmp_path / "run").damaged() == []
    assert digest(tmp_path / "run") == digest(whole)


def test_verified_finds_what_is_not_used(whole, tmp_path):
    job = make_job(tmp_path)
    render(job, tmp_path / "run", Silence())
    for name in DAMAGED[:3]:
        flip(tmp_path / "run" / name)
    render(job, tmp_path / "run", Silence())
    assert Run.existing(tmp_path / "run").damaged() == sorted(DAMAGED[:3], key=DAMAGED.index)
    render(job, tmp_path / "run", Silence(), is_verified=True)
    assert Run.existing(tmp_path / "run").damaged() == []
    assert digest(tmp_path / "run") == digest(whole)


def flip(file):
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 4
    file.write_bytes(data)


def test_a_full_disk_ends_it_with_what_is_needed(whole, tmp_path, monkeypatch):
    really, job = worker.make_inbetween, make_job(tmp_path)

    def full(workshop, segment, verdict, frame):
        if frame == 7:
            raise NoSpaceError("can't write raw/0008.exr")
        really(workshop, segment, verdict, frame)

    with monkeypatch.context() as patch:
        patch.setattr(worker, "make_inbetween", full)
        with pytest.raises(
            NoSpaceError, match=r"raw/0008.exr \(what is left will need about 1 MB; .* are free"
        ):
            render(job, tmp_path / "run", Silence())
    render(job, tmp_path / "run", Silence())
    assert digest(tmp_path / "run") == digest(whole)


def test_a_job_goes_through_json_unchanged(whole, tmp_path):
    job = make_job(tmp_path)
    there = Job.from_json(job.to_json())
    assert there.to_json() == job.to_json() == {**read_job(whole).to_json(), "scene": str(job.scene)}
    assert there.identity() == job.identity()


def test_an_unknown_executor_is_refused_before_anything_is_made(tmp_path):
    for name, words in (("threads", "there is no executor 'threads'"), ("ray:", "lacks the address")):
        with pytest.raises(SettingsError, match=words):
            render(make_job(tmp_path), tmp_path / "run", Silence(), Crew(name))
    assert not (tmp_path / "run").exists()


def test_clips_of_the_video_are_units(tmp_path, monkeypatch):
    monkeypatch.setattr(units, "CLIP", 5)
    summary = render(make_job(tmp_path), tmp_path / "run", Silence())
    run = Run.existing(tmp_path / "run")
    names = ["clip 1-5", "clip 6-10", "clip 11-13"]
    assert [line["unit"] for line in run.lines() if line["unit"].startswith("clip")] == names
    video = tmp_path / "run" / summary["video"]
    assert len(open_sequence(video)) == 13
    whole, clip = video.read_bytes(), tmp_path / "run" / "clips" / "0006.mp4"
    clip.unlink()
    video.unlink()
    render(make_job(tmp_path), tmp_path / "run", Silence())
    assert clip.exists()
    assert video.read_bytes() == whole


def test_a_clock_that_is_set_back_changes_nothing(tmp_path, monkeypatch, whole):
    hours = itertools.count(1_000_000_000, -3600)
    monkeypatch.setattr(time, "time", lambda: float(next(hours)))
    render(make_job(tmp_path), tmp_path / "run", Silence())
    assert digest(tmp_path / "run") == digest(whole)
