"""The process that decodes a sequence for :class:`~enfilade.video.fence.FencedSequence`."""

from __future__ import annotations

import ctypes
import errno
import os
import resource
import signal
import socket
import sys
from collections.abc import Iterator
from typing import Any

from enfilade.errors import InputError
from enfilade.records import F32
from enfilade.video.fence import MB, receive, send
from enfilade.video.sequence import Sequence, open_sequence

PR_SET_PDEATHSIG = 1  # prctl(2): a signal for this process when its parent dies


class _Decoder:
    """Opens one sequence and answers questions about it."""

    def __init__(self) -> None:
        self._sequence: Sequence
        self._frames: Iterator[F32]

    def answer(self, what: str, value: Any) -> tuple[Any, dict[str, Any]]:
        match what:
            case "open":
                return self._open(value), {}
            case "rewind":
                self._frames = iter(self._sequence)
                return None, {}
            case "next":
                frame = next(self._frames, None)
                return None, {} if frame is None else {"frame": frame}
            case "name":
                return self._sequence.name(value), {}
            case "layers":
                return None, self._sequence.layers(value)
        raise ValueError(what)

    def _open(self, source: str) -> dict[str, Any]:
        self._sequence = found = open_sequence(source)
        return {
            "width": found.width,
            "height": found.height,
            "fps": found.fps,
            "exposure_ev": found.exposure_ev,
            "count": len(found),
        }


def _serve(line: socket.socket, seconds: float) -> None:
    decoder = _Decoder()
    while True:
        try:
            (what, value), _ = receive(line, most_bytes=0)
        except (EOFError, ConnectionError):
            return
        signal.setitimer(signal.ITIMER_REAL, seconds)  # SIGALRM ends the process
        try:
            answer, pixels = decoder.answer(what, value)
        except MemoryError:
            sys.exit(1)
        except InputError as error:
            if _is_out_of_memory(error.__cause__):
                sys.exit(1)
            head, pixels = {"error": type(error).__name__, "text": str(error)}, {}
        else:
            head = {"value": answer}
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        try:
            send(line, head, pixels)
        except ConnectionError:
            return


def _is_out_of_memory(error: BaseException | None) -> bool:
    return isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM


def _main(handle: int, parent: int, megabytes: int, seconds: float) -> None:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before
        sys.exit(1)
    most = megabytes * MB
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with socket.socket(fileno=handle) as line:
        _serve(line, seconds)


if __name__ == "__main__":
    _main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
