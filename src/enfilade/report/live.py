"""A report that follows a running run, for browsers of this machine alone.

It listens on the loopback interface, answers only who knows the token in its address, and makes the page
anew when the ledger has grown.
"""

from __future__ import annotations

import hmac
import json
import secrets
import tempfile
import threading
import time
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from enfilade.errors import EnfiladeError
from enfilade.monitor import Silence
from enfilade.report.page import Wishes, write_page

__all__ = ["Live"]

LOOPBACK = "127.0.0.1"
TOKEN_BYTES = 32
LEAST_S = 3.0  # between two pages
LEDGER = "ledger.jsonl"

FOLLOWER = """<!doctype html><html lang="en"><meta charset="utf-8"><title>enfilade: a run</title>
<style>html,body,iframe{margin:0;width:100%;height:100%;border:0;display:block}
p{position:fixed;bottom:0;right:0;margin:0;padding:.2em .6em;font:13px sans-serif}
p{background:#0008;color:#fff}</style>
<iframe src="page" title="report"></iframe><p hidden></p>
<script>
const frame = document.querySelector("iframe"), note = document.querySelector("p");
let seen = null;
async function look() {
  try {
    const state = await (await fetch("state", {cache: "no-store"})).json();
    note.hidden = !state.problem;
    note.textContent = state.problem;
    if (seen !== null && state.version !== seen) frame.src = "page?" + state.version;
    seen = state.version;
  } catch (error) {
    note.hidden = false;
    note.textContent = "enfilade no longer answers";
  }
}
setInterval(look, 2000);
look();
</script></html>"""


class Live:
    """A server of a run's report; used as a context, it serves until the end of it.

    Parameters
    ----------
    folder
        The run.
    wishes
        What the page shall hold.
    port
        0: any that is free.

    Attributes
    ----------
    address : str
        With the token: who knows it sees the report.

    Raises
    ------
    OSError
        The port is taken.
    """

    def __init__(self, folder: Path, wishes: Wishes, port: int = 0) -> None:
        self._token = secrets.token_urlsafe(TOKEN_BYTES)
        self._pages = _Pages(folder, wishes)
        self._server = ThreadingHTTPServer((LOOPBACK, port), partial(_Handler, self._find))
        self._server.daemon_threads = True
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
    """The page as it was made last, made anew when the ledger has grown."""

    def __init__(self, folder: Path, wishes: Wishes) -> None:
        self._ledger = folder / LEDGER
        self._folder = folder
        self._wishes = wishes
        self._lock = threading.Lock()
        self._made_s = -LEAST_S
        self._version = -1
        self._page = b""
        self._problem = ""

    def find(self, name: str) -> tuple[str, bytes] | None:
        """Kind and content of a page by its name; None if there is none."""
        match name:
            case "":
                return "text/html", FOLLOWER.encode()
            case "page":
                with self._lock:
                    self._renew()
                    return "text/html", self._page or self._problem.encode()
            case "state":
                with self._lock:
                    self._renew()
                    state = {"version": self._version, "problem": self._problem}
                return "application/json", json.dumps(state).encode()
        return None

    def _renew(self) -> None:
        version = self._ledger.stat().st_size if self._ledger.exists() else 0
        if version == self._version or time.monotonic() - self._made_s < LEAST_S:
            return
        with tempfile.TemporaryDirectory(prefix="enfilade-") as place:
            file = Path(place) / "report.html"
            try:
                write_page(self._folder, file, self._wishes, Silence())
                self._page, self._problem = file.read_bytes(), ""
            except EnfiladeError as error:
                self._problem = str(error)
        self._version, self._made_s = version, time.monotonic()
