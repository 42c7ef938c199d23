"""§5.2 and Fig. 9: below which velocity pixels must be traced.

Of a few frames there are two sequences: I_rt, every pixel traced, and I_ibr, warped from keyframes with holes
traced. For a threshold v_t, I_c takes pixels slower than v_t from I_rt and the others from I_ibr. All go
through the filter of §5 and are judged by the metric. Where I_c differs visibly from I_rt at pixels that
were not traced, v_t is too low; where the differences of I_ibr that tracing removes all lie far below v_t,
it is too high.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import SettingsError
from enfilade.methods.paper.convolve import SIGMAS
from enfilade.methods.paper import spatial_support_px
from enfilade.methods.paper.masks import slow_pixels
from enfilade.monitor import Monitor
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.job import Job
from enfilade.pipeline.survey import survey_path
from enfilade.pipeline.views import Views
from enfilade.pipeline.walkthrough import LEAST_SPP
from enfilade.records import F32, Mask
from enfilade.renderer import Renderer
from enfilade.settings import MaskSettings
from enfilade.store import Run
from studies.cases.filtering import antialiased, reach_of
from studies.cases.plain import PlainlyLit
from studies.cases.seen import SEEN_JND, Viewer
from studies.cases.windows import Windows, probes_of

__all__ = ["PAPER_DEG_S", "Calibration", "calibrate", "calibrate_job"]

PAPER_DEG_S = 0.5  # §5.2
LEAST_PIXELS = 200  # of a velocity's class: fewer say nothing
LAST_PERCENT = 95.0  # of the visible differences that lie below the velocity that is reported


@dataclass(frozen=True)
class Calibration:
    """How the threshold is sought.

    Attributes
    ----------
    thresholds_deg_s : tuple of float
        Candidates, rising.
    visible_percent : float
        Pixels that were not traced may differ visibly up to this share: a tenth of what segments may before
        they are split (§6).
    """

    thresholds_deg_s: tuple[float, ...] = field(
        default=(0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)
    )
    visible_percent: float = 1.0


@dataclass
class _Count:
    """Pixels of all probes, for one candidate."""

    pixels: int = 0
    traced: int = 0
    reused: int = 0
    seen_in_reused: int = 0
    removed_deg_s: list[F32] = field(default_factory=list)


def calibrate(windows: Windows, probes: list[int], terms: Calibration) -> dict[str, Any]:
    """Find the velocity threshold of a scene.

    Pixels on mirroring, transparent and glossy surfaces are left out: another rule decides on them (§4.3).
    What the noise of the paths explains does not count as a difference.

    Parameters
    ----------
    windows
        The sequences.
    probes
        Frames to judge.
    terms

    Returns
    -------
    dict
        ``threshold_deg_s``: the least candidate from which on no more than the tolerated share of the
        reused pixels differs visibly; None where there is none. ``curve``: of each candidate
        ``threshold_deg_s``, ``traced_percent``, ``reused_visible_percent`` (I_c against I_rt) and
        ``removed_below_deg_s`` (I_c against I_ibr: 95 % of the visible differences that tracing removes are
        slower; None where there is none). ``by_velocity``: share of visible differences between I_rt and
        I_ibr by velocity. ``probes``: numbers of the frames. ``paper_deg_s``.
    """
    windows.monitor.stage("velocity threshold", len(probes) * len(terms.thresholds_deg_s))
    viewer = Viewer(windows.job.viewing, windows.job.settings)
    counts = {v: _Count() for v in terms.thresholds_deg_s}
    classes = _Classes()
    for frame in probes:
        _probe(windows, viewer, frame, counts, classes)
    curve = [_row(v, count) for v, count in counts.items()]
    return {
        "probes": [windows.job.path.numbers[f] for f in probes],
        "spp": windows.job.settings.trace.spp,
        "size": [windows.job.path.width, windows.job.path.height],
        "tolerated_percent": terms.visible_percent,
        "threshold_deg_s": chosen(curve, terms.visible_percent),
        "paper_deg_s": PAPER_DEG_S,
        "curve": curve,
        "by_velocity": classes.rows(),
    }


def calibrate_job(
    job: Job,
    terms: Calibration,
    *,
    probes: int,
    is_plain: bool,
    folder: Path | None,
    monitor: Monitor,
) -> dict[str, Any]:
    """Find the velocity threshold of any scene; see :func:`calibrate`.

    Parameters
    ----------
    job
        Scene, path, and settings; ``trace.spp`` paths a pixel.
    terms
    probes
        How many frames are judged.
    is_plain
        Whether a plain light takes the place of the scene's (:class:`PlainlyLit`).
    folder
        Where traced frames are kept; None: nowhere.
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
    job.check_scene()
    if not is_plain and job.settings.trace.spp < LEAST_SPP:
        raise SettingsError(
            f"--light traced needs --spp {LEAST_SPP} or more: the spread of a pixel's paths tells the metric "
            "what is noise and what is a difference"
        )
    renderer = job.open_renderer()
    views = Views(renderer, job.path, job.viewing, Costs())
    survey = survey_path(views, job.path, job.settings, monitor)
    source: Renderer = PlainlyLit(renderer) if is_plain else renderer
    frames = probes_of(survey, len(job.path), probes)
    with ExitStack() as stack:
        if folder is not None:
            identity = {**job.identity(), "method": "plain windows" if is_plain else "windows"}
            stack.enter_context(Run.open(folder, identity))
        windows = Windows(job, source, survey, folder, monitor, views, reference_spp=1)
        return calibrate(windows, frames, terms)


