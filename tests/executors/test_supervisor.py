"""Workers that die, raise, starve or find the disk full: what is lost, tried again, set aside."""

import errno
import os
import signal
import subprocess
import sys
import time
import weakref
from pathlib import Path
from types import SimpleNamespace

import pytest

from enfilade.errors import EnfiladeError, NoSpaceError, SettingsError
from enfilade.executors import ATTEMPTS, FailureKind, Graph, Recipe, open_executor, resources, supervise
from enfilade.executors.inprocess import InProcess
from enfilade.executors.processes import Processes
from toy_worker import nothing, unit

TESTS = Path(__file__).parents[1]


@pytest.fixture(params=["in-process", "processes"])
def name(request):
    return request.param


def done(work):
    return sorted(f.name for f in work.folder.iterdir() if f.is_file() and not f.suffix)


def test_all_is_done_also_what_follows(work, name):
    def follow(finished):
        return [unit(finished.name + "x", needs=(finished.name,))] if len(finished.name) < 3 else []

    ending, told, failures = work(name, [unit("a"), unit("b", needs=("a",))], follow=follow)
    assert not ending.aside
    assert not ending.stopped
    assert not failures
    assert done(work) == ["a", "ax", "axx", "b", "bx", "bxx"]
    lines = [(unit, line) for unit, what, line in told if what == "line"]
    assert sorted(line["unit"] for _, line in lines) == done(work)
    assert all(unit.name == line["unit"] for unit, line in lines)


@pytest.mark.parametrize("kind", ["killed", "exits"])
def test_a_worker_that_dies_costs_its_unit_alone(work, kind):
    ending, _, failures = work(
        "processes", [unit(c, seconds=0.05) for c in "abc"] + [unit("k", kind, times=2)]
    )
    assert not ending.aside
    assert done(work) == ["a", "b", "c", "k"]
    assert [f[:3] for f in failures] == [("k", FailureKind.DIED, 1), ("k", FailureKind.DIED, 2)]
    tries = [line.split() for line in (work.folder / "k.tries").read_text().splitlines()]
    assert {share for share, _ in tries} == {"1"}  # nothing says that it was for its memory
    assert len({pid for _, pid in tries}) == 3
    assert all(len((work.folder / f"{c}.tries").read_text().splitlines()) == 1 for c in "abc")


def test_whom_the_kernel_kills_for_its_memory_gets_less(work, monkeypatch):
    counts = iter(range(1000))
    counter = SimpleNamespace(read_text=lambda: f"nr_free_pages 7\noom_kill {next(counts)}\nnr_dirty 3\n")
    monkeypatch.setattr(resources, "COUNTS", counter)
    ending, _, failures = work("processes", [unit("a"), unit("k", "killed", times=2)])
    assert not ending.aside
    assert [f[:3] for f in failures] == [("k", FailureKind.MEMORY, 1), ("k", FailureKind.MEMORY, 2)]
    assert "by the kernel, which lacks memory" in failures[0][3]
    assert tried_with(work, "k") == ["1", "4", "16"]


def test_the_last_attempt_is_made_with_little_memory(work):
    ending, _, failures = work("processes", [unit("k", "killed", times=3)])
    assert not ending.aside
    assert len(failures) == 3
    assert tried_with(work, "k") == ["1", "1", "1", "64"]


def tried_with(work, name):
    return [line.split()[0] for line in (work.folder / f"{name}.tries").read_text().splitlines()]


def test_a_unit_that_kills_every_worker_is_set_aside_and_the_rest_goes_on(work):
    units = [unit("p", "killed"), unit("a"), unit("b", needs=("p",)), unit("c")]
    ending, _, _ = work("processes", units)
    assert done(work) == ["a", "c"]
    [(aside, failures)] = ending.aside
    assert aside.name == "p"
    assert len(failures) == ATTEMPTS == 4
    assert failures[0].text == "its worker was killed by SIGKILL"
    assert "last words" in failures[0].log


