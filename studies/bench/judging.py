"""A contestant's frames before the judges, beside those of its reference."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.comparison.measures import SCALES, Shown, open_judge, seen_before, shown
from enfilade.images import read_exr
from enfilade.metric import Pursuit
from enfilade.monitor import Monitor
from enfilade.pipeline.job import Job
from enfilade.records import F32, Flow

__all__ = ["error_of", "judge", "pairs", "without_silent"]


def judge(
    test: Path, reference: Path, job: Job, names: Sequence[str], monitor: Monitor, *, share: float = 1.0
) -> dict[str, Any]:
    """Let judges look at two run folders, each frame read once.

    Parameters
    ----------
    test, reference
        Run folders; the frames of the reference carry layers.
    job
        Their path, and the viewing conditions.
    names
        Of judges.
    monitor
        Is told of each frame.
    share
        Of the test's difference to the reference that is judged: 1 is the test itself.

    Returns
    -------
    dict
        By judge: ``score`` and ``per_frame``, None where a judge has no number (identical; a first frame).
    """
    pursuit = Pursuit(job.settings.metric.metering.value)
    judges = {name: open_judge(name, job.viewing, pursuit=pursuit) for name in names}
    values: dict[str, list[float | None]] = {name: [] for name in names}
    for pair in pairs(test, reference, job, share=share):
        for name, one in judges.items():
            values[name].append(one.judge(pair))
        monitor.advance()
    return {
        name: {
            "score": _finite(judges[name].pooled(values[name])),
            "per_frame": [None if value is None else _finite(value) for value in values[name]],
        }
        for name in names
    }


def error_of(name: str, score: float | None) -> float:
    """Error of a score as :func:`judge` gives it: identical sequences have none."""
    return 0.0 if score is None else SCALES[name].error_of(score)


def without_silent(
    rows: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> tuple[list[dict[str, Any]], list[str], list[str]]:
    """Leave out judges of changes where no frame has one before it: nobody measured their scores.

    Parameters
    ----------
    rows
        Of contestants, as in ``bench.json``.
    names
        Of judges.

    Returns
    -------
    rows, names, reasons
        Rows and names without these judges, and a line for each that is left out.
    """
    silent = [name for name in names if SCALES[name].is_of_changes and any(_is_silent(r, name) for r in rows)]
    kept = [name for name in names if name not in silent]
    heard = [{**r, **{key: {n: r[key][n] for n in kept} for key in ("scores", "per_frame")}} for r in rows]
    reasons = [
        f"the judge {name!r} is left out: no frame has one before it that sees the same surfaces in the same "
        "shot; give it consecutive frames"
        for name in silent
    ]
    return heard, kept, reasons


def _is_silent(row: Mapping[str, Any], name: str) -> bool:
    return all(value is None for value in row["per_frame"][name])


def pairs(test: Path, reference: Path, job: Job, *, share: float = 1.0) -> Iterator[Shown]:
    """Frames of two run folders side by side, in order; see :func:`judge`."""
    path = job.path
    exposure_ev = job.settings.viewing.exposure_ev
    last: dict[str, Any] | None = None
    for frame, number in enumerate(path.numbers):
        layers = read_exr(_file(reference, number))
        before, after = path.neighbours(frame)
        flow = Flow(layers["backward"], layers["forward"], before is not None, after is not None)
        seen = seen_before(layers, last) if last is not None and before is not None else None
        color, wanted = _f32(read_exr(_file(test, number))["RGB"]), _f32(layers["RGB"])
        if share != 1.0:
            color = wanted + np.float32(share) * (color - wanted)
        yield shown(
            color,
            wanted,
            job.viewing,
            exposure_ev=exposure_ev,
            flow=flow,
            seen_before=seen,
        )
        last = layers


def _f32(values: Any) -> F32:
    return np.ascontiguousarray(values, np.float32)


def _file(folder: Path, number: int) -> Path:
    sign = "-" if number < 0 else ""
    return folder / "frames" / f"{sign}{abs(number):04d}.exr"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
