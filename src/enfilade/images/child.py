"""The process that decodes a sequence for :class:`~enfilade.images.fence.FencedSequence`."""

from __future__ import annotations

import errno
import signal
import socket
import sys
from collections.abc import Iterator
from typing import Any

from enfilade.errors import InputError
from enfilade.images.fence import receive, send
from enfilade.images.sequence import Sequence, open_sequence
from enfilade.records import F32
from enfilade.resource_limits import die_with, limit_memory


class _Decoder:
    """Opens one sequence and answers questions about it."""

    def __init__(self) -> None:
        self._sequence: Sequence
        self._frames: Iterator[F32]

    def answer(self, what: str, value: Any) -> tuple[Any, dict[str, Any]]:
        match what:
            case "open":
                return self._open(*value), {}
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

    def _open(self, source: str, layer: str | None) -> dict[str, Any]:
        self._sequence = found = open_sequence(source, layer=layer)
        return {
            "width": found.width,
            "height": found.height,
            "fps": found.fps,
            "exposure_ev": found.exposure_ev,
            "numbers": found.numbers,
            "starts": None if found.starts is None else sorted(found.starts),
            "note": found.note,
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
    die_with(parent)
    limit_memory(megabytes)
    with socket.socket(fileno=handle) as line:
        _serve(line, seconds)


if __name__ == "__main__":
    _main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