def test_an_error_nobody_foresaw_is_tried_again_then_set_aside(work, name):
    ending, _, failures = work(name, [unit("r", "raises", times=1), unit("s", "raises"), unit("a")])
    assert done(work) == ["a", "r"]
    [(aside, own)] = ending.aside
    assert aside.name == "s"
    assert own[0].text == "ZeroDivisionError: by nought"
    assert "Traceback" in own[0].log
    assert [f[:3] for f in failures if f[0] == "r"] == [("r", FailureKind.ERROR, 1)]
    assert {line.split()[0] for line in (work.folder / "r.tries").read_text().splitlines()} == {"1"}


def test_what_had_too_little_memory_is_done_with_less(work, name):
    ending, _, _ = work(name, [unit("m", "starves", times=2)])
    assert not ending.aside
    assert [t.split()[0] for t in (work.folder / "m.tries").read_text().splitlines()] == ["1", "4", "16"]


class Big:
    """Stands for a scene."""


def test_a_failed_attempt_keeps_nothing_of_its_worker_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.0)
    scenes, alive = [], []

    def make(_tell, *, share):
        big = Big()
        alive.append(sum(scene() is not None for scene in scenes))
        scenes.append(weakref.ref(big))

        def do(_kind, _facts):
            if share < 16:
                raise MemoryError(big)

        return do

    graph = Graph()
    graph.add(unit("m"))
    executor = InProcess(SimpleNamespace(make=make), nothing)
    supervise(graph, executor, follow=nothing, is_done=lambda _: True, failed=nothing)
    assert alive == [0, 0, 0]


@pytest.mark.parametrize(("kind", "what"), [("damaged", FailureKind.DAMAGED), ("full", FailureKind.SPACE)])
def test_what_another_try_would_not_mend_ends_it(work, name, kind, what):
    units = [unit("a"), unit("f", kind, needs=("a",)), unit("z", needs=("f",))]
    ending, _, _ = work(name, units, workers=1)
    assert ending.stopped.kind is what
    assert isinstance(ending.stopped.error, EnfiladeError)
    assert ending.stopped.file == ("raw/0001.exr" if kind == "damaged" else "")
    assert done(work) == ["a"]


def test_a_worker_that_can_not_begin_says_why(work, name):
    ending, _, _ = work(name, [unit("a")], refuses=True)
    assert isinstance(ending.stopped.error, SettingsError)
    assert str(ending.stopped.error) == "no such scene"


def test_one_that_says_it_is_finished_and_is_not_has_failed(work, name):
    ending, _, failures = work(name, [unit("l", "lies", times=1), unit("m", "lies")])
    assert done(work) == ["l"]
    assert [aside.name for aside, _ in ending.aside] == ["m"]
    assert failures[0][1] is FailureKind.ERROR


