"""Preflight: a scene is loaded once by a child process with bounded memory and time, before a run begins."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from enfilade.errors import SceneError
from enfilade.resource_limits import cause_of_end, die_with, is_out_of_memory, limit_memory
from enfilade.settings import LimitSettings, Settings, TraceSettings

STARVED = (-signal.SIGKILL, -signal.SIGSEGV)  # exit codes of processes that may have lacked memory
WORD = re.compile(r"[^\W\d_]{2}")


@dataclass(frozen=True)
class Preflight:
    """What is known of a scene before it is rendered.

    Attributes
    ----------
    why_inseparable : str
        See :meth:`enfilade.renderer.LobeRenderer.why_inseparable`; empty where it is not known.
    notes : list of str
        See :attr:`enfilade.renderer.SceneDescription.notes`.
    """

    why_inseparable: str = ""
    notes: list[str] = field(default_factory=list)


def preflight(scene: Path, trace: TraceSettings, limits: LimitSettings, variant: str) -> Preflight:
    """Check a Mitsuba scene, and load it, in a child process, which ends with this one.

    Parameters
    ----------
    scene
    trace
        With which the scene will be rendered.
    limits
        Memory, seconds and folders.
    variant
        Of Mitsuba. The memory of a GPU is not bounded.

    Returns
    -------
    Preflight

    Raises
    ------
    SceneError
        The scene is refused, or the child crashed, or took too much memory or time.
    """
    tables = Settings(trace, limits).to_tables((TraceSettings, LimitSettings))
    line = [sys.executable, "-P", "-m", __name__, str(scene), json.dumps(tables), variant, str(os.getpid())]
    try:
        done = subprocess.run(  # noqa: S603
            line, capture_output=True, text=True, errors="replace", check=False, timeout=limits.preflight_s
        )
        is_late = done.returncode == -signal.SIGALRM
    except subprocess.TimeoutExpired:
        is_late = True
    if is_late:
        raise SceneError(
            f"{scene} was not loaded in {limits.preflight_s:g} s by the preflight process; raise "
            "--set limits.preflight_s"
        )
    if done.returncode:
        is_gpu = variant.startswith("cuda")
        bound = f"{limits.preflight_mb} MB of memory (--set limits.preflight_mb)"
        raise SceneError(f"{scene}: {_end(done, 'the memory of the GPU' if is_gpu else bound)}")
    answer = json.loads(done.stdout)
    if error := answer.pop("error"):
        raise SceneError(error)
    return Preflight(**answer)


def _end(child: subprocess.CompletedProcess[str], bound: str) -> str:
    """The sentence about a process that crashed; `bound` is the memory that it had."""
    *_, last = ("", *(line.strip() for line in child.stderr.splitlines() if WORD.search(line)))
    end = f"the preflight process {cause_of_end(child.returncode)}{last and ': '}{last}"
    if child.returncode in STARVED or is_out_of_memory(child.stderr):
        return f"{end}; the scene is damaged, or needs more than {bound}"
    return f"{end}; Mitsuba can't render the scene, or enfilade has a defect: please report it"


def _main(scene: Path, tables: str, variant: str, parent: int) -> None:
    die_with(parent)
    out = os.dup(1)
    os.dup2(2, 1)  # whatever a plugin prints is not the answer
    settings = Settings.from_tables(json.loads(tables))
    signal.setitimer(signal.ITIMER_REAL, settings[LimitSettings].preflight_s)  # for a parent that is stopped
    is_gpu = variant.startswith("cuda")
    from enfilade.device import activate

    activate("gpu" if is_gpu else "cpu")
    import enfilade.scene.mitsuba.renderer  # noqa: F401  (before the limit: LLVM hangs if it can't be loaded)
    from enfilade.renderer import why_inseparable
    from enfilade.scene.opener import Scene

    if not is_gpu:  # CUDA maps the memory of the GPU into the address space
        limit_memory(settings[LimitSettings].preflight_mb)
    answer: dict[str, Any] = {"error": ""}
    try:
        Scene(scene).check(settings[LimitSettings])
        renderer = Scene(scene).open(settings)
        answer |= asdict(Preflight(why_inseparable(renderer), list(renderer.describe().notes)))
    except SceneError as error:
        answer["error"] = str(error)
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        if is_out_of_memory(text):
            raise
        answer["error"] = f"{scene} was not loaded: {text}; this is a defect of enfilade: please report it"
    os.write(out, json.dumps(answer).encode())


if __name__ == "__main__":
    _main(Path(sys.argv[1]), sys.argv[2], sys.argv[3], int(sys.argv[4]))
