"""How many workers a machine has room for: cores, quotas of containers, GPUs."""

import os
from types import SimpleNamespace

import pytest

from enfilade.executors import open_executor, resources
from toy_worker import nothing, unit


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


def test_without_a_quota_all_cores_are_there(machine):
    assert resources.cores() == 16
    machine.write("max 100000\n", "job", "step", "cpu.max")
    assert resources.cores() == 16


def test_the_least_quota_on_the_way_holds(machine):
    machine.write("1200000 100000\n", "job", "step", "cpu.max")
    assert resources.cores() == 12
    machine.write("450000 100000\n", "job", "cpu.max")
    assert resources.cores() == 4
    machine.write("50000 100000\n", "cpu.max")
    assert resources.cores() == 1


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
    [
        (None, ["0", "1"]),
        ("3,1", ["3", "1"]),
        ("GPU-a, GPU-b", ["GPU-a", "GPU-b"]),
        ("", []),
        ("1,-1,2", ["1"]),
    ],
)
def test_gpus(machine, monkeypatch, named, found):
    if named is not None:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", named)
    assert resources.gpus() == found


def test_as_many_workers_as_there_is_room_for(machine, toys, tmp_path):
    def slots(workers=None, **spec):
        recipe = toys(**spec)
        return open_executor("processes", recipe, nothing, workers=workers, logs=tmp_path / "logs").slots

    machine.write("600000 100000\n", "cpu.max")
    assert slots(device="llvm") == 6
    assert slots(device="cuda") == 2
    assert slots(workers=5, device="cuda") == 5


@pytest.mark.parametrize(("asked", "given"), [({}, 3), ({"threads": 0}, 3), ({"threads": 5}, 5)])
def test_workers_share_the_cores_that_there_are(machine, toys, tmp_path, asked, given):
    machine.write("600000 100000\n", "cpu.max")
    executor = open_executor("processes", toys(**asked), nothing, workers=2, logs=tmp_path / "logs")
    assert executor._recipe.threads == given


def test_each_worker_sees_a_gpu_of_its_own(machine, work):
    work("processes", [unit(name, seconds=0.3) for name in "abcd"], device="cuda")
    seen = {(work.folder / f"{name}.gpu").read_text() for name in "abcd"}
    assert seen == {"0", "1"}


@pytest.mark.parametrize(
    ("text", "count"),
    [("pgfault 12\noom_kill 7\n", 7), ("pgfault 12\n", 0), ("", 0), ("oom_kill\n", 0), (None, 0)],
)
def test_what_the_kernel_killed_for_its_memory(tmp_path, monkeypatch, text, count):
    monkeypatch.setattr(resources, "COUNTS", tmp_path / "vmstat")
    if text is not None:
        (tmp_path / "vmstat").write_text(text)
    assert resources.oom_kills() == count
