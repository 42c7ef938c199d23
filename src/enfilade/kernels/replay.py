"""Frozen kernels: recorded once and replayed (``drjit.freeze``).

Tracing a kernel through all materials of a scene takes longer than running it on the lanes of a frame.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import drjit as dr

from enfilade.arrays import UInt, opaque

# Numbers of lanes are rounded up to a multiple of this. A number that happens to be the size of an array of
# the scene would be another signature, and record the kernel again.
STEP = 1021


def recorded(kernel: Callable[..., Any], state: Callable[[], Any]) -> Callable[..., Any]:
    """Freeze a kernel: it is traced at the first call with arguments of a signature, and replayed afterwards.

    Parameters
    ----------
    kernel
        Takes and returns trees of Dr.Jit arrays; all other values in them are part of the signature.
    state
        Returns all other arrays that the kernel reads.
    """
    frozen = dr.freeze(kernel, auto_opaque=False, state_fn=lambda *_: state())

    def replayed(*arguments: Any) -> Any:
        # Memory shared with NumPy can't be freed while a kernel is recorded: collect no garbage.
        had_collector = gc.isenabled()
        gc.disable()
        try:
            return frozen(*arguments)
        finally:
            if had_collector:
                gc.enable()

    return replayed


def padded(lanes: Any) -> tuple[Any, Any]:
    """A list of lanes for a frozen kernel: the last one repeated up to a multiple of :data:`STEP`.

    Parameters
    ----------
    lanes : UInt

    Returns
    -------
    lanes : UInt
    is_real : Bool
        False for the repetitions.
    """
    count = dr.width(lanes)
    if count == 1:  # gathering from a single lane would be another kernel
        lanes = UInt([lanes[0]] * 2)
    index = dr.arange(UInt, -(-count // STEP) * STEP)
    return dr.gather(UInt, lanes, dr.minimum(index, opaque(count - 1))), index < opaque(count)
