"""The processor that runs the kernels: the CPU through LLVM, or an NVIDIA GPU through CUDA.

The choice is made once in a process, before the first kernel: Dr.Jit binds its array types at import.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from enfilade.errors import DeviceError

LLVM_MINIMUM = 17  # older ones abort inside the compiler: they lack "fmaximum", or fail on some kernels
INSTALL_LLVM = "install it with: sudo apt-get install libllvm19 (any LLVM from 17 on will do)"
INSTALL_LIBRARIES = "the library that it misses is most likely had by: sudo apt-get install libatomic1"

# Dr.Jit's C++ interface to the processor that LLVM compiles for; the Python interface has none.
CPU_NAME = "_Z19jit_llvm_target_cpuv"
CPU_FEATURES = "_Z24jit_llvm_target_featuresv"
VECTOR_WIDTH = "_Z21jit_llvm_vector_widthv"
SET_TARGET = "_Z19jit_llvm_set_targetPKcS0_j"
FAST_GATHER = b"+fast-gather"

NO_GPU = "no usable NVIDIA GPU on this machine"
NO_OPTIX = (
    "the NVIDIA driver's library for ray tracing, {}, is not here; in a container, "
    "NVIDIA_DRIVER_CAPABILITIES=all brings it, else a newer driver"
)

Choice = Literal["auto", "cpu", "gpu"]


@dataclass(frozen=True)
class Device:
    """The backend that runs the kernels.

    Attributes
    ----------
    backend : {"llvm", "cuda"}
        Dr.Jit's name of it.
    variant : str
        Mitsuba's name of the matching variant.
    note : str
        Reason why a GPU that is present is not used; empty otherwise.
    """

    backend: Literal["llvm", "cuda"]
    variant: str
    note: str = ""


def activate(choice: Choice = "auto") -> Device:
    """Make Dr.Jit's automatic array types those of the chosen device.

    Parameters
    ----------
    choice
        ``"cpu"``, ``"gpu"``, or ``"auto"``: that of this process, if its arrays are bound already; else the
        GPU where there is one that can trace rays.

    Raises
    ------
    DeviceError
        Dr.Jit can't be loaded, LLVM is missing or too old, or a GPU was asked for and there is none; the
        arrays of this process are bound to another device.
    """
    if bound := _bound():
        if choice not in ("auto", bound):
            raise DeviceError(
                f"the arrays of this process are bound to the {bound.upper()}; start a new process for the "
                f"{choice.upper()}"
            )
        return active()
    if choice == "cpu":
        with _hidden_gpus():
            dr, device = load(), _llvm()
    else:
        dr = load()
        reason = why_no_gpu(dr)
        if reason and choice == "gpu":
            raise DeviceError(f"{reason}; run with --device cpu or auto")
        if reason:
            device = replace(_llvm(), note="" if reason == NO_GPU else reason)
        else:
            device = Device("cuda", "cuda_ad_rgb")
    dr.set_backend(device.backend)
    return device


def _bound() -> str:
    """Device to which the arrays of this process are bound; empty before the first import of them."""
    arrays = sys.modules.get("enfilade.arrays")
    if arrays is None:
        return ""
    dr = load()
    return "gpu" if dr.backend_v(arrays.Float) == dr.JitBackend.CUDA else "cpu"


def why_no_gpu(dr: Any) -> str:
    """Reason why Dr.Jit can't trace rays on a GPU here; empty where it can."""
    if not dr.has_backend(dr.JitBackend.CUDA):
        return NO_GPU
    library = os.environ.get("DRJIT_LIBOPTIX_PATH", "libnvoptix.so.1")
    try:
        ctypes.CDLL(library)
    except OSError:
        return NO_OPTIX.format(library)
    return ""


@contextmanager
def _hidden_gpus() -> Iterator[None]:
    """Keep Dr.Jit, which looks for all backends at its start, off the GPUs: it would take memory of each.

    Processes that are begun later see them.
    """
    name = "CUDA_VISIBLE_DEVICES"
    before = os.environ.get(name)
    is_started = "drjit" in sys.modules
    if not is_started:
        os.environ[name] = ""
    try:
        yield
    finally:
        if not is_started:
            del os.environ[name]
            if before is not None:
                os.environ[name] = before


def load() -> Any:
    """Dr.Jit's module.

    Raises
    ------
    DeviceError
        It can't be loaded: a system library is missing.
    """
    try:
        import drjit
    except (ImportError, NameError) as error:  # Dr.Jit 1.5 stumbles over its own ImportError: a NameError
        reason = error.__context__ if isinstance(error, NameError) else error
        raise DeviceError(f"Dr.Jit can't be loaded ({reason}); {INSTALL_LIBRARIES}") from error
    return drjit


def active() -> Device:
    """The device that Dr.Jit's automatic array types stand for now.

    Raises
    ------
    DeviceError
        Neither LLVM nor CUDA is usable here.
    """
    import drjit as dr

    if dr.has_backend(dr.JitBackend.CUDA):
        from drjit.auto.ad import Float

        if dr.backend_v(Float) == dr.JitBackend.CUDA:
            return Device("cuda", "cuda_ad_rgb")
    return _llvm()


def _llvm() -> Device:
    import drjit as dr

    if not dr.has_backend(dr.JitBackend.LLVM):
        raise DeviceError(f"LLVM's library was not found on this machine, or is far too old; {INSTALL_LLVM}")
    version = tuple(dr.detail.llvm_version())
    if version[0] < LLVM_MINIMUM:
        found = ".".join(map(str, version))
        raise DeviceError(f"LLVM {found} is too old, {LLVM_MINIMUM} is needed; {INSTALL_LLVM}")
    _use_gather_instructions(Path(dr.__file__).with_name("libdrjit-core.so"))
    return Device("llvm", "llvm_ad_rgb")


def _use_gather_instructions(library: Path) -> None:
    """Have LLVM compile gathers to gather instructions wherever the processor has these.

    LLVM takes those of AMD processors without AVX-512 for slow, and branches for each lane instead: kernels
    took 2.6 times as long to compile (49 s in place of 19 s for a test with 155 of them), and a walkthrough
    13 % more CPU time. Where Dr.Jit lacks the interface, that is the only loss.
    """
    core = ctypes.CDLL(str(library))
    try:
        name, features, width, set_target = (
            core[CPU_NAME],
            core[CPU_FEATURES],
            core[VECTOR_WIDTH],
            core[SET_TARGET],
        )
    except AttributeError:
        return
    name.restype = features.restype = ctypes.c_char_p
    set_target.argtypes, set_target.restype = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_uint32], None
    enabled: bytes = features() or b""
    if b"+avx2" in enabled and b"+avx512f" not in enabled and FAST_GATHER not in enabled:
        set_target(name(), enabled + b"," + FAST_GATHER, width())
