"""Measurement of a configuration's frames against those of its reference."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.comparison.measures import display_pair
from enfilade.comparison.measures import why_missing as why_no_measure
from enfilade.errors import SettingsError
from enfilade.images import read_exr
from enfilade.methods.base import FRAMES
from enfilade.metric import Pursuit
from enfilade.monitor import Monitor
from enfilade.records import Flow
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.settings import MetricSettings, ViewingSettings
from studies.bench.measures import SCALES, Temporal, TrackedPair, open_measure, visible_before


def available(requested: Sequence[str], job: Job) -> tuple[list[str], list[str]]:
    """Names of the measures that are available for a path, and the reasons why others are not.

    Raises
    ------
    SettingsError
        A requested measure is missing, or all are.
    """
    path = job.path
    has_changes = any(path.neighbours(frame)[0] for frame in range(len(path)))
    reasons = {name: why_no_measure(name) for name in SCALES}
    if not has_changes:
        reasons[Temporal.name] = f"{Temporal.name} is left out: it needs consecutive frames"
    for name in requested:
        if why := reasons.get(name, f"there is no measure {name!r}; known are: {', '.join(SCALES)}"):
            raise SettingsError(why)
    names = list(dict.fromkeys(requested)) or [name for name, why in reasons.items() if not why]
    if not names:
        raise SettingsError(f"no measure is available: {'; '.join(reasons.values())}")
    return names, [] if requested else [why for why in reasons.values() if why]


def measure(
    test: Path, halves: tuple[Path, Path], job: Job, names: Sequence[str], monitor: Monitor
) -> dict[str, Any]:
    """Measure the frames of a run folder against a reference, each frame read once.

    Parameters
    ----------
    test
        A run folder.
    halves
        Run folders of both halves of the reference, whose mean it is; their frames carry all AOVs.
    job
        Camera path and viewing conditions of both.
    names
        Names of measures.
    monitor

    Returns
    -------
    dict
        By measure: ``score`` and ``per_frame``; None for identical frames and first frames.
    """
    pursuit = Pursuit(job.settings[MetricSettings].metering.value)
    measures = {name: open_measure(name, job.viewing, pursuit) for name in names}
    values: dict[str, list[float | None]] = {name: [] for name in names}
    for done, pair in enumerate(pairs(test, halves, job), 1):
        for name, one in measures.items():
            values[name].append(one.measure(pair))
        monitor.progress("measures", done, len(job.path))
    return {
        name: {
            "score": _finite(measures[name].pool(values[name])),
            "per_frame": [None if value is None else _finite(value) for value in values[name]],
        }
        for name in names
    }


def pairs(test: Path, halves: tuple[Path, Path], job: Job) -> Iterator[TrackedPair]:
    """Pairs of frames of a run and its reference, in order; see :func:`measure`."""
    path, exposure_ev = job.path, job.settings[ViewingSettings].exposure_ev
    runs = [RunFolder.read(folder) for folder in (test, *halves)]
    previous: dict[str, Any] | None = None
    for frame, number in enumerate(path.numbers):
        tested, layers, others = (read_exr(run.file_of(FRAMES, number)) for run in runs)
        before, after = path.neighbours(frame)
        flow = Flow(layers["backward"], layers["forward"], before is not None, after is not None)
        is_visible = visible_before(layers, previous) if previous is not None and before is not None else None
        color, first, second = (
            np.ascontiguousarray(of["RGB"], np.float32) for of in (tested, layers, others)
        )
        wanted = np.float32(0.5) * (first + second)
        pair = display_pair(color, wanted, job.viewing, exposure_ev=exposure_ev)
        shown = display_pair(first, second, job.viewing, exposure_ev=exposure_ev)
        yield TrackedPair(
            **vars(pair), flow=flow, visible_before=is_visible, halves=(shown.test, shown.reference)
        )
        previous = layers


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
