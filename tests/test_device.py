"""The choice of a device, and that nothing heavy is loaded before it."""

import ctypes
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import drjit as dr
import pytest

import enfilade
from enfilade.device import (
    CPU_FEATURES,
    CPU_NAME,
    SET_TARGET,
    VECTOR_WIDTH,
    _use_gather_instructions,
    activate,
)
from enfilade.errors import DeviceError, RunFolderError
from enfilade.installation import examine

HEAVY = ("mitsuba", "drjit", "matplotlib", "av", "OpenEXR", "scipy", "PyOpenColorIO")


@pytest.mark.parametrize(
    "module", ["enfilade", "enfilade.settings", "enfilade.device", "enfilade.camera", "enfilade.cli"]
)
def test_the_lower_layers_load_nothing_heavy(module):
    code = f"import sys, {module}; print(*(m for m in {HEAVY} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.split() == []


@pytest.mark.parametrize("module", ["enfilade.images", "enfilade.comparison", "enfilade.kernels.tone"])
def test_what_needs_no_device_loads_no_dr_jit(module):
    code = f"import sys, {module}; print('drjit' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.split() == ["False"]


def pretend(monkeypatch, *, llvm, cuda=False, optix=True, version=(19, 1, 7)):
    own = ctypes.CDLL

    def library(name):
        if not optix and "drjit" not in name:
            raise OSError(f"{name}: cannot open shared object file")
        return own(name) if "drjit" in name else None

    monkeypatch.setattr(ctypes, "CDLL", library)
    has = {dr.JitBackend.LLVM: llvm, dr.JitBackend.CUDA: cuda}
    monkeypatch.setattr(dr, "has_backend", has.__getitem__)
    monkeypatch.setattr(dr.detail, "llvm_version", lambda: version)
    monkeypatch.setattr(dr.detail, "cuda_version", lambda: (12, 8))
    monkeypatch.delitem(sys.modules, "enfilade.arrays", raising=False)  # which is bound to a device
    chosen = []
    monkeypatch.setattr(dr, "set_backend", chosen.append)
    return chosen


@pytest.mark.parametrize("version", [(14, 0, 6), (15, 0, 7), (16, 0, 6)])
def test_an_old_llvm_is_refused_with_the_way_out(monkeypatch, version):
    chosen = pretend(monkeypatch, llvm=True, version=version)
    with pytest.raises(
        DeviceError, match=rf"LLVM {'.'.join(map(str, version))} is too old, 17 is needed; .* apt-get"
    ):
        activate("cpu")
    assert chosen == []


def test_a_missing_llvm_is_named_with_the_way_out(monkeypatch):
    pretend(monkeypatch, llvm=False)
    with pytest.raises(DeviceError, match=r"not found .* apt-get install"):
        activate("auto")


def test_a_missing_gpu_is_named_only_when_asked_for(monkeypatch):
    chosen = pretend(monkeypatch, llvm=True)
    with pytest.raises(DeviceError, match="no usable NVIDIA GPU"):
        activate("gpu")
    assert activate("auto").variant == "llvm_ad_rgb"
    assert chosen == ["llvm"]


def test_a_gpu_is_taken_unless_the_cpu_is_asked_for(monkeypatch):
    chosen = pretend(monkeypatch, llvm=True, cuda=True)
    assert activate("auto").variant == activate("gpu").variant == "cuda_ad_rgb"
    assert activate("cpu").variant == "llvm_ad_rgb"
    assert chosen == ["cuda", "cuda", "llvm"]


def test_a_gpu_that_can_not_trace_rays_is_not_taken(monkeypatch):
    chosen = pretend(monkeypatch, llvm=True, cuda=True, optix=False)
    device = activate("auto")
    assert device.variant == "llvm_ad_rgb"
    assert "libnvoptix" in device.note
    assert activate("cpu").note == ""
    with pytest.raises(DeviceError, match=r"libnvoptix.*NVIDIA_DRIVER_CAPABILITIES=all.*--device cpu"):
        activate("gpu")
    assert chosen == ["llvm", "llvm"]
    gpu = next(check for check in examine() if check.name == "NVIDIA GPU")
    assert not gpu.is_ok
    assert not gpu.is_required


