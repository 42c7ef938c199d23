# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a job, and writes its result or its error."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from enfilade_blender.failure import ExportError
from enfilade_blender.job import read_job

FAILED = 3  # exit code with ``error.json``


def run_job(file: Path) -> int:
    """Run a job file; 0, or 3 where ``error.json`` says why not."""
    out = file.parent
    try:
        job = read_job(file)
        out = job.out
        out.mkdir(parents=True, exist_ok=True)
        if job.task == "cycles":
            from enfilade_blender.render_cycles import render_frames

            write_json(out / "cycles.json", render_frames(job))
        else:
            from enfilade_blender.export import export

            write_json(out / "import.json", export(job))
    except ExportError as error:
        write_json(out / "error.json", {"what": error.what, "where": error.where, "do": error.do})
        return FAILED
    return 0


def write_json(file: Path, content: dict[str, Any]) -> None:
    """Write beside, then rename: the file is whole or absent."""
    beside = file.with_suffix(".part")
    beside.write_text(json.dumps(content, ensure_ascii=False, indent=1), encoding="utf-8")
    beside.replace(file)
