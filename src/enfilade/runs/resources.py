"""Resources of this machine for workers: usable cores and GPUs, and kills for lack of memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

OWN = Path("/proc/self/cgroup")
TREE = Path("/sys/fs/cgroup")
DEVICES = Path("/dev")
COUNTS = Path("/proc/vmstat")


def cores() -> int:
    """CPU cores that this process may use: those it may run on, or fewer where its container has a quota."""
    allowed = len(os.sched_getaffinity(0))
    return max(int(min([allowed, *_quotas()])), 1)


def gpus() -> list[str]:
    """NVIDIA GPUs that this process may use, as ``CUDA_VISIBLE_DEVICES`` names them."""
    named = os.environ.get("CUDA_VISIBLE_DEVICES")
    if named is not None:
        return list(takewhile(lambda name: name not in ("", "-1"), map(str.strip, named.split(","))))
    return [str(number) for number, _ in enumerate(DEVICES.glob("nvidia[0-9]*"))]


def oom_kills() -> int:
    """Number of processes killed by the kernel for lack of memory since boot; 0 where it does not tell."""
    try:
        counts = dict(line.split(" ", 1) for line in COUNTS.read_text().splitlines())
        return int(counts.get("oom_kill", 0))
    except (OSError, ValueError):
        return 0


def _quotas() -> Iterator[float]:
    """CPUs that each control group allows in which this process is, of version 1 and 2."""
    try:
        lines = OWN.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        root = TREE / "cpu" if controllers else TREE
        # In a container the path may be the host's, which isn't to be seen: the root is the container's own.
        folder = root.joinpath(*(part for part in path.split("/") if part not in ("", "..")))
        for place in (folder, *folder.parents):
            yield from _quota(place, has_two_files=bool(controllers))
            if place == root:
                break


def _quota(group: Path, *, has_two_files: bool) -> Iterator[float]:
    try:
        if has_two_files:
            text = f"{(group / 'cpu.cfs_quota_us').read_text()} {(group / 'cpu.cfs_period_us').read_text()}"
        else:
            text = (group / "cpu.max").read_text()
        quota, period = text.split()
        if quota not in ("max", "-1"):
            yield int(quota) / int(period)
    except (OSError, ValueError, ZeroDivisionError):  # no such group, or none that limits anything
        return
