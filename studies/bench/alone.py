"""A function in a new process: its imports are light, since the device is chosen after them."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any

from enfilade.device import Choice, activate
from enfilade.errors import EnfiladeError
from enfilade.resource_limits import die_with


def alone(device: Choice, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Call a function in a new process, which ends with this one.

    The device is chosen before the arguments are unpickled: Dr.Jit's array types bind to it at import.
    """
    context = get_context("spawn")
    with ProcessPoolExecutor(
        1, mp_context=context, initializer=_begin, initargs=(os.getpid(), device)
    ) as pool:
        try:
            return pool.submit(function, *arguments, **options).result()
        except BrokenProcessPool as error:
            raise EnfiladeError(
                "a process of the bench was killed, perhaps for lack of memory; the same command continues"
            ) from error


def _begin(parent: int, device: Choice) -> None:
    die_with(parent)
    activate(device)
