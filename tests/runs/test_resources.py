"""Cores, quotas of containers, GPUs, and processes that the kernel killed."""

from __future__ import annotations

import os
from types import SimpleNamespace

import pytest

from enfilade.runs import resources


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A machine of 16 cores, two GPUs and the control groups that a test writes."""
    own, tree, devices = tmp_path / "own", tmp_path / "tree", tmp_path / "dev"
    devices.mkdir()
    for name in ("nvidia0", "nvidia3", "nvidiactl", "nvidia-uvm", "null"):
        (devices / name).touch()
    own.write_text("0::/job/step\n")
    for name, value in {"OWN": own, "TREE": tree, "DEVICES": devices}.items():
        monkeypatch.setattr(resources, name, value)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(16)))
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)

    def write(text, *place):
        file = tree.joinpath(*place)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    return SimpleNamespace(own=own, write=write)


def test_the_smallest_quota_of_all_groups_counts(machine):
    assert resources.cores() == 16
    for text, place, cores in (
        ("max 100000\n", ("job", "step"), 16),
        ("1200000 100000\n", ("job", "step"), 12),
        ("450000 100000\n", ("job",), 4),
        ("50000 100000\n", (), 1),
    ):
        machine.write(text, *place, "cpu.max")
        assert resources.cores() == cores


def test_a_container_that_does_not_see_its_own_path_has_the_root(machine):
    machine.own.write_text("0::/../../elsewhere\n")
    machine.write("300000 100000\n", "cpu.max")
    assert resources.cores() == 3


def test_quotas_of_the_first_version(machine):
    machine.own.write_text("3:cpu,cpuacct:/job\n2:memory:/job\n0::/\n")
    machine.write("200000\n", "cpu", "job", "cpu.cfs_quota_us")
    machine.write("100000\n", "cpu", "job", "cpu.cfs_period_us")
    machine.write("-1\n", "cpu", "cpu.cfs_quota_us")
    machine.write("100000\n", "cpu", "cpu.cfs_period_us")
    assert resources.cores() == 2


@pytest.mark.parametrize(
    ("named", "found"),
    [(None, ["0", "1"]), ("3,1", ["3", "1"]), ("a, b", ["a", "b"]), ("", []), ("1,-1,2", ["1"])],
)
def test_gpus(machine, monkeypatch, named, found):
    if named is not None:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", named)
    assert resources.gpus() == found


@pytest.mark.parametrize(
    ("text", "count"),
    [("pgfault 12\noom_kill 7\n", 7), ("pgfault 12\n", 0), ("", 0), ("oom_kill\n", 0), (None, 0)],
)
def test_processes_that_the_kernel_killed_for_lack_of_memory(tmp_path, monkeypatch, text, count):
    monkeypatch.setattr(resources, "COUNTS", tmp_path / "vmstat")
    if text is not None:
        (tmp_path / "vmstat").write_text(text)
    assert resources.oom_kills() == count
