"""Mutated files of every kind end with an error of ours, within bounds of memory and time."""

import subprocess
import sys
from pathlib import Path

FUZZ = Path(__file__).parents[1] / "benchmarks" / "fuzz.py"


def test_mutated_files_crash_nothing():
    line = [sys.executable, str(FUZZ), "--count", "400"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout + done.stderr
    assert "400 mutated files, 0 failures" in done.stdout
