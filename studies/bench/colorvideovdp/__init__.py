"""ColorVideoVDP (Mantiuk et al. 2024) in a Python environment of its own, which `make judge` sets up."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.comparison.measures.colorvideovdp import BLACK_LEAST_CD_M2
from enfilade.errors import EnfiladeError
from enfilade.viewing import Viewing

HERE = Path(__file__).resolve().parent
ENVIRONMENT = HERE.parents[2] / ".venv-judge"

Image: TypeAlias = npt.NDArray[np.float16]
Pair: TypeAlias = tuple[Image, Image]


def why_missing() -> str:
    """Reason why ColorVideoVDP is not available, with the remedy; empty where it is."""
    return (
        "" if (ENVIRONMENT / ".ready").is_file() else "ColorVideoVDP is left out; set it up with: make judge"
    )


def version() -> str:
    """Version of its environment; empty where it is missing."""
    file = ENVIRONMENT / ".ready"
    return file.read_text(encoding="utf-8").strip() if file.is_file() else ""


def predict_jod(sequences: Sequence[Sequence[Pair]], viewing: Viewing) -> list[float]:
    """ColorVideoVDP of sequences of one size and length, on one thread.

    Parameters
    ----------
    sequences
        Frames of each sequence in order: test and reference, (H, W, 3) float16, sRGB-encoded, 0..1.
    viewing
        Viewing conditions.

    Returns
    -------
    list of float
        JOD of each sequence, 10 where no difference is seen.

    Raises
    ------
    EnfiladeError
        Its process failed; the message has its last words.
    """
    tests = np.stack([[test for test, _ in pairs] for pairs in sequences])
    references = np.stack([[reference for _, reference in pairs] for pairs in sequences])
    with tempfile.TemporaryDirectory(prefix="enfilade-") as scratch:
        file = Path(scratch) / "pairs.npz"
        np.savez(
            file,
            test=tests,
            reference=references,
            fps=viewing.fps,
            ppd=viewing.pixels_per_degree,
            peak_cd_m2=viewing.peak_cd_m2,
            contrast=viewing.peak_cd_m2 / max(viewing.black_cd_m2, BLACK_LEAST_CD_M2),
        )
        command = [
            str(ENVIRONMENT / "bin" / "python"),
            "-I",
            "-W",
            "ignore",
            str(HERE / "predict.py"),
            str(file),
        ]
        limits = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, **limits}
        )
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or ["no message"]
        raise EnfiladeError(f"ColorVideoVDP failed: {last[0]}; set it up again with: make judge")
    scores: list[float] = json.loads(done.stdout.splitlines()[-1])
    return scores
