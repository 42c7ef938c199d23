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
from studies.cases.filtering import antialiased, reach_of
from studies.cases.plain import PlainlyLit
from studies.cases.seen import VISIBLE_JND
from studies.cases.windows import Windows, probes_of
from studies.progress import counted

__all__ = ["Calibration", "calibrate", "calibrate_job", "measure"]

MIN_PIXELS = 200  # of a class of velocity: fewer are not representative
LAST_PERCENT = 95.0  # of the visible differences that lie below the velocity that is reported


@dataclass(frozen=True)
class Calibration:
    """Candidates and tolerance of a calibration.

    Attributes
    ----------
    thresholds_deg_s : tuple of float
        Candidates, rising.
    visible_percent : float
        Share of the pixels that are not traced that may differ visibly: a tenth of that at which segments are
        split (§6).
    """

    thresholds_deg_s: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)
    visible_percent: float = 1.0


@dataclass
class _Count:
    """Pixels of all probes, for one candidate."""

    pixels: int = 0
    traced: int = 0
    reused: int = 0
    visible: int = 0  # of the reused ones
    removed_deg_s: list[F32] = field(default_factory=list)


def measure(case: Case) -> dict[str, Any]:
    """The threshold without noise (``plain``) and path traced (``traced``); see :func:`calibrate`."""
    return {
        "plain": calibrate(case.plain_windows, case.probes, Calibration()),
        "traced": calibrate(case.windows, case.traced_probes, Calibration()),
    }


def calibrate(windows: Windows, probes: list[int], terms: Calibration) -> dict[str, Any]:
    """Find the velocity threshold of a scene.

    Pixels on mirroring, transparent and glossy surfaces are left out, since another rule decides on them
    (§4.3). Differences that the noise of the paths explains do not count.

    Parameters
    ----------
    windows
    probes
        Frames to compare.
    terms

    Returns
    -------
    dict
        ``threshold_deg_s``: the least candidate from which on no more than the tolerated share of the reused
        pixels differs visibly; None where there is none. ``curve``: of each candidate ``threshold_deg_s``,
        ``traced_percent``, ``reused_visible_percent`` (I_c against I_rt) and ``removed_below_deg_s`` (I_c
        against I_ibr: 95 % of the visible differences that tracing removes are slower; None where there is
        none). ``by_velocity``: share of visible differences between I_rt and I_ibr by velocity. ``probes``:
        frame numbers.
    """
    counts = {v: _Count() for v in terms.thresholds_deg_s}
    classes = _Classes()
    for frame in counted(probes, "velocity threshold", windows.monitor):
        _compare(windows, frame, counts, classes)
    curve = [_row(v, count) for v, count in counts.items()]
    path = windows.walk.path
    return {
        "probes": [path.numbers[f] for f in probes],
        "spp": windows.walk.settings[SamplingSettings].spp,
        "size": [path.width, path.height],
        "tolerated_percent": terms.visible_percent,
        "threshold_deg_s": chosen(curve, terms.visible_percent),
        "curve": curve,
        "by_velocity": classes.rows(),
    }


def calibrate_job(
    job: Job, terms: Calibration, *, probes: int, is_plain: bool, folder: Path | None, monitor: Monitor
) -> dict[str, Any]:
    """Find the velocity threshold of any scene; see :func:`calibrate`.

    Parameters
    ----------
    job
        By the paper's method.
    terms
    probes
        Number of frames to compare.
    is_plain
        Whether a plain light replaces the scene's (:class:`PlainlyLit`).
    folder
        Holds traced frames; None: nothing is kept.
    monitor

    Raises
    ------
    SceneError
    SettingsError
        Too few paths to tell noise from differences.
    DeviceError
    RunFolderError
        The folder holds frames of something else.
    """
    job.check()
    if not is_plain and job.settings[SamplingSettings].spp < MIN_SPP:
        raise SettingsError(
            f"--light traced needs --spp {MIN_SPP} or more: noise is estimated from the paths' spread"
        )
    renderer = job.open_renderer()
    walk = Walkthrough(job.path, job.settings, PlainlyLit(renderer) if is_plain else renderer)
    frames = counted(range(len(job.path)), "analysis", monitor)
    analysis = Analysis(job.path, job.settings, tuple(analyze(walk, frame) for frame in frames))
    with ExitStack() as stack:
        if folder is not None:
            identity = {**job.identity(), "method": "plain windows" if is_plain else "windows"}
            stack.enter_context(RunFolder.create(folder, identity))
        windows = Windows(walk, analysis, monitor, reference_spp=1, folder=folder)
        return calibrate(windows, probes_of(analysis, probes), terms)


