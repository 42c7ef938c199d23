"""Check of an installation: requirements found, the variant that will run, and remedies for missing parts."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

from enfilade import __version__
from enfilade.device import INSTALL_LLVM, LLVM_MINIMUM, NO_GPU, Choice, activate, load, why_no_gpu
from enfilade.errors import DeviceError, SceneError
from enfilade.scene.blender.find import SCRIPT, find_blender

EXTRA = re.compile(r"extra == ['\"](.+?)['\"]")  # in a marker


@dataclass(frozen=True)
class Check:
    """One check.

    Attributes
    ----------
    name
        What was looked for.
    found
        Its version or description; empty where there is none.
    is_required
        Whether nothing can be rendered without it.
    remedy
        How to get it; empty where it is there.
    """

    name: str
    found: str
    is_required: bool = True
    remedy: str = ""

    @property
    def is_ok(self) -> bool:
        """Whether there is nothing to do about it."""
        return not self.remedy

    def to_dict(self) -> dict[str, Any]:
        """Fields and `is_ok`, for JSON."""
        return {**asdict(self), "is_ok": self.is_ok}


def examine(choice: Choice = "auto") -> list[Check]:
    """Look at everything that a run uses.

    Parameters
    ----------
    choice
        The device that a run would ask for.
    """
    cores = f"{len(os.sched_getaffinity(0))} CPU cores"
    checks = [
        Check("enfilade", __version__),
        Check("python", f"{platform.python_version()} on {platform.system()} {platform.machine()}, {cores}"),
        *_packages(),
    ]
    if all(c.is_ok for c in checks if c.name in ("drjit", "mitsuba")):
        checks += _devices(choice)
    if all(c.is_ok for c in checks if c.name == "av"):
        checks += _codecs()
    return [*checks, _blender()]


def _packages() -> Iterator[Check]:
    for requirement in map(Requirement, importlib.metadata.requires("enfilade") or []):
        extra = next(iter(EXTRA.findall(str(requirement.marker))), None)
        wanted = f"{requirement.name}{requirement.specifier}"
        try:
            found = importlib.metadata.version(requirement.name)
        except importlib.metadata.PackageNotFoundError:
            found = ""
        is_right = bool(found) and requirement.specifier.contains(found, prereleases=True)
        name = f"{requirement.name} (extra {extra})" if extra else requirement.name
        yield Check(name, found, extra is None, "" if is_right else f"pip install '{wanted}'")


def _devices(choice: Choice) -> Iterator[Check]:
    try:
        dr = load()
    except DeviceError as error:
        yield Check("system libraries", "", True, str(error))
        return
    yield _llvm(dr)
    yield _gpu(dr)
    yield _variant(choice)


def _llvm(dr: Any) -> Check:
    name = f"LLVM {LLVM_MINIMUM} or newer"
    is_needed = bool(why_no_gpu(dr))
    if not dr.has_backend(dr.JitBackend.LLVM):
        return Check(name, "", is_needed, INSTALL_LLVM)
    version = tuple(dr.detail.llvm_version())
    found = ".".join(map(str, version)) + _library_file("libLLVM")
    return Check(name, found, is_needed, "" if version[0] >= LLVM_MINIMUM else INSTALL_LLVM)


def _gpu(dr: Any) -> Check:
    reason = why_no_gpu(dr)
    if reason == NO_GPU:
        return Check("NVIDIA GPU", "", False, "only --device gpu needs one, with its driver")
    version = ".".join(map(str, dr.detail.cuda_version()))
    return Check("NVIDIA GPU", f"CUDA {version}", False, reason)


def _variant(choice: Choice) -> Check:
    import mitsuba as mi

    name = f"variant for --device {choice}"
    try:
        variant = activate(choice).variant
    except DeviceError as error:
        return Check(name, "", True, str(error))
    if variant not in mi.variants():
        return Check(name, variant, True, "this build of Mitsuba lacks the variant: pip install mitsuba")
    return Check(name, variant)


def _codecs() -> Iterator[Check]:
    from av.codec import codecs_available

    from enfilade.images.codecs import CODECS

    for name, codec in CODECS.items():
        is_there = codec.encoder in codecs_available
        remedy = "" if is_there else "pip install --force-reinstall --only-binary :all: av"
        yield Check(f"codec {name}", codec.encoder if is_there else "", name == "h264", remedy)


def _blender() -> Check:
    """Blender, which only files of its own and of other formats need."""
    try:
        found = find_blender()
    except SceneError as error:
        return Check("Blender", "", False, str(error))
    form = "module bpy, " if found.is_module else ""
    told = "; ".join(filter(None, (f"{found.version}, {form}{found.program}", found.note)))
    missing = "" if SCRIPT.is_file() else f"its scripts are missing ({SCRIPT}): pip install . once more"
    return Check("Blender", told, False, missing)


def _library_file(stem: str) -> str:
    """Path of a loaded library, ``", /usr/lib/..."``; empty where the system doesn't tell."""
    maps = Path("/proc/self/maps")
    if not maps.exists():
        return ""
    files = {line.split(maxsplit=5)[-1] for line in maps.read_text().splitlines() if stem in line}
    return "".join(f", {file}" for file in sorted(files))
