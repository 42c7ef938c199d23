"""What a command keeps in mind from one pass over its units to the next, and what it leaves behind."""

import os
import signal
import socket
from types import SimpleNamespace

import pytest

from enfilade.errors import DamagedFileError, NoSpaceError, RunFolderError, UnfinishedError
from enfilade.executors import Unit
from enfilade.executors.inprocess import InProcess
from enfilade.monitor import Silence
from enfilade.pipeline import crew, finish, worker
from enfilade.pipeline.crew import Crew
from enfilade.pipeline.walkthrough import render
from enfilade.store import Run
from scenes_analytic import room, room_walk
from small_runs import Told, Watcher, children, job_of

COUNT = 6
DAMAGED = "frames/0001.exr"
PARTIAL = f"frames/.0001.writing-{socket.gethostname()}-99999999-01234567.exr"  # no such process


@pytest.fixture
def folder(tmp_path):
    Run.open(tmp_path / "run", {}).close()
    (tmp_path / "run" / "frames").mkdir()
    return tmp_path / "run"


@pytest.fixture
def trace(monkeypatch):
    """Have a stub trace the frames of a run; what it does with each, a test says."""
    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.0)
    job = SimpleNamespace(method="reference", path=room_walk(COUNT, size=(8, 6)))

    def carry_out(run, do):
        begun, monitor = [], Told()

        def trace(_kind, facts):
            begun.append(facts["frame"] + 1)
            do(begun[-1])

        maker = SimpleNamespace(make=lambda _tell, **_: trace)
        monkeypatch.setattr(crew, "_open", lambda *_: InProcess(maker, print))
        carry_out.begun, carry_out.said = begun, monitor.said
        return crew.carry_out(job, run, Crew(), monitor, is_wanted=lambda unit: unit.kind == "reference")

    return carry_out


def finished(run, number):
    run.finish(f"frame {number}", files=[], facts={})


def test_what_is_set_aside_stays_so_when_a_damaged_file_is_found(folder, trace):
    (folder / DAMAGED).write_text("x")
    with Run.open(folder, {}) as run:

        def do(number):
            if number == 2:
                raise ZeroDivisionError
            if number == 4 and (folder / DAMAGED).exists():
                raise DamagedFileError("it is damaged", DAMAGED)
            finished(run, number)

        with pytest.raises(UnfinishedError, match=r"1 of the run's units .* frame 2 \(Zero.*for 0 ") as error:
            trace(run, do)
        assert error.value.units == ("frame 2",)
        assert {line["unit"] for line in run.lines()} == {f"frame {n}" for n in (1, 3, 4, 5, 6)}
    assert trace.begun == [1, 2, 2, 2, 2, 3, 4, 4, 5, 6]
    assert (folder / "failed" / "frame-2.log").read_text().count("Traceback") == 4
    assert not (folder / DAMAGED).exists()


def test_what_is_set_aside_has_its_log_when_the_disk_is_full(folder, trace):
    with Run.open(folder, {}) as run:

        def do(number):
            if number == 2:
                raise ZeroDivisionError
            if number == 4:
                raise NoSpaceError("no room")
            finished(run, number)

        with pytest.raises(NoSpaceError):
            trace(run, do)
    assert (folder / "failed" / "frame-2.log").read_text().count("Traceback") == 4


def test_a_log_that_can_not_be_written_ends_nothing(folder, trace):
    (folder / "failed").write_text("in its place")
    with Run.open(folder, {}) as run:

        def do(number):
            if number == 2:
                raise ZeroDivisionError
            finished(run, number)

        with pytest.raises(UnfinishedError, match="frame 2"):
            trace(run, do)
    assert trace.begun[-1] == COUNT
    assert any("can't write" in text and "frame-2.log" in text for text in trace.said)


def test_what_another_share_has_finished_meanwhile_is_finished(folder, trace):
    with Run.sharing(folder, "here") as here, Run.sharing(folder, "there") as there:
        assert trace(here, lambda number: finished(there if number == 3 else here, number)) == []
    assert trace.begun == [1, 2, 3, 4, 5, 6]
    assert trace.said == []


@pytest.mark.parametrize("error", [None, NoSpaceError("no room"), KeyboardInterrupt()])
def test_files_of_workers_that_died_while_they_wrote_are_removed(folder, trace, error):
    with Run.open(folder, {}) as run:

        def do(number):
            (folder / PARTIAL).write_text("x")
            if error is not None:
                raise error
            finished(run, number)

        if error is None:
            trace(run, do)
        else:
            with pytest.raises(type(error)):
                trace(run, do)
    assert not (folder / PARTIAL).exists()


def test_files_that_a_living_process_is_writing_stay(folder, trace):
    living = folder / f".encoded.writing-{socket.gethostname()}-{os.getpid()}-01234567.mp4"
    with Run.open(folder, {}) as run:

        def do(number):
            (folder / PARTIAL).write_text("x")
            living.write_text("x")
            finished(run, number)

        trace(run, do)
    assert not (folder / PARTIAL).exists()
    Run.open(folder, {}).close()
    assert living.exists()


@pytest.mark.parametrize(("after", "tries"), [(3, 1), (None, 4)])
def test_a_file_that_another_host_wrote_may_come_late(folder, trace, monkeypatch, after, tries):
    file, away, pauses = folder / DAMAGED, folder.parent / "away", []

    def sleep(seconds):
        pauses.append(seconds)
        if len(pauses) == after:
            away.rename(file)

    with Run.open(folder, {}) as run:

        def do(number):
            if number != 1:
                finished(run, number)
                return
            file.write_text("x")
            run.finish("frame 1", files=[file], facts={})
            file.rename(away)

        monkeypatch.setattr("enfilade.pipeline.crew.time.sleep", sleep)
        if after is None:
            with pytest.raises(UnfinishedError, match=r"frame 1 \(it ended without a line"):
                trace(run, do)
        else:
            trace(run, do)
            assert sum(pauses) < 5.0
            assert trace.said == []
    assert trace.begun.count(1) == tries


