"""Kernels that are recorded once and replayed.

Tracing one through all materials of a scene takes longer than running it on a frame's lanes.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import drjit as dr

from enfilade.arrays import UInt, opaque

__all__ = ["padded", "recorded"]

# Lanes of a recorded kernel are a multiple of this: else they might be as many as some array of the scene
# has, which is another form of its arguments.
STEP = 1021


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


def padded(lanes: Any) -> tuple[Any, Any]:
    """Lanes of a list, the last repeated until they suit a recorded kernel, and which are no repetitions."""
    count = dr.width(lanes)
    if count == 1:  # gathering from a single lane would be another kernel
        lanes = UInt([lanes[0]] * 2)
    index = dr.arange(UInt, -(-count // STEP) * STEP)
    return dr.gather(UInt, lanes, dr.minimum(index, opaque(count - 1))), index < opaque(count)
