"""On what a bench was run: processor, memory, versions."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path
from typing import Any

from enfilade import __version__
from enfilade.pipeline.versions import installed

__all__ = ["machine", "versions"]

PACKAGES = ("mitsuba", "drjit", "numpy", "av", "OpenEXR", "pyoidn", "flip-evaluator", "cvvdp")


def machine() -> dict[str, Any]:
    """Processor, its cores that this process may use, memory in GiB, system."""
    return {
        "processor": _line("/proc/cpuinfo", r"model name\s*:\s*(.+)")
        or platform.processor()
        or platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
    }


def versions() -> dict[str, str]:
    """Versions of what renders, encodes and judges; without what is not installed."""
    return {"enfilade": __version__, **installed(PACKAGES)}


def _line(file: str, pattern: str) -> str:
    path = Path(file)
    match = re.search(pattern, path.read_text(encoding="utf-8", errors="replace")) if path.is_file() else None
    return match[1].strip() if match else ""
