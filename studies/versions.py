"""Date, versions and hardware of a measurement."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from enfilade import __version__

PACKAGES = ("mitsuba", "drjit", "numpy", "av", "OpenEXR", "pyoidn", "flip-evaluator", "cvvdp")
ROOT = Path(__file__).parents[1]


def origin() -> dict[str, str]:
    """``date`` (UTC), version of ``enfilade``, and git ``commit`` of this checkout or an empty string."""
    git = shutil.which("git")
    commit = ""
    if git is not None:
        line = [git, "-C", str(ROOT), "describe", "--always", "--dirty"]
        commit = subprocess.run(line, capture_output=True, text=True, check=False).stdout.strip()  # noqa: S603
    return {"date": datetime.now(UTC).date().isoformat(), "enfilade": __version__, "commit": commit}


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, memory in GiB, system, version of Python."""
    info = Path("/proc/cpuinfo")
    match = re.search(r"model name\s*:\s*(.+)", info.read_text()) if info.is_file() else None
    return {
        "processor": match[1] if match else platform.processor() or platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
    }


def package_versions() -> dict[str, str]:
    """Versions of the installed packages that render, encode and measure."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
