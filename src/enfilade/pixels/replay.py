"""Kernels that are recorded once and replayed.

Tracing one through all materials of a scene takes longer than running it on a frame's lanes.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import drjit as dr

__all__ = ["recorded"]


def recorded(kernel: Callable[..., Any], state: Callable[[], Any]) -> Callable[..., Any]:
    """A kernel that is traced when it is first called with arguments of some form, and replayed afterwards.

    Parameters
    ----------
    kernel
        Takes and returns trees of Dr.Jit arrays; what is no array counts as part of the form.
    state
        Tells all other arrays that the kernel reads.
    """
    frozen = dr.freeze(kernel, auto_opaque=False, state_fn=lambda *_: state())

    def replayed(*arguments: Any) -> Any:
        # Garbage that shares NumPy's memory can't be let go while a kernel is recorded.
        had_collector = gc.isenabled()
        gc.disable()
        try:
            return frozen(*arguments)
        finally:
            if had_collector:
                gc.enable()

    return replayed
