"""§5.2 and Fig. 9: velocity below which pixels must be traced.

There are two sequences around a few frames: I_rt, every pixel traced, and I_ibr, composited from keyframes
with disocclusions traced. For a threshold v_t, I_c takes pixels slower than v_t from I_rt and the others from
I_ibr. All are filtered as in §5 and compared by the metric. Where I_c differs visibly from I_rt at pixels
that were not traced, v_t is too low; where all differences of I_ibr that tracing removes lie far below v_t,
it is too high.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import SettingsError
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.paper.convolve import SIGMAS
from enfilade.methods.paper.masks import slow_pixels
from enfilade.methods.paper.method import MIN_SPP
from enfilade.methods.paper.support import spatial_support_px
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, Mask
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.settings import AntialiasSettings, MaskSettings, SamplingSettings
from studies.cases.case import Case
from studies.cases.plain import PlainlyLit
from studies.cases.seen import VISIBLE_JND
from studies.cases.windows import Windows
from studies.progress import counted

THRESHOLDS_DEG_S = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)
TOLERATED_PERCENT = 1.0  # of the reused pixels: a tenth of the share at which segments are split (§6)
CLASSES_DEG_S = (0.0, 0.15, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 16.0, np.inf)
MIN_PIXELS = 200  # of a class of velocity: fewer are not representative
LAST_PERCENT = 95.0  # of the visible differences that lie below the velocity that is reported


@dataclass
class _Count:
    """Pixels of all probes, for one threshold."""

    pixels: int = 0
    traced: int = 0
    reused: int = 0
    visible: int = 0  # of the reused ones
    removed_deg_s: list[F32] = field(default_factory=list)

    def row(self, threshold: float) -> dict[str, Any]:
        """Its row of the curve; see :func:`calibrate`."""
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
        "plain": calibrate(case.plain_windows, case.plain_windows.probes),
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

    Pixels on mirroring, transparent and glossy surfaces are left out, since another rule decides on them
    (§4.3). Differences that the noise of the paths explains do not count.

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
        ``threshold_deg_s``: see :func:`chosen`. ``curve``: of each candidate ``threshold_deg_s``,
        ``traced_percent``, ``reused_visible_percent`` (I_c against I_rt) and ``removed_below_deg_s`` (I_c
        against I_ibr: 95 % of the visible differences that tracing removes are slower; None where there is
        none). ``by_velocity``: share of visible differences between I_rt and I_ibr by velocity. ``probes``:
        their numbers.
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
        "threshold_deg_s": chosen(curve, tolerated_percent),
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
    is_plain: bool,
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
    is_plain
        Whether a plain light replaces the scene's (:class:`PlainlyLit`).
    folder
        Holds traced frames; None: nothing is kept.
    monitor

    Raises
    ------
    InputError
        The scene; too few paths to tell noise from differences; a folder that holds frames of something else.
    """
    job.check()
    if not is_plain and job.settings[SamplingSettings].spp < MIN_SPP:
        raise SettingsError(f"--light traced needs --spp {MIN_SPP} or more: their spread tells the noise")
    renderer = job.open_renderer()
    walk = Walkthrough(job.path, job.settings, PlainlyLit(renderer) if is_plain else renderer)
    frames = counted(range(len(job.path)), "analysis", monitor)
    analysis = Analysis(job.path, job.settings, tuple(analyze(walk, frame) for frame in frames))
    with ExitStack() as stack:
        if folder is not None:
            identity = {**job.identity(), "method": "plain windows" if is_plain else "windows"}
            stack.enter_context(RunFolder.create(folder, identity))
        windows = Windows(walk, analysis, monitor, probes=probes, reference_spp=1, folder=folder)
        return calibrate(windows, windows.probes, tolerated_percent=tolerated_percent)


def chosen(curve: list[dict[str, Any]], tolerated_percent: float) -> float | None:
    """The least threshold at which, and above which, no more than the tolerated share differs visibly.

    Thresholds above which nothing is reused count neither way. None where there is no such threshold.
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


def composed(rt: F32, ibr: F32, is_slow: Mask) -> F32:
    """I_c of Fig. 9: slow pixels traced, the others reused."""
    mixed: F32 = np.where(is_slow[..., None], rt, ibr)
    return mixed


def _compare(windows: Windows, frame: int, counts: dict[float, _Count], classes: Any) -> None:
    view, viewer = windows.view(frame), windows.viewer
    settings = windows.walk.settings[AntialiasSettings]
    speed, velocity = view.speed_deg_s, view.velocity_deg_s
    valid = view.geometry.is_hit & ~view.geometry.is_specular
    # Noise of both, as if none were averaged over time: that of warped pixels is the same in every frame.
    support = spatial_support_px(speed, windows.walk.viewing.pixels_per_degree, settings)
    noise = {
        "noise": windows.traced(frame).variance + windows.reused(frame).variance,
        "noise_blur_px": support / np.float32(SIGMAS),
    }

    def is_slow(at: int, threshold: float) -> Mask:
        return slow_pixels(windows.view(at).speed_deg_s, MaskSettings(slow_deg_s=threshold))

    def filtered(threshold: float) -> F32:
        def color(at: int) -> F32:
            return composed(windows.traced(at).color, windows.reused(at).color, is_slow(at, threshold))

        return windows.antialiased(frame, settings, color)

    rt = windows.antialiased(frame, settings)
    ibr = windows.antialiased(frame, settings, lambda at: windows.reused(at).color)
    is_visible = valid & (viewer.paper(ibr, rt, velocity, valid=valid, **noise) > VISIBLE_JND)
    classes += [np.histogram(speed[where], CLASSES_DEG_S)[0] for where in (valid, is_visible)]
    before: list[int] = []
    for threshold, count in counts.items():
        slow = [int(is_slow(at, threshold).sum()) for at in windows.around(frame, settings)]
        if slow != before:  # otherwise the same pixels as for the last threshold
            before, c = slow, filtered(threshold)
            raised = viewer.paper(c, rt, velocity, valid=valid, **noise)
            lowered = viewer.paper(ibr, c, velocity, valid=valid, **noise)
        reused = valid & ~is_slow(frame, threshold)
        count.pixels += int(valid.sum())
        count.traced += int((valid & ~reused).sum())
        count.reused += int(reused.sum())
        count.visible += int((raised[reused] > VISIBLE_JND).sum())
        count.removed_deg_s.append(speed[valid & (lowered > VISIBLE_JND)])
