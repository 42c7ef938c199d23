"""Processes of contestants: what they are charged, and how they end."""

import multiprocessing
import pickle
import sys

import pytest

from bench_tasks import HELD_MIB, SPIN_S, Dies, Fails, Holds, Spins
from enfilade.device import Device
from enfilade.errors import EnfiladeError, SceneError
from enfilade.monitor import Silence
from studies.bench.race import _run, race


def test_cpu_time_is_charged_by_stage_and_sleep_is_none(tmp_path):
    spent = race(Spins(), tmp_path / "run", tmp_path / "notes", Silence())
    cpu_s, wall_s = spent.stages["frames"]
    assert cpu_s == pytest.approx(2 * SPIN_S, abs=0.1)
    assert wall_s > cpu_s + 0.9 * SPIN_S
    assert spent.stages["video"][0] == pytest.approx(2 * SPIN_S, abs=0.1)
    assert spent.stages["start"][0] > SPIN_S  # it warmed up
    assert spent.cpu_s == cpu_s
    # Another session adds to it.
    both = race(Spins(), tmp_path / "run", tmp_path / "notes", Silence())
    assert both.sessions == 2
    assert both.cpu_s == pytest.approx(4 * SPIN_S, abs=0.2)


def test_memory_is_that_of_the_process_alone(tmp_path):
    least = race(Spins(), tmp_path / "run", tmp_path / "a", Silence()).peak_bytes
    most = race(Holds(), tmp_path / "run", tmp_path / "b", Silence()).peak_bytes
    assert (most - least) / 2**20 == pytest.approx(HELD_MIB, abs=30)


def test_one_that_dies_is_an_error_and_not_a_wait(tmp_path):
    with pytest.raises(EnfiladeError, match="ended before its work"):
        race(Dies(), tmp_path / "run", tmp_path / "notes", Silence())


def test_an_error_of_ours_comes_through(tmp_path):
    with pytest.raises(SceneError, match="no such scene"):
        race(Fails(), tmp_path / "run", tmp_path / "notes", Silence())


def test_a_gpu_that_is_not_taken_is_told(tmp_path, monkeypatch):
    module = sys.modules[race.__module__]
    monkeypatch.setattr(module, "activate", lambda _: Device("llvm", "llvm_ad_rgb", (15,), "no OptiX"))
    monkeypatch.setattr(module.signal, "signal", lambda *_: None)  # this process still hears ^C
    ours, theirs = multiprocessing.Pipe(duplex=False)
    _run(theirs, "auto", pickle.dumps(Spins()), tmp_path / "run")
    kind, arguments, _ = ours.recv()
    assert (kind, *arguments) == ("say", "rendered on the CPU: no OptiX")
