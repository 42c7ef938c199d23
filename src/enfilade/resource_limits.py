"""Limits that a child process sets for itself, and causes of its end."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys

MB = 1 << 20
PR_SET_PDEATHSIG = 1  # prctl(2): the signal for this process when its parent dies
OUT_OF_MEMORY = (  # in messages of Python, C++, Linux and Dr.Jit; the last one while it records a kernel
    *("memoryerror", "bad_alloc", "cannot allocate memory", "failed to map segment"),
    "out of memory",
    "tried to free the allocation cache",
)


def die_with(parent: int) -> None:
    """End with the process of this number, or at once if that is no longer the parent.

    The kernel signals the end of the thread that started this process, which must live as long.
    """
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before
        sys.exit(1)


def limit_memory(megabytes: int) -> None:
    """Bound the address space, below any limit already set, and write no core file."""
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    most = megabytes * MB if hard == resource.RLIM_INFINITY else min(megabytes * MB, hard)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def is_out_of_memory(message: str) -> bool:
    """Whether a message tells of too little memory."""
    return any(words in message.lower() for words in OUT_OF_MEMORY)


def cause_of_end(code: int) -> str:
    """The end of a child process in words, by its exit code."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"was killed by signal {-code}"
