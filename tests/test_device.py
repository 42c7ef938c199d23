"""The choice of a device, and that nothing heavy is loaded before it."""

import subprocess
import sys

import drjit as dr
import pytest

from enfilade.device import activate
from enfilade.errors import DeviceError

HEAVY = ("mitsuba", "drjit", "matplotlib", "av", "OpenEXR", "trimesh", "shapely", "PyOpenColorIO")


@pytest.mark.parametrize(
    "module", ["enfilade", "enfilade.settings", "enfilade.records", "enfilade.device", "enfilade.path"]
)
def test_the_lower_floors_load_nothing_heavy(module):
    code = f"import sys, {module}; print(*(m for m in {HEAVY} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.split() == []


def pretend(monkeypatch, *, llvm, cuda=False, version=(19, 1, 7)):
    has = {dr.JitBackend.LLVM: llvm, dr.JitBackend.CUDA: cuda}
    monkeypatch.setattr(dr, "has_backend", has.__getitem__)
    monkeypatch.setattr(dr.detail, "llvm_version", lambda: version)
    monkeypatch.setattr(dr.detail, "cuda_version", lambda: (12, 8))
    chosen = []
    monkeypatch.setattr(dr, "set_backend", chosen.append)
    return chosen


@pytest.mark.parametrize("version", [(14, 0, 6), (15, 0, 7)])
def test_an_old_llvm_is_refused_with_the_way_out(monkeypatch, version):
    chosen = pretend(monkeypatch, llvm=True, version=version)
    with pytest.raises(
        DeviceError, match=rf"LLVM {'.'.join(map(str, version))} is too old, 16 is needed; .* apt-get"
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
    assert activate("cpu").version == (19, 1, 7)
    assert chosen == ["cuda", "cuda", "llvm"]