def chain(run):
    """A blueprint of three rounds, of which each needs the one before, through a gate or one by one."""

    def unit(name, kind, *needs):
        return Unit(name, kind, {"name": name}, needs)

    units = [unit(f"c{n}", "late", f"b{n}") for n in (1, 2, 3)]
    units += [unit(f"b{n}", "middle", "gate") for n in (1, 2, 3)]
    units += [
        Unit("gate", "gate", needs=("a1", "a2"), is_gate=True),
        unit("a1", "early"),
        unit("a2", "early"),
    ]
    return SimpleNamespace(
        first=lambda: units,
        follow=lambda _unit: (),
        is_done=lambda unit: run.done(unit.name) is not None,
    )


@pytest.mark.parametrize(
    ("lost", "wanted", "made"),
    [
        (["b1", "b2"], ["c1"], ["b1", "c1"]),  # b2 is not needed
        (["a2", "b1"], ["c1"], ["a2", "b1", "c1"]),  # through the gate
        (["a2"], ["c1"], ["c1"]),  # b1 stands: what it was made of is not needed
        (["c1", "b1"], ["c2"], ["c2"]),
    ],
)
def test_what_was_lost_is_made_again_where_it_is_needed(folder, monkeypatch, lost, wanted, made):
    monkeypatch.setattr(crew, "Blueprint", lambda _job, run: chain(run))
    begun = []
    with Run.sharing(folder, "before") as before:
        for name in ("a1", "a2", "b1", "b2", "b3"):
            (folder / name).write_text("x")
            before.finish(name, files=[folder / name], facts={})
    for name in lost:
        (folder / name).unlink(missing_ok=True)
    with Run.sharing(folder, "now") as run:

        def do(_kind, facts):
            begun.append(facts["name"])
            run.finish(facts["name"], files=[], facts={})

        maker = SimpleNamespace(make=lambda _tell, **_: do)
        monkeypatch.setattr(crew, "_open", lambda *_: InProcess(maker, print))
        left = crew.carry_out(None, run, Crew(), Told(), is_wanted=lambda unit: unit.name in wanted)
    assert (left, begun) == ([], made)


def test_a_share_that_must_wait_opens_no_worker(folder, monkeypatch):
    monkeypatch.setattr(crew, "Blueprint", lambda _job, run: chain(run))
    monkeypatch.setattr(crew, "_open", None)
    with Run.sharing(folder, "now") as run:
        left = crew.carry_out(None, run, Crew(), Told(), is_wanted=lambda unit: unit.kind == "late")
    assert left == ["c1", "c2", "c3"]


def test_files_that_other_shares_are_writing_stay(folder, trace):
    with Run.sharing(folder, "here") as here:
        (folder / PARTIAL).write_text("x")
        trace(here, lambda number: finished(here, number))
    assert (folder / PARTIAL).exists()


def change(scene):
    scene.write_text(scene.read_text().replace('"noise": 0.0', '"noise": 0.1'))
    assert '"noise": 0.1' in scene.read_text()


def test_a_scene_that_changed_is_refused_by_the_next_worker(tmp_path, monkeypatch):
    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.0)
    job, really = (
        job_of(tmp_path, room(), room_walk(COUNT, size=(8, 6)), method="reference"),
        worker.trace_reference,
    )

    def scarce(workshop, frame):
        if frame == 2:
            change(job.scene)
            raise MemoryError
        really(workshop, frame)

    monkeypatch.setattr(worker, "trace_reference", scarce)
    with pytest.raises(RunFolderError, match=r"the scene, .* not the one with which the run began"):
        render(job, tmp_path / "run", Silence())


def test_a_scene_that_changed_is_refused_by_the_next_worker_process(tmp_path):
    job = job_of(tmp_path, room(), room_walk(COUNT, size=(8, 6)), method="reference")

    def change_and_kill():
        change(job.scene)
        os.kill(children()[0], signal.SIGKILL)

    with pytest.raises(RunFolderError, match=r"the scene, .* not the one with which the run began"):
        render(job, tmp_path / "run", Watcher(2, change_and_kill), Crew("processes", 1))
    assert not children()


class Counts(Silence):
    """What bars would show: how many of how many, by stage."""

    def __init__(self):
        self.stages, self.now = {}, ""

    def stage(self, name, total):
        self.now = name
        self.stages.setdefault(name, [0, 0])
        self.extend(total)

    def advance(self, count=1):
        self.stages[self.now][0] += count

    def extend(self, count):
        self.stages[self.now][1] += count


@pytest.mark.parametrize("error", [MemoryError(), DamagedFileError("it is damaged", "frames/0003.exr")])
def test_a_unit_that_counts_itself_is_counted_once_however_often_it_is_tried(tmp_path, monkeypatch, error):
    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.0)
    really, errors = finish.encode_video, [error]

    def encode(file, frames, **how):
        if errors:
            next(frames), next(frames), next(frames)
            raise errors.pop()
        really(file, frames, **how)

    monkeypatch.setattr(finish, "encode_video", encode)
    job = job_of(tmp_path, room(), room_walk(COUNT, size=(8, 6)), method="reference")
    monitor = Counts()
    render(job, tmp_path / "run", monitor)
    assert not errors
    # The damaged frame is traced again: that is one more than there are.
    again = int(isinstance(error, DamagedFileError))
    assert monitor.stages == {"trace": [COUNT + again] * 2, "plan": [COUNT] * 2, "video": [COUNT] * 2}
