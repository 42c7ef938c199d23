"""Blender in a process of its own: bounded memory and time, progress, and the message of a failure."""

from __future__ import annotations

import json
import os
import queue
import re
import resource
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from enfilade.errors import SceneError
from enfilade.files import scratch_folder
from enfilade.monitor import Monitor
from enfilade.resource_limits import cause_of_end
from enfilade.scene.blender.find import SCRIPT, Blender
from enfilade.settings import LimitSettings

RESULT_FILE, CYCLES_FILE = (
    "import.json",
    "cycles.json",
)  # of the tasks, written last in the job's folder `out`
ERROR_FILE = "error.json"
PROGRESS = re.compile(r"^progress: ([01](?:\.\d+)?)(?: (.*))?$")
STEPS = 100  # of a progress bar
TASKS = {"export": ("import", RESULT_FILE), "cycles": ("Cycles", CYCLES_FILE)}  # name in progress, result
ENDING_S = 20.0  # that a process has after its result: bpy may hang at its end
LOOK_S = 0.25
TAIL = 8  # lines of output in the message of a crash
LONGEST_LINE = 4096


def run_job(blender: Blender, job: Mapping[str, Any], limits: LimitSettings, monitor: Monitor) -> None:
    """Run a job of the importer; its result is in the job's folder ``out``.

    The process ends with this one. It has a home folder of its own, which is removed (after SIGKILL, by the
    next job), and no variables of the environment but the search paths and the language.

    Parameters
    ----------
    blender
    job
        Written as JSON for the script. ``task``, ``source`` and ``out`` count here.
    limits
    monitor

    Raises
    ------
    SceneError
        The script refused the file; or Blender crashed, or took too much memory or time.
    """
    out, about = Path(job["out"]), f"{job['source']} by Blender {blender.version}"
    name, result = TASKS[job["task"]]
    answers = (out / result, out / ERROR_FILE)
    with scratch_folder("enfilade-blender") as home:
        job_file = home / "job.json"
        job_file.write_text(json.dumps(job), encoding="utf-8")
        own = [sys.executable, "-P", "-m", "enfilade.scene.blender.launcher"]
        line = [*own, str(os.getpid()), str(limits.import_mb), str(home), *blender.command(SCRIPT, job_file)]
        # No `with`: at its end it closes the pipe, which waits for the reader while another process holds it.
        process = subprocess.Popen(  # noqa: S603
            line, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            start_new_session=True,
        )  # fmt: skip
        try:
            last, is_late = _follow(process, answers, limits.import_s, monitor, name)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    if answers[1].is_file():
        raise SceneError(_refusal(answers[1], about, str(job["source"])))
    if answers[0].is_file():
        return
    if is_late:
        raise SceneError(
            f"{about}: not finished in {limits.import_s:g} s; raise --set limits.import_s, or reduce the file"
        )
    raise SceneError(_crash(about, process.returncode, limits.import_mb, last))


def cpu_of_children_s() -> float:
    """CPU time of all processes that this one started and that have ended, seconds."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def _follow(
    process: subprocess.Popen[bytes], answers: Sequence[Path], seconds: float, monitor: Monitor, name: str
) -> tuple[list[str], bool]:
    """Show progress until the process ends or must end; returns its last lines, and whether it is late."""
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(process.stdout, lines), daemon=True).start()
    last: deque[str] = deque(maxlen=TAIL)
    deadline, has_result = time.monotonic() + seconds, False
    while time.monotonic() < deadline:
        try:
            line: str | None = lines.get(timeout=LOOK_S)
        except queue.Empty:
            line = "" if process.poll() is None else None  # a process that it left may hold the pipe
        if not has_result and any(file.exists() for file in answers):
            has_result, deadline = True, time.monotonic() + ENDING_S
        if line is None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(deadline - time.monotonic(), LOOK_S))
            break
        if found := PROGRESS.match(line):
            monitor.progress(name, min(int(STEPS * float(found[1])), STEPS), STEPS)
        elif line.strip():
            last.append(line)
    is_late = not has_result and process.poll() is None
    return list(last), is_late


def _read(stream: IO[bytes] | None, lines: queue.SimpleQueue[str | None]) -> None:
    """Pass lines on, close the stream, then pass None on; longer lines come in parts."""
    if stream is not None:
        with stream:
            while line := stream.readline(LONGEST_LINE):
                lines.put(printable(line.decode(errors="replace").rstrip()))
    lines.put(None)


def printable(text: str) -> str:
    """Text of a stranger's file, without control characters: a terminal obeys them."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)


def _refusal(file: Path, about: str, source: str) -> str:
    """The message of an error file; a place that is the source is not named twice."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        what, where, remedy = (printable(str(found[key])) for key in ("what", "where", "do"))
    except (OSError, ValueError, LookupError, TypeError) as error:
        return f"{about}: it failed, and {file.name} is damaged ({error})"
    return (
        f"{about}: {what}"
        + (f" ({where})" if where not in ("", source) else "")
        + (f"; {remedy}" if remedy else "")
    )


def _crash(about: str, code: int, megabytes: int, last: list[str]) -> str:
    said = "".join(f"\n  {line}" for line in last)
    return (
        f"{about}: it {cause_of_end(code)}, without a result. The file is damaged, needs more than "
        f"{megabytes} MB of memory (--set limits.import_mb), or has something that the importer does not know"
        f"{'. The last lines:' if said else ''}{said}"
    )
