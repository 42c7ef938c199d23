"""A scene is loaded by a process of its own first, with bounded memory and time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

from enfilade.confined import die_with, limit_memory
from enfilade.errors import SceneError
from enfilade.settings import LimitSettings, Settings, TraceSettings

__all__ = ["check_reading", "try_scene"]

REFUSED = 3  # exit code of a trial whose renderer said no
UNLIT = 4  # ... and of one whose scene was loaded, but can't be asked for light


def try_scene(scene: Path, trace: TraceSettings, limits: LimitSettings, variant: str) -> str:
    """Let another process load a Mitsuba scene. It ends with this one.

    Parameters
    ----------
    scene
    trace
        With which the scene will be rendered.
    limits
        Memory and time.
    variant
        Mitsuba's.

    Returns
    -------
    str
        See :meth:`enfilade.renderer.LobeRenderer.why_inseparable`.

    Raises
    ------
    SceneError
        It crashed, took too long, or Mitsuba refused the scene, or read it otherwise than it was checked.
    """
    table = json.dumps(Settings(trace=trace).to_tables()["trace"])
    line = [sys.executable, "-P", "-m", "enfilade.scene.trial"]
    line += [str(scene), table, str(limits.trial_mb), variant, str(os.getpid()), str(limits.trial_s)]
    try:
        done = subprocess.run(  # noqa: S603
            line, capture_output=True, text=True, errors="replace", check=False, timeout=limits.trial_s
        )
    except subprocess.TimeoutExpired as error:
        raise _too_slow(scene, limits) from error
    if done.returncode == -signal.SIGALRM:
        raise _too_slow(scene, limits)
    if done.returncode == REFUSED:
        raise SceneError(done.stdout.strip())
    if done.returncode == UNLIT:
        return done.stdout.strip()
    if done.returncode:
        raise SceneError(
            f"{scene} was too much for the process that tried to load it (exit code {done.returncode}, "
            f"{limits.trial_mb} MB of memory): it is damaged, or needs more --limits-trial-mb"
        )
    return ""


def check_reading(scene: Path) -> None:
    """Let Mitsuba parse a scene, and compare with what was checked: this is the second line of defence.

    Raises
    ------
    SceneError
        Mitsuba refuses the scene, or finds plugins, files or strings in it that
        :class:`~enfilade.scene.scenefile.SceneFile` does not.
    """
    from enfilade.scene.mitsuba.parsed import parsed_demands
    from enfilade.scene.scenefile import SceneFile, as_loaded

    unseen: list[str] = []
    for file in as_loaded(scene):
        ours, theirs = SceneFile(file).demands(), parsed_demands(file)
        unseen += map(str, theirs.files - ours.files)
        unseen += [f"the plugin {name!r}" for name in theirs.plugins - ours.plugins]
        unseen += [f"{name}={value!r}" for name, value in theirs.strings - ours.strings]
    if unseen:
        raise SceneError(
            f"Mitsuba reads {scene} otherwise than it was checked: it finds {min(unseen)}. Write that "
            "without parameters or includes, and report this: it is a defect of enfilade"
        )


def _too_slow(scene: Path, limits: LimitSettings) -> SceneError:
    return SceneError(
        f"{scene} was not loaded in {limits.trial_s:g} s by a process of its own; raise --limits-trial-s"
    )


def _load(scene: str, trace: str, megabytes: int, variant: str) -> int:
    from enfilade.device import activate

    is_gpu = variant.startswith("cuda")
    activate("gpu" if is_gpu else "cpu")
    from enfilade.scene.mitsuba import MitsubaRenderer

    if not is_gpu:  # CUDA maps all of the GPU's memory
        limit_memory(megabytes)
    try:
        check_reading(Path(scene))
        why_inseparable = MitsubaRenderer(
            Path(scene), TraceSettings.from_table(json.loads(trace))
        ).why_inseparable
    except SceneError as error:
        sys.stdout.write(str(error))
        return REFUSED
    sys.stdout.write(why_inseparable)
    return UNLIT if why_inseparable else 0


def _main(scene: str, trace: str, megabytes: int, variant: str, parent: int, seconds: float) -> int:
    die_with(parent)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # which ends the process, also if its parent is stopped
    signal.setitimer(signal.ITIMER_REAL, seconds)
    return _load(scene, trace, megabytes, variant)


if __name__ == "__main__":
    sys.exit(
        _main(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4], int(sys.argv[5]), float(sys.argv[6]))
    )
