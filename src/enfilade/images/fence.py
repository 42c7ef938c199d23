"""A sequence that a process of its own decodes, with bounded memory and time: what comes from strangers.

Decoders are large C libraries. What crashes one, or takes all memory, ends that process; the command gets
an error. Frames come back over a socket as plain numbers.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import socket
import subprocess
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError, InputError, RunFolderError
from enfilade.records import F32
from enfilade.settings import LimitSettings

__all__ = ["FencedSequence", "receive", "send"]

MB = 1 << 20
SIZE_BYTES = 8  # of the number that says how long a message is
LONGEST_HEAD = 1 << 24  # bytes of a message but for its pixels: it may list the numbers of a million frames
DTYPES = ("float16", "float32", "uint32")  # of pixels
REFUSALS = {of.__name__: of for of in (InputError, ImageError, RunFolderError)}  # that come from there
PATIENCE_S = 1.0  # before the process is killed


class FencedSequence:
    """What :func:`~enfilade.images.open_sequence` opens, decoded by a process of its own.

    The process ends with the thread that made it.

    Parameters
    ----------
    source
        Whatever that reads.
    limits
        Memory of the process, and seconds for one frame.
    layer
        See there.

    Attributes
    ----------
    width, height : int
        Pixels.
    fps, exposure_ev : float or None
    numbers : tuple of int or None
    starts : frozenset of int or None
    note : str

    Raises
    ------
    ImageError
        The sequence can't be read, or was too much for the process that tried to.
    """

    def __init__(self, source: Path | str, limits: LimitSettings, *, layer: str | None = None) -> None:
        self._source = str(source)
        self._limits = limits
        self._line, there = socket.socketpair()
        options = [there.fileno(), os.getpid(), limits.preflight_mb, limits.preflight_s]
        module = "enfilade.images.child"
        with there:
            child = subprocess.Popen(  # noqa: S603
                [sys.executable, "-P", "-m", module, *map(str, options)],  # -P: no modules from here
                pass_fds=[there.fileno()],
                stdin=subprocess.DEVNULL,
                process_group=0,  # ^C is for the command, which closes the line
                stdout=subprocess.DEVNULL,
            )
        self._child = child
        self._end = weakref.finalize(self, _end, self._line, child)
        opened, _ = self._ask("open", [self._source, layer])
        self.width, self.height = int(opened["width"]), int(opened["height"])
        self.fps: float | None = opened["fps"]
        self.exposure_ev: float | None = opened["exposure_ev"]
        numbers, starts = opened["numbers"], opened["starts"]
        self.numbers: tuple[int, ...] | None = None if numbers is None else tuple(numbers)
        self.starts: frozenset[int] | None = None if starts is None else frozenset(starts)
        self.note = str(opened["note"])
        self._count = int(opened["count"])

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[F32]:
        """Frames as (H, W, 3) float32 linear Rec.709, in order; a second iteration ends the first."""
        self._ask("rewind")
        while frames := self._ask("next")[1]:
            yield frames["frame"]

    def name(self, index: int) -> str:
        """Name of a frame, for messages."""
        return str(self._ask("name", index)[0])

    def layers(self, index: int) -> dict[str, Any]:
        """All layers of an OpenEXR frame.

        Raises
        ------
        ImageError
            It is no OpenEXR file, or damaged.
        """
        return self._ask("layers", index)[1]

    def _ask(self, what: str, value: Any = None) -> tuple[Any, dict[str, Any]]:
        try:
            send(self._line, [what, value], {})
            answer, pixels = receive(self._line, most_bytes=self._limits.preflight_mb * MB)
        except (OSError, EOFError, ValueError, TypeError, RecursionError) as error:
            raise ImageError(self._ended()) from error
        if "error" in answer:
            raise REFUSALS.get(answer["error"], ImageError)(answer["text"])
        return answer["value"], pixels

    def _ended(self) -> str:
        """Why the process is no more."""
        self._end()
        code = self._child.returncode
        if code == -signal.SIGALRM:
            return (
                f"{self._source}: a frame was not decoded in {self._limits.preflight_s:g} s; raise "
                "--limits-preflight-s, or write it again in a simpler format"
            )
        return (
            f"{self._source} was too much for the process that decodes it (exit code {code}, "
            f"{self._limits.preflight_mb} MB of memory): it is damaged, or needs more --limits-preflight-mb"
        )


def _end(line: socket.socket, child: subprocess.Popen[bytes]) -> None:
    line.close()
    with contextlib.suppress(subprocess.TimeoutExpired):
        child.wait(timeout=PATIENCE_S)
    child.kill()
    child.wait()


def send(line: socket.socket, head: Any, pixels: dict[str, Any]) -> None:
    """Send a message: JSON, and arrays by name."""
    arrays = {name: np.ascontiguousarray(values) for name, values in pixels.items()}
    shapes = [[name, str(values.dtype), values.shape] for name, values in arrays.items()]
    data = json.dumps([head, shapes]).encode()
    line.sendall(len(data).to_bytes(SIZE_BYTES, "little") + data)
    for values in arrays.values():
        line.sendall(values.data.cast("B"))


def receive(line: socket.socket, *, most_bytes: int) -> tuple[Any, dict[str, Any]]:
    """Take what :func:`send` sends.

    Raises
    ------
    ValueError
        It is none, or announces arrays of more than so many bytes.
    OSError, EOFError
        The other side is gone.
    """
    length = int.from_bytes(_exactly(line, SIZE_BYTES), "little")
    if length > LONGEST_HEAD:
        raise ValueError(f"a head of {length} bytes")
    head, shapes = json.loads(_exactly(line, length))
    pixels = {}
    for name, dtype, shape in shapes:
        size = math.prod(shape) * np.dtype(dtype).itemsize if dtype in DTYPES else -1
        most_bytes -= size
        if size < 0 or most_bytes < 0:
            raise ValueError(f"{name} of {dtype} {shape}")
        pixels[name] = np.frombuffer(_exactly(line, size), dtype).reshape(shape)
    return head, pixels


def _exactly(line: socket.socket, size: int) -> bytearray:
    data = bytearray(size)
    view = memoryview(data)
    while view:
        got = line.recv_into(view)
        if not got:
            raise EOFError("the other side is gone")
        view = view[got:]
    return data