def test_workers_go_with_who_closes_them(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    recipe = Recipe("toy_worker:open_toy", {"folder": str(tmp_path)})
    executor = Processes(recipe, nothing, workers=2, logs=tmp_path / "logs")
    executor.begin(0, unit("h", "hangs"), share=1)
    while not (tmp_path / "h.tries").exists():
        time.sleep(0.01)
    [pid] = executor.pids
    begin = time.monotonic()
    executor.close()
    executor.close()
    assert not Path(f"/proc/{pid}").exists()
    assert time.monotonic() - begin < 4.0


def test_all_workers_are_killed_before_one_is_waited_for(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    recipe = Recipe("toy_worker:open_toy", {"folder": str(tmp_path)})
    executor = Processes(recipe, nothing, workers=3, logs=tmp_path / "logs")
    for slot in range(3):
        executor.begin(slot, unit(f"h{slot}", "hangs"), share=1)
    calls, kill, wait = [], subprocess.Popen.kill, subprocess.Popen.wait
    monkeypatch.setattr(subprocess.Popen, "kill", lambda self: (calls.append("kill"), kill(self)))
    monkeypatch.setattr(subprocess.Popen, "wait", lambda self, *s: (calls.append("wait"), wait(self, *s))[1])
    executor.close()
    assert calls[:3] == ["kill"] * 3
    assert set(calls[3:]) == {"wait"}
    assert not executor.pids


def test_a_worker_that_the_kernel_holds_ends_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    monkeypatch.setattr("enfilade.executors.processes.GRACE_S", 0.0)
    monkeypatch.setattr(subprocess.Popen, "kill", lambda _: None)
    recipe = Recipe("toy_worker:open_toy", {"folder": str(tmp_path)})
    executor = Processes(recipe, nothing, workers=1, logs=tmp_path / "logs")
    executor.begin(0, unit("h", "hangs"), share=1)
    process = executor._children[0].process
    executor.close()
    os.kill(process.pid, signal.SIGKILL)
    process.wait()


def test_a_full_disk_without_room_for_a_log_is_said(tmp_path, monkeypatch):
    def full(*_arguments, **_options):
        raise OSError(errno.ENOSPC, "No space left on device")

    executor = Processes(Recipe(""), nothing, workers=1, logs=tmp_path / "logs")
    monkeypatch.setattr(Path, "mkdir", full)
    with pytest.raises(NoSpaceError, match=r"logs/worker-[^/]+-0\.log: no room"):
        executor.begin(0, unit("a"), share=1)
    executor.close()


def test_two_commands_that_share_a_folder_have_logs_of_their_own(work, tmp_path):
    (tmp_path / "logs").mkdir()
    other = tmp_path / "logs" / "worker-0.log"
    other.write_text("of another command\n")
    work("processes", [unit("k", "killed", times=1)], workers=1)
    logs = sorted(f.name for f in (tmp_path / "logs").iterdir())
    assert logs == ["worker-0.log"]  # what says nothing leaves nothing
    assert other.read_text() == "of another command\n"
    ending, _, _ = work("processes", [unit("p", "killed")], workers=1)
    [log] = {f.name for f in (tmp_path / "logs").iterdir()} - {"worker-0.log"}
    assert log.endswith(f"-{os.getpid()}-0.log")
    assert "last words" in ending.aside[0][1][0].log


def test_logs_do_not_become_more_and_more(work, tmp_path, monkeypatch):
    monkeypatch.setattr("enfilade.executors.processes.MOST_LOGS", 3)
    (tmp_path / "logs").mkdir()
    for age in range(5):
        log = tmp_path / "logs" / f"worker-host-{age}-0.log"
        log.write_text("x")
        os.utime(log, (1e9 - age, 1e9 - age))
    work("processes", [unit("p", "killed")], workers=1)
    logs = {f.name for f in (tmp_path / "logs").iterdir()}
    assert len(logs) == 3
    assert {"worker-host-0-0.log", "worker-host-1-0.log"} < logs


def test_who_has_failed_is_not_asked_again(work):
    units = [unit("r", "raises", times=1), unit("a", needs=("r",)), unit("b", needs=("a",))]
    work("processes", units, workers=1)
    pids = [(work.folder / f"{n}.tries").read_text().split()[1::2] for n in "rab"]
    assert pids[0][0] != pids[0][1]  # its device or its libraries may be in disorder
    assert pids[0][1:] == pids[1] == pids[2]


SUPERVISOR = """
import sys, time
from pathlib import Path
from enfilade.executors import Recipe, Unit
from enfilade.executors.processes import Processes
folder = Path(sys.argv[1])
recipe = Recipe("toy_worker:open_toy", {"folder": str(folder)})
executor = Processes(recipe, print, workers=1, logs=folder / "logs")
executor.begin(0, Unit("h", "hangs", {"name": "h"}), share=1)
print(executor.pids[0], flush=True)
time.sleep(600)
"""


def test_workers_go_with_a_supervisor_that_is_killed(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    line = [sys.executable, "-c", SUPERVISOR, str(tmp_path)]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as supervisor:  # noqa: S603
        assert supervisor.stdout is not None
        pid = int(supervisor.stdout.readline())
        while not (tmp_path / "h.tries").exists():
            time.sleep(0.01)
        supervisor.kill()
    deadline = time.monotonic() + 30.0
    while Path(f"/proc/{pid}").exists() and not is_dead(pid):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def is_dead(pid):
    # In a container nobody may be there to bury it.
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"


def test_unknown_executors_are_refused(tmp_path):
    with pytest.raises(
        SettingsError, match=r"'threads'; choose one of in-process, processes, ray, ray:ADDRESS"
    ):
        open_executor("threads", Recipe(""), nothing, workers=1, logs=tmp_path)
