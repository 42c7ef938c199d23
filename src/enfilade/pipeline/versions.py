"""Which code makes a run's bytes: ours, by a checksum of its source, and the libraries'."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import enfilade
from enfilade.device import active

__all__ = ["code_digest", "installed", "makers"]

DIGITS = 12  # of a checksum
# They show and judge what was made.
SHOWING = ("cli", "judges", "report", "studies")
LIBRARIES = ("drjit", "numpy", "scipy", "OpenEXR", "av")  # the renderer and what is optional names itself


def makers() -> dict[str, str]:
    """Versions of all that any run's bytes depend on, but for its renderer.

    Between releases the version stays and the code does not: ``code`` is a checksum of the package without
    what only shows and judges.

    Raises
    ------
    DeviceError
        No usable LLVM or CUDA.
    """
    device = active()
    compiler = f"{device.backend.upper()} {'.'.join(map(str, device.version))}"
    return {
        "enfilade": enfilade.__version__,
        "code": code_digest(besides=SHOWING),
        "compiler": compiler,
        **installed(LIBRARIES),
    }


def installed(packages: Iterable[str]) -> dict[str, str]:
    """Versions of packages; without those that are not installed."""
    found = {}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


@cache
def code_digest(*, besides: tuple[str, ...] = ()) -> str:
    """Checksum of the package's source, the first digits.

    Parameters
    ----------
    besides
        Folders of the package that don't count.
    """
    source = Path(enfilade.__file__).parent
    whole = hashlib.sha256()
    for file in sorted(source.rglob("*.py")):
        place = file.relative_to(source)
        if place.parts[0] not in besides:
            whole.update(f"{place.as_posix()}\n".encode() + file.read_bytes())
    return whole.hexdigest()[:DIGITS]
