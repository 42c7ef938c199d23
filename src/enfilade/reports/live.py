"""A report that follows a running run, for browsers of this machine alone.

It listens on the loopback interface, answers only who knows the token in its address, and makes the page
anew when more is finished, or when someone begins or ends to work on the run.
"""

from __future__ import annotations

import hmac
import json
import secrets
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any, Self

from enfilade.errors import EnfiladeError
from enfilade.monitor import Monitor, Silence
from enfilade.reports.alive import silence
from enfilade.reports.page import Wishes, write_page
from enfilade.store.checksum import size_of
from enfilade.store.identity import LEDGER_FILE
from enfilade.store.lock import writers_of
from enfilade.store.run import PARTS

__all__ = ["Live"]

LOOPBACK = "127.0.0.1"
TOKEN_BYTES = 32
LEAST_S = 3.0  # between two pages
REST = 10.0  # times as long as a page took, until the next one: the run needs the processor

FOLLOWER = """<!doctype html><html lang="en"><meta charset="utf-8"><title>enfilade: a run</title>
<style>html,body,iframe{margin:0;width:100%;height:100%;border:0;display:block}
p{position:fixed;bottom:0;right:0;margin:0;padding:.2em .6em;font:13px sans-serif}
p{background:#0008;color:#fff}</style>
<iframe src="page?VERSION" title="report"></iframe><p hidden></p>
<script>
const frame = document.querySelector("iframe"), note = document.querySelector("p");
let seen = VERSION;
async function look() {
  try {
    const state = await (await fetch("state", {cache: "no-store"})).json();
    note.hidden = !state.problem;
    note.textContent = state.problem;
    if (state.version !== seen) frame.src = "page?" + state.version;
    seen = state.version;
  } catch (error) {
    note.hidden = false;
    note.textContent = "enfilade no longer answers";
  }
  setTimeout(look, 2000);
}
look();
</script></html>"""


class Live:
    """A server of a run's report; used as a context, it serves until the end of it.

    The first page is made at once: what is no run, and wishes that can't be met, are refused before anybody
    is told of an address.

    Parameters
    ----------
    folder
        The run.
    wishes
        What the page shall hold.
    port
        0: any that is free.
    monitor
        Watches the first page being made; None: nobody.

    Attributes
    ----------
    address : str
        With the token: who knows it sees the report.

    Raises
    ------
    OSError
        The port is taken.
    RunFolderError, SettingsError
        As by :func:`~enfilade.reports.page.write_page`.
    """

    def __init__(
        self, folder: Path, wishes: Wishes, port: int = 0, *, monitor: Monitor | None = None
    ) -> None:
        self._token = secrets.token_urlsafe(TOKEN_BYTES)
        self._server = ThreadingHTTPServer((LOOPBACK, port), partial(_Handler, self._find))
        self._server.daemon_threads = True
        try:
            self._pages = _Pages(folder, wishes, monitor or Silence())
        except BaseException:
            self._server.server_close()
            raise
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self.address = f"http://{LOOPBACK}:{self._server.server_port}/{self._token}/"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def wait(self) -> None:
        """Serve until this process is interrupted."""
        while self._thread.is_alive():
            self._thread.join(1.0)

    def _find(self, address: str) -> tuple[str, bytes] | None:
        given, _, rest = address.lstrip("/").partition("/")
        if not hmac.compare_digest(given.encode(), self._token.encode()):
            return None
        return self._pages.find(rest.partition("?")[0])


class _Handler(BaseHTTPRequestHandler):
    """Answers GET, to those who came by the loopback's own name: other names lead here by trickery."""

    protocol_version = "HTTP/1.1"
    timeout = 30.0

    def __init__(self, find: Callable[[str], tuple[str, bytes] | None], *connection: Any) -> None:
        self._find = find
        super().__init__(*connection)

    def do_GET(self) -> None:
        _, port = self.request.getsockname()
        hosts = (f"{LOOPBACK}:{port}", f"localhost:{port}")
        found = self._find(self.path) if self.headers.get("Host") in hosts else None
        kind, body = found or ("text/plain", b"nothing here\n")
        self.send_response(HTTPStatus.OK if found else HTTPStatus.NOT_FOUND)
        for name, value in (
            ("Content-Type", f"{kind}; charset=utf-8"),
            ("Content-Length", str(len(body))),
            ("Cache-Control", "no-store"),
            ("Referrer-Policy", "no-referrer"),
            ("X-Content-Type-Options", "nosniff"),
            ("X-Frame-Options", "SAMEORIGIN"),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002  (its name in http.server)
        """Say nothing: addresses hold the token."""


class _Pages:
    """The page as it was made last, made anew when the run has gone on."""

    def __init__(self, folder: Path, wishes: Wishes, monitor: Monitor) -> None:
        self._folder = folder
        self._wishes = wishes
        self._lock = threading.Lock()
        self._page, self._version, self._problem = b"", 0, ""
        self._progress: _Progress | None = None
        self._took_s = self._ended_s = 0.0
        self._make(monitor)

    def find(self, name: str) -> tuple[str, bytes] | None:
        """Kind and content of a page by its name; None if there is none."""
        match name:
            case "":
                return "text/html", FOLLOWER.replace("VERSION", str(self._version)).encode()
            case "page":
                return "text/html", self._page
            case "state":
                self._renew()
                state = {"version": self._version, "problem": self._problem}
                return "application/json", json.dumps(state).encode()
        return None

    def _renew(self) -> None:
        if not self._lock.acquire(blocking=False):  # another request does it; meanwhile the last page stands
            return
        try:
            self._renew_if_due()
        except OSError as error:  # of this machine, and not of the run: it is tried again, which may help
            self._problem = f"the page can't be renewed: {error}"
            self._progress, self._ended_s = None, monotonic()
        finally:
            self._lock.release()

    def _renew_if_due(self) -> None:
        progress = _progress(self._folder)
        # When nobody works any more, the last page need not wait: there is no run whose processor it takes.
        rest_s = max(LEAST_S, REST * self._took_s) if progress.writers else LEAST_S
        if progress == self._progress or monotonic() - self._ended_s < rest_s:
            return
        try:
            self._make(Silence())
            self._problem = ""
        except EnfiladeError as error:
            self._problem = str(error)
            self._progress, self._ended_s = progress, monotonic()

    def _make(self, monitor: Monitor) -> None:
        progress, began_s = _progress(self._folder), monotonic()
        with tempfile.TemporaryDirectory(prefix="enfilade-") as place:
            file = Path(place) / "report.html"
            write_page(self._folder, file, self._wishes, monitor)
            self._page = file.read_bytes()
        self._version += 1
        self._progress, self._ended_s = progress, monotonic()
        self._took_s = self._ended_s - began_s


@dataclass(frozen=True)
class _Progress:
    """How far a run has come, without reading it: sizes of ledgers by name, who writes, and their silence."""

    sizes: dict[str, int | None]
    writers: list[dict[str, Any]]
    silence: int


def _progress(folder: Path) -> _Progress:
    ledgers = (folder / LEDGER_FILE, *sorted((folder / PARTS).glob("*.jsonl")))
    writers = writers_of(folder)
    sizes = {file.name: size_of(file) for file in ledgers}
    return _Progress(sizes, writers, silence(folder, writers))