def chosen(curve: list[dict[str, Any]], tolerated_percent: float) -> float | None:
    """The least candidate from which on the tolerated share is kept, at it and at all above it.

    Candidates above which nothing is reused count neither way.
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


def _compare(windows: Windows, frame: int, counts: dict[float, _Count], classes: _Classes) -> None:
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

    def filtered(threshold_deg_s: float) -> F32:
        masks = MaskSettings(slow_deg_s=threshold_deg_s)

        def color(at: int) -> F32:
            is_slow = slow_pixels(windows.view(at).speed_deg_s, masks)
            return composed(windows.traced(at).color, windows.reused(at).color, is_slow)

        return antialiased(windows, frame, settings, color)

    rt = antialiased(windows, frame, settings)
    ibr = antialiased(windows, frame, settings, lambda at: windows.reused(at).color)
    classes.add(speed, viewer.paper(ibr, rt, velocity, valid=valid, **noise), valid)
    span = windows.around(frame, reach_of(settings))
    before: tuple[list[int], F32, F32] | None = None
    for threshold, count in counts.items():
        is_slow = slow_pixels(speed, MaskSettings(slow_deg_s=threshold))
        slow = [int((windows.view(at).speed_deg_s < threshold).sum()) for at in span]
        if before is not None and before[0] == slow:  # the same pixels as for the last candidate
            _, raised, lowered = before
        else:
            c = filtered(threshold)
            raised = viewer.paper(c, rt, velocity, valid=valid, **noise)
            lowered = viewer.paper(ibr, c, velocity, valid=valid, **noise)
        before = slow, raised, lowered
        reused = valid & ~is_slow
        count.pixels += int(valid.sum())
        count.traced += int((valid & is_slow).sum())
        count.reused += int(reused.sum())
        count.visible += int((raised[reused] > VISIBLE_JND).sum())
        count.removed_deg_s.append(speed[valid & (lowered > VISIBLE_JND)])


def _row(threshold: float, count: _Count) -> dict[str, Any]:
    removed = np.concatenate(count.removed_deg_s)
    return {
        "threshold_deg_s": threshold,
        "traced_percent": 100.0 * count.traced / max(count.pixels, 1),
        "reused_visible_percent": 100.0 * count.visible / count.reused if count.reused else None,
        "removed_below_deg_s": float(np.percentile(removed, LAST_PERCENT)) if len(removed) else None,
    }


class _Classes:
    """Visible differences by velocity."""

    EDGES = (0.0, 0.15, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 16.0, np.inf)

    def __init__(self) -> None:
        self._pixels = np.zeros(len(self.EDGES) - 1, np.int64)
        self._visible = np.zeros(len(self.EDGES) - 1, np.int64)

    def add(self, speed_deg_s: F32, jnd: F32, valid: Mask) -> None:
        """Count the pixels of one frame."""
        self._pixels += np.histogram(speed_deg_s[valid], self.EDGES)[0]
        self._visible += np.histogram(speed_deg_s[valid & (jnd > VISIBLE_JND)], self.EDGES)[0]

    def rows(self) -> list[dict[str, Any]]:
        """Of each class with enough pixels: its ends (None: no end), pixels, and the visible share."""
        ends = [None if np.isinf(e) else e for e in self.EDGES]
        return [
            {"from_deg_s": a, "to_deg_s": b, "pixels": int(n), "visible_percent": 100.0 * float(v) / int(n)}
            for a, b, n, v in zip(ends, ends[1:], self._pixels, self._visible, strict=False)
            if n >= MIN_PIXELS
        ]
