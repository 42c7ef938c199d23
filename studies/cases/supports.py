"""Best support of the antialiasing filter at each velocity (§5.2).

Uniform supports, spatial and temporal, are applied to traced frames sampled at pixels' centres, and the
results are compared with the reference: the same frame through a pixel filter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enfilade.methods.paper.support import spatial_support_px
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.settings import AntialiasSettings
from studies.cases.case import PAPER_FILTER, Case
from studies.cases.visibility import score_in
from studies.cases.windows import Windows
from studies.progress import counted

SPATIAL_PX = (1.0, 3.0, 5.0, 7.0, 9.0, 11.0)  # 1 is no filter
TEMPORAL = (1, 5, 11, 15, 21)  # frames
CLASSES_DEG_S = (0.0, 0.15, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, np.inf)
MIN_PIXELS = 500  # of a velocity class, over all probes: smaller ones are not representative
MODES = ("paper", "modern")


def measure(case: Case) -> dict[str, Any]:
    """Scores without noise (``plain``) and path traced (``traced``); see :func:`compare`."""
    return {
        "plain": compare(case.noise_free_windows, case.noise_free_windows.probes),
        "traced": compare(case.windows, case.windows.probes),
    }


def compare(
    windows: Windows,
    probes: list[int],
    *,
    spatial_px: tuple[float, ...] = SPATIAL_PX,
    temporal: tuple[int, ...] = TEMPORAL,
    classes_deg_s: tuple[float, ...] = CLASSES_DEG_S,
) -> dict[str, Any]:
    """Score every support in every velocity class.

    Specular surfaces are left out, since reflections move differently from surfaces (§5.4).

    Returns
    -------
    dict
        ``classes``: for each its limits (None: unbounded), ``pixels``, the supports of §5.2 (``paper_px``,
        ``paper_frames``), and ``scores``: by mode of the metric, a row for each spatial and a column for each
        temporal support, JND in motion; ``best``: by mode, the supports with the least score;
        ``paper_score``: that of the paper's adaptive filter. ``spatial_px``, ``temporal``.
    """
    viewer, paper = windows.viewer, windows.walk.settings[AntialiasSettings]
    filters = [*(uniform(width, count) for width in spatial_px for count in temporal), paper]
    starts, ends = classes_deg_s[:-1], classes_deg_s[1:]
    pixels = np.zeros(len(starts), np.int64)
    sums = {mode: np.zeros((len(starts), len(filters))) for mode in MODES}  # of J^3.5
    for frame in counted(probes, "filter supports", windows.monitor):
        view = windows.view(frame)
        valid = view.geometry.is_hit & ~view.geometry.is_specular
        speed, classes = view.speed_deg_s, zip(starts, ends, strict=True)
        places = [valid & (speed >= a) & (speed < b) for a, b in classes]
        counts = np.array([int(where.sum()) for where in places])
        pixels += counts
        for column, settings in enumerate(filters):
            color = windows.antialiased(frame, settings)
            for mode in MODES:
                jnd = getattr(viewer, mode)(color, windows.reference(frame).color, view.velocity_deg_s)
                scores = [score_in(jnd, where) or 0.0 for where in places]
                sums[mode][:, column] += np.array([score**POOLING_EXPONENT for score in scores]) * counts
    shape = len(spatial_px), len(temporal)
    rows = []
    for k in np.flatnonzero(pixels >= MIN_PIXELS):
        means = {mode: (sums[mode][k] / pixels[k]) ** (1.0 / POOLING_EXPONENT) for mode in MODES}
        best = {mode: np.unravel_index(int(np.argmin(means[mode][:-1])), shape) for mode in MODES}
        rows.append(
            {
                **_class(float(starts[k]), float(ends[k]), windows.walk.viewing.pixels_per_degree),
                "pixels": int(pixels[k]),
                "scores": {mode: mean[:-1].reshape(shape).tolist() for mode, mean in means.items()},
                "best": {
                    mode: {"px": spatial_px[i], "frames": temporal[j], "score": float(means[mode][:-1].min())}
                    for mode, (i, j) in best.items()
                },
                "paper_score": {mode: float(mean[-1]) for mode, mean in means.items()},
            }
        )
    numbers = [windows.walk.path.numbers[f] for f in probes]
    return {"probes": numbers, "spatial_px": list(spatial_px), "temporal": list(temporal), "classes": rows}


def uniform(width_px: float, frames: int) -> AntialiasSettings:
    """Settings with the same support at all velocities."""
    return replace(
        PAPER_FILTER,
        frames=frames,
        slow_frames=frames,
        specular_frames=frames,
        support_still_px=width_px,
        support_fast_px=width_px,
        support_beyond_px=width_px,
    )


def _class(start: float, end: float, pixels_per_degree: float) -> dict[str, Any]:
    """Limits of a velocity class, and the supports of §5.2 at its centre."""
    default, is_last = PAPER_FILTER, np.isinf(end)
    middle = np.array([start + 1.0 if is_last else 0.5 * (start + end)], np.float32)
    return {
        "from_deg_s": start,
        "to_deg_s": None if is_last else end,
        "paper_px": float(spatial_support_px(middle, pixels_per_degree, default)[0]),
        "paper_frames": default.slow_frames if start < default.slow_deg_s else default.frames,
    }
