"""Velocity below which pixels must be traced (§5.2, Fig. 9).

Two sequences are rendered around a few frames: I_rt with every pixel traced, and I_ibr composited from
keyframes with traced disocclusions. For a threshold v_t, I_c takes pixels slower than v_t from I_rt and the
others from I_ibr. All are filtered (§5) and compared by the metric. If reused pixels of I_c differ visibly
from I_rt, v_t is too low; if all differences of I_ibr that tracing removes are far below v_t, it is too high.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import SettingsError
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.paper.keyframe import MIN_SPP
from enfilade.methods.paper.masks import slow_pixels
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, Mask
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.settings import AntialiasSettings, MaskSettings, SamplingSettings
from studies.cases.case import Case
from studies.cases.noise_free import NoiseFreeRenderer
from studies.cases.visibility import VISIBLE_JND
from studies.cases.windows import Windows
from studies.progress import counted

THRESHOLDS_DEG_S = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)
TOLERATED_PERCENT = 1.0  # of the reused pixels: a tenth of the share at which segments are split (§6)
CLASSES_DEG_S = (0.0, 0.15, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 16.0, np.inf)
MIN_PIXELS = 200  # of a class of velocity: fewer are not representative
LAST_PERCENT = 95.0  # of the visible differences that lie below the velocity that is reported


@dataclass
class _Count:
    """Pixel counts over all probes, for one threshold."""

    pixels: int = 0
    traced: int = 0
    reused: int = 0
    visible: int = 0  # of the reused ones
    removed_deg_s: list[F32] = field(default_factory=list)

    def row(self, threshold: float) -> dict[str, Any]:
        """Row of the curve; see :func:`calibrate`."""
        removed = np.concatenate(self.removed_deg_s)
        return {
            "threshold_deg_s": threshold,
            "traced_percent": 100.0 * self.traced / max(self.pixels, 1),
            "reused_visible_percent": 100.0 * self.visible / self.reused if self.reused else None,
            "removed_below_deg_s": float(np.percentile(removed, LAST_PERCENT)) if len(removed) else None,
        }


def measure(case: Case) -> dict[str, Any]:
    """The threshold without noise (``plain``) and path traced (``traced``); see :func:`calibrate`."""
    return {
        "plain": calibrate(case.noise_free_windows, case.noise_free_windows.probes),
        "traced": calibrate(case.windows, case.windows.probes),
    }


def calibrate(
    windows: Windows,
    probes: list[int],
    *,
    tolerated_percent: float = TOLERATED_PERCENT,
    thresholds_deg_s: tuple[float, ...] = THRESHOLDS_DEG_S,
) -> dict[str, Any]:
    """Find the velocity threshold of a scene.

    Pixels of mirroring, transparent and glossy surfaces are left out; another rule applies to them (§4.3).
    All frames are rendered twice, with independent noise, and what both halves share is compared.

    Parameters
    ----------
    windows
    probes
        Frames to compare.
    tolerated_percent
        Share of the reused pixels that may differ visibly.
    thresholds_deg_s
        Candidates, rising.

    Returns
    -------
    dict
        ``threshold_deg_s``: see :func:`least_threshold`. ``curve``: for each candidate ``threshold_deg_s``,
        ``traced_percent``, ``reused_visible_percent`` (I_c against I_rt) and ``removed_below_deg_s`` (I_c
        against I_ibr: 95 % of the visible differences that tracing removes are slower; None without
        any). ``by_velocity``: share of visible differences between I_rt and I_ibr by velocity. ``probes``:
        numbers of the probes.
    """
    counts = {v: _Count() for v in thresholds_deg_s}
    classes = np.zeros((2, len(CLASSES_DEG_S) - 1), np.int64)  # all pixels, visibly different ones
    for frame in counted(probes, "velocity threshold", windows.monitor):
        _compare(windows, frame, counts, classes)
    curve = [count.row(v) for v, count in counts.items()]
    ends = [None if np.isinf(e) else e for e in CLASSES_DEG_S]
    return {
        "probes": [windows.walk.path.numbers[f] for f in probes],
        "spp": windows.walk.settings[SamplingSettings].spp,
        "tolerated_percent": tolerated_percent,
        "threshold_deg_s": least_threshold(curve, tolerated_percent),
        "curve": curve,
        "by_velocity": [
            {"from_deg_s": a, "to_deg_s": b, "pixels": int(n), "visible_percent": 100.0 * float(v) / int(n)}
            for a, b, n, v in zip(ends[:-1], ends[1:], *classes, strict=True)
            if n >= MIN_PIXELS
        ],
    }


def calibrate_job(
    job: Job,
    *,
    probes: int,
    tolerated_percent: float,
    is_noise_free: bool,
    folder: Path | None,
    monitor: Monitor,
) -> dict[str, Any]:
    """Find the velocity threshold of any scene; see :func:`calibrate`.

    Parameters
    ----------
    job
        By the paper's method.
    probes
        Number of frames to compare.
    tolerated_percent
    is_noise_free
        Whether to render without noise (:class:`NoiseFreeRenderer`).
    folder
        Folder of the traced frames; None: they are not kept.
    monitor

    Raises
    ------
    InputError
        The scene, too few paths to estimate the noise, or a folder that holds frames of another run.
    """
    job.check()
    if not is_noise_free and job.settings[SamplingSettings].spp < MIN_SPP:
        raise SettingsError(f"--light traced needs --spp {MIN_SPP} or more, to estimate the noise")
    renderer = job.open_renderer()
    walk = Walkthrough(job.path, job.settings, NoiseFreeRenderer(renderer) if is_noise_free else renderer)
    frames = counted(range(len(job.path)), "analysis", monitor)
    analysis = Analysis(job.path, job.settings, tuple(analyze(walk, frame) for frame in frames))
    with ExitStack() as stack:
        if folder is not None:
            identity = {**job.identity(), "method": "noise-free windows" if is_noise_free else "windows"}
            stack.enter_context(RunFolder.create(folder, identity))
        windows = Windows(walk, analysis, monitor, probes=probes, reference_spp=1, folder=folder)
        return calibrate(windows, windows.probes, tolerated_percent=tolerated_percent)


def least_threshold(curve: list[dict[str, Any]], tolerated_percent: float) -> float | None:
    """Least threshold from which on at most the tolerated share of reused pixels differs visibly.

    Thresholds without reused pixels are ignored. None if there is no such threshold.
    """
    found: float | None = None
    for row in reversed(curve):
        percent = row["reused_visible_percent"]
        if percent is None:
            continue
        if percent > tolerated_percent:
            break
        found = row["threshold_deg_s"]
    return found


def composite_by_velocity(rt: F32, ibr: F32, is_slow: Mask) -> F32:
    """I_c of Fig. 9: slow pixels traced, the others reused."""
    composited: F32 = np.where(is_slow[..., None], rt, ibr)
    return composited


def _compare(windows: Windows, frame: int, counts: dict[float, _Count], classes: Any) -> None:
    view, viewer = windows.view(frame), windows.viewer
    settings = windows.walk.settings[AntialiasSettings]
    speed, velocity = view.speed_deg_s, view.velocity_deg_s
    valid = view.geometry.is_hit & ~view.geometry.is_specular
    halves = windows, windows.second_half

    def is_slow(at: int, threshold: float) -> Mask:
        return slow_pixels(windows.view(at).speed_deg_s, MaskSettings(slow_deg_s=threshold))

    def filtered(threshold: float) -> list[F32]:
        def color(half: Windows, at: int) -> F32:
            return composite_by_velocity(half.traced(at).color, half.reused(at).color, is_slow(at, threshold))

        return [half.antialiased(frame, settings, partial(color, half)) for half in halves]

    rt, ibr = [half.antialiased(frame, settings) for half in halves], filtered(0.0)
    is_visible = valid & (viewer.halves(ibr, rt, velocity, valid=valid) > VISIBLE_JND)
    classes += [np.histogram(speed[where], CLASSES_DEG_S)[0] for where in (valid, is_visible)]
    previous_counts: list[int] = []
    for threshold, count in counts.items():
        slow = [int(is_slow(at, threshold).sum()) for at in windows.around(frame, settings)]
        if slow != previous_counts:  # otherwise the pixels are those of the previous threshold
            previous_counts, c = slow, filtered(threshold)
            against_traced = viewer.halves(c, rt, velocity, valid=valid)
            against_reused = viewer.halves(ibr, c, velocity, valid=valid)
        reused = valid & ~is_slow(frame, threshold)
        count.pixels += int(valid.sum())
        count.traced += int((valid & ~reused).sum())
        count.reused += int(reused.sum())
        count.visible += int((against_traced[reused] > VISIBLE_JND).sum())
        count.removed_deg_s.append(speed[valid & (against_reused > VISIBLE_JND)])
