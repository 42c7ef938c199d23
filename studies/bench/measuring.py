"""Frames of a configuration, measured against those of its reference."""

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


def available(asked: Sequence[str], job: Job) -> tuple[list[str], list[str]]:
    """Names of the measures that can be had for a path, and the reasons why others are left out.

    Raises
    ------
    SettingsError
        A measure that was asked for is missing, or all are.
    """
    path = job.path
    has_changes = any(path.neighbours(frame)[0] for frame in range(len(path)))
    reasons = {name: why_no_measure(name) for name in SCALES}
    if not has_changes:
        reasons[Temporal.name] = f"{Temporal.name} is left out: it needs consecutive frames"
    for name in asked:
        if why := reasons.get(name, f"there is no measure {name!r}; known are: {', '.join(SCALES)}"):
            raise SettingsError(why)
    names = list(dict.fromkeys(asked)) or [name for name, why in reasons.items() if not why]
    if not names:
        raise SettingsError(f"no measure can be had: {'; '.join(reasons.values())}")
    return names, [] if asked else [why for why in reasons.values() if why]


def measure(
    test: Path,
    reference: Path,
    job: Job,
    names: Sequence[str],
    monitor: Monitor,
    *,
    share: float = 1.0,
) -> dict[str, Any]:
    """Measure the frames of a run folder against those of another, each frame read once.

    Parameters
    ----------
    test, reference
        Run folders; the frames of the reference carry all AOVs.
    job
        Their path, and the viewing conditions.
    names
        Of measures.
    monitor
    share
        Of the test's difference to the reference that is measured: 1 is the test itself.

    Returns
    -------
    dict
        By measure: ``score`` and ``per_frame``, None where there is no number (identical; a first frame).
    """
    pursuit = Pursuit(job.settings[MetricSettings].metering.value)
    measures = {name: open_measure(name, job.viewing, pursuit) for name in names}
    values: dict[str, list[float | None]] = {name: [] for name in names}
    for done, pair in enumerate(pairs(test, reference, job, share=share), 1):
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


def pairs(test: Path, reference: Path, job: Job, *, share: float = 1.0) -> Iterator[TrackedPair]:
    """Frames of two run folders side by side, in order; see :func:`measure`."""
    path, exposure_ev = job.path, job.settings[ViewingSettings].exposure_ev
    runs = RunFolder.read(test), RunFolder.read(reference)
    last: dict[str, Any] | None = None
    for frame, number in enumerate(path.numbers):
        tested, layers = (read_exr(run.file_of(FRAMES, number)) for run in runs)
        before, after = path.neighbours(frame)
        flow = Flow(layers["backward"], layers["forward"], before is not None, after is not None)
        is_visible = visible_before(layers, last) if last is not None and before is not None else None
        color, wanted = (np.ascontiguousarray(of["RGB"], np.float32) for of in (tested, layers))
        if share != 1.0:
            color = wanted + np.float32(share) * (color - wanted)
        pair = display_pair(color, wanted, job.viewing, exposure_ev=exposure_ev)
        yield TrackedPair(**vars(pair), flow=flow, visible_before=is_visible)
        last = layers


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