def test_a_process_has_one_device(monkeypatch, tmp_path):
    import_module("enfilade.reports.page")  # with the arrays of this process
    chosen = pretend(monkeypatch, llvm=True, cuda=True)
    monkeypatch.setattr("enfilade.device.active", lambda: "that of the arrays")
    for kind, own, other in ((dr.llvm, "cpu", "GPU"), (dr.cuda, "gpu", "CPU")):
        monkeypatch.setitem(sys.modules, "enfilade.arrays", SimpleNamespace(Float=kind.ad.Float))
        assert activate("auto") == activate(own) == "that of the arrays"
        with pytest.raises(DeviceError, match=f"start a new process for the {other}"):
            activate(other.lower())
        with pytest.raises(RunFolderError):  # a report takes the device that there is
            enfilade.report(tmp_path)
    assert chosen == []


class Core(dict):
    """Dr.Jit's C++ interface as ``ctypes`` shows it."""

    def __getitem__(self, name):
        if name not in self:
            raise AttributeError(f"undefined symbol: {name}")
        return super().__getitem__(name)


@pytest.mark.parametrize(
    ("features", "has_interface", "expected"),
    [
        (b"+avx,+avx2", True, b"+avx,+avx2,+fast-gather"),
        (b"+avx2,+fast-gather", True, None),
        (b"+avx2,+avx512f", True, None),
        (b"+avx", True, None),
        (b"+avx,+avx2", False, None),
    ],
)
def test_the_target_changes_only_where_gathers_would_be_branches(
    monkeypatch, features, has_interface, expected
):
    targets = []
    values = {CPU_NAME: b"znver3", CPU_FEATURES: features, VECTOR_WIDTH: 8}
    core = Core({name: Mock(return_value=value) for name, value in values.items()})
    if has_interface:
        core[SET_TARGET] = Mock(side_effect=lambda *target: targets.append(target))
    monkeypatch.setattr(ctypes, "CDLL", lambda _: core)
    _use_gather_instructions(Path("libdrjit-core.so"))
    assert targets == ([(b"znver3", expected, 8)] if expected else [])


def test_gathers_of_avx2_are_compiled_to_instructions():
    code = """
import ctypes
from enfilade import device
device.activate("cpu")
device.active()  # a second time
import drjit
core = ctypes.CDLL(f"{drjit.__path__[0]}/libdrjit-core.so")
features = core[device.CPU_FEATURES]
features.restype = ctypes.c_char_p
print(features().decode(), core[device.VECTOR_WIDTH]())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    features, width = done.stdout.split()
    if "+avx512f" in features:
        assert int(width) == 16
    elif "+avx2" in features:
        assert (features.count("+fast-gather"), int(width)) == (1, 8)
    else:
        assert "fast-gather" not in features.replace("-fast-gather", "")


@pytest.mark.parametrize("before", [None, "1,3"])
def test_a_run_on_the_cpu_keeps_off_the_gpus_and_its_children_need_not(before):
    code = """
import builtins, os
from enfilade.device import activate
own = builtins.__import__
def spy(name, *rest, **more):
    if name == "drjit":
        print("seen", os.environ.get("CUDA_VISIBLE_DEVICES"))
    return own(name, *rest, **more)
builtins.__import__ = spy
activate("cpu")
builtins.__import__ = own
print("after", os.environ.get("CUDA_VISIBLE_DEVICES"))
"""
    variables = {k: v for k, v in os.environ.items() if k != "CUDA_VISIBLE_DEVICES"}
    variables |= {} if before is None else {"CUDA_VISIBLE_DEVICES": before}
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=variables
    )
    lines = done.stdout.splitlines()
    assert lines[0] == "seen "
    assert lines[-1] == f"after {before}"
