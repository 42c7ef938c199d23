"""A worker process: takes units as lines of JSON from its supervisor, and reports in the same way."""

from __future__ import annotations

import json
import signal
import socket
import sys
import traceback
from typing import Any

from enfilade.executors.executor import Failure, Recipe, Worker
from enfilade.resource_limits import die_with


def main() -> None:
    """Serve the supervisor at the other end of the socket whose number is the first argument."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ^C is for the supervisor, who decides
    die_with(int(sys.argv[2]))
    with socket.socket(fileno=int(sys.argv[1])) as line, line.makefile("rb") as told:
        recipe = Recipe(**json.loads(told.readline()))
        server = _Server(recipe, line)
        for text in told:
            server.serve(json.loads(text))


class _Server:
    def __init__(self, recipe: Recipe, line: socket.socket) -> None:
        self._recipe = recipe
        self._line = line
        self._worker: Worker | None = None
        self._share = 1

    def serve(self, order: dict[str, Any]) -> None:
        try:
            if self._worker is None or order["share"] != self._share:
                self._worker, self._share = None, order["share"]
                self._worker = self._recipe.make(self._tell, share=self._share)
            self._worker(order["kind"], order["facts"])
        except Exception as error:  # noqa: BLE001  (the supervisor decides what becomes of it)
            self._worker = None
            self._tell("failed", Failure.of(error, traceback.format_exc()).to_json())
        else:
            self._tell("done", None)

    def _tell(self, what: str, value: Any) -> None:
        self._line.sendall(json.dumps([what, value]).encode() + b"\n")


if __name__ == "__main__":
    main()