def chosen(curve: list[dict[str, Any]], tolerated_percent: float) -> float | None:
    """The least candidate from which on, and at all above it, the tolerated share is kept.

    Candidates above which nothing is reused say nothing.
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


def _probe(
    windows: Windows, viewer: Viewer, frame: int, counts: dict[float, _Count], classes: _Classes
) -> None:
    view, settings = windows.view(frame), windows.job.settings.antialias
    speed, velocity = view.speed_deg_s, view.velocity_deg_s
    valid = view.geometry.is_hit & ~view.geometry.is_specular
    # Noise of both, as if none were averaged over time: that of warped pixels is the same in every frame.
    support = spatial_support_px(speed, windows.job.viewing.pixels_per_degree, settings)
    noise = {
        "noise": windows.traced(frame).variance + windows.reused(frame).variance,
        "noise_blur_px": support / np.float32(SIGMAS),
    }

    def filtered(threshold_deg_s: float) -> F32:
        masks = MaskSettings(slow_deg_s=threshold_deg_s)

        def color(at: int) -> F32:
            is_slow = slow_pixels(windows.view(at).speed_deg_s, masks)
            return composed(windows.traced(at).color, windows.reused(at).color, is_slow)

        return antialiased(windows, frame, color, settings)

    rt = antialiased(windows, frame, lambda at: windows.traced(at).color, settings)
    ibr = antialiased(windows, frame, lambda at: windows.reused(at).color, settings)
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
        count.seen_in_reused += int((raised[reused] > SEEN_JND).sum())
        count.removed_deg_s.append(speed[valid & (lowered > SEEN_JND)])
        windows.monitor.advance()


def _row(threshold: float, count: _Count) -> dict[str, Any]:
    removed = np.concatenate(count.removed_deg_s)
    return {
        "threshold_deg_s": threshold,
        "traced_percent": 100.0 * count.traced / max(count.pixels, 1),
        "reused_visible_percent": 100.0 * count.seen_in_reused / count.reused if count.reused else None,
        "removed_below_deg_s": float(np.percentile(removed, LAST_PERCENT)) if len(removed) else None,
    }


class _Classes:
    """Visible differences by velocity."""

    EDGES = (0.0, 0.15, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 16.0, np.inf)

    def __init__(self) -> None:
        self._pixels = np.zeros(len(self.EDGES) - 1, np.int64)
        self._seen = np.zeros(len(self.EDGES) - 1, np.int64)

    def add(self, speed_deg_s: F32, jnd: F32, valid: Mask) -> None:
        """Count the pixels of one frame."""
        self._pixels += np.histogram(speed_deg_s[valid], self.EDGES)[0]
        self._seen += np.histogram(speed_deg_s[valid & (jnd > SEEN_JND)], self.EDGES)[0]

    def rows(self) -> list[dict[str, Any]]:
        """Of each class with enough pixels: its ends (None: no end), pixels, and the visible share."""
        ends = [None if np.isinf(e) else e for e in self.EDGES]
        return [
            {
                "from_deg_s": a,
                "to_deg_s": b,
                "pixels": int(n),
                "visible_percent": 100.0 * float(seen) / int(n),
            }
            for a, b, n, seen in zip(ends, ends[1:], self._pixels, self._seen, strict=False)
            if n >= LEAST_PIXELS
        ]
