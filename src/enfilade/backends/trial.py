"""A scene is loaded by a process of its own first, with bounded memory and time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from enfilade.confined import limit_memory
from enfilade.errors import SceneError
from enfilade.settings import LimitSettings, TraceSettings

__all__ = ["try_scene"]

REFUSED = 3  # exit code of a trial whose renderer said no


def try_scene(scene: Path, limits: LimitSettings, variant: str) -> None:
    """Let another process load a Mitsuba scene.

    Parameters
    ----------
    scene
    limits
        Memory and time.
    variant
        Mitsuba's.

    Raises
    ------
    SceneError
        It crashed, took too long, or Mitsuba refused the scene.
    """
    line = [sys.executable, "-P", "-m", "enfilade.backends.trial", str(scene), str(limits.trial_mb), variant]
    try:
        done = subprocess.run(  # noqa: S603
            line, capture_output=True, text=True, errors="replace", check=False, timeout=limits.trial_s
        )
    except subprocess.TimeoutExpired as error:
        raise SceneError(
            f"{scene} was not loaded in {limits.trial_s:g} s by a process of its own; raise --limits-trial-s"
        ) from error
    if done.returncode == REFUSED:
        raise SceneError(done.stdout.strip())
    if done.returncode:
        raise SceneError(
            f"{scene} was too much for the process that tried to load it (exit code {done.returncode}, "
            f"{limits.trial_mb} MB of memory): it is damaged, or needs more --limits-trial-mb"
        )


def _load(scene: str, megabytes: int, variant: str) -> int:
    from enfilade.device import activate

    is_gpu = variant.startswith("cuda")
    activate("gpu" if is_gpu else "cpu")
    from enfilade.backends.mitsuba3 import MitsubaRenderer

    if not is_gpu:  # CUDA maps all of the GPU's memory
        limit_memory(megabytes)
    try:
        MitsubaRenderer(Path(scene), TraceSettings())
    except SceneError as error:
        sys.stdout.write(str(error))
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(_load(sys.argv[1], int(sys.argv[2]), sys.argv[3]))
