"""§5.2: best width of the antialiasing filter at each velocity.

Uniform supports, spatial and temporal, are applied to traced frames sampled at pixels' centres, and the
results are compared with the reference: the same frame through a pixel filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from enfilade.methods.paper.support import spatial_support_px
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.records import F32, Mask
from enfilade.settings import AntialiasSettings
from studies.cases.case import Case
from studies.cases.filtering import antialiased
from studies.cases.seen import score_in
from studies.cases.windows import Windows
from studies.progress import counted

__all__ = ["Supports", "compare", "measure", "uniform"]

MIN_PIXELS = 500  # of a class of velocity, over all probes: fewer are not representative
MODES = ("paper", "modern")


@dataclass(frozen=True)
class Supports:
    """Candidates.

    Attributes
    ----------
    spatial_px : tuple of float
        1 is no filter.
    temporal : tuple of int
        Frames.
    edges_deg_s : tuple of float
        Of the classes of velocity, rising; the last class has no end.
    """

    spatial_px: tuple[float, ...] = (1.0, 3.0, 5.0, 7.0, 9.0, 11.0)
    temporal: tuple[int, ...] = (1, 5, 11, 15, 21)
    edges_deg_s: tuple[float, ...] = (0.0, 0.15, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)


def measure(case: Case) -> dict[str, Any]:
    """Scores without noise (``plain``) and path traced (``traced``); see :func:`compare`."""
    return {
        "plain": compare(case.plain_windows, case.probes, Supports()),
        "traced": compare(case.windows, case.traced_probes, Supports()),
    }


def compare(windows: Windows, probes: list[int], terms: Supports) -> dict[str, Any]:
    """Score every support in every class of velocity.

    Specular surfaces are left out: what they show does not move as they do (§5.4).

    Returns
    -------
    dict
        ``classes``: of each its ends (None: no end), ``pixels``, the supports of §5.2 (``paper_px``,
        ``paper_frames``), and ``scores``: by mode of the metric, a row for each spatial and a column for each
        temporal support, JND in motion; ``best``: by mode, the supports with the least score;
        ``paper_score``: that of the paper's adaptive filter. ``spatial_px``, ``temporal``.
    """
    viewer, paper = windows.viewer, windows.walk.settings[AntialiasSettings]
    grid = [
        (row, column, uniform(width, count))
        for row, width in enumerate(terms.spatial_px)
        for column, count in enumerate(terms.temporal)
    ]
    sums = _Sums(terms)
    for frame in counted(probes, "filter supports", windows.monitor):
        view = windows.view(frame)
        valid = view.geometry.is_hit & ~view.geometry.is_specular
        reference, velocity = windows.reference(frame).color, view.velocity_deg_s
        classes = [valid & where for where in _classes(view.speed_deg_s, terms.edges_deg_s)]
        sums.pixels += [int(where.sum()) for where in classes]
        for row, column, settings in [*grid, (None, None, paper)]:
            color = antialiased(windows, frame, settings)
            for mode in MODES:
                jnd = getattr(viewer, mode)(color, reference, velocity)
                sums.add(mode, row, column, [_raised(jnd, where) for where in classes])
    return {
        "probes": [windows.walk.path.numbers[f] for f in probes],
        "spatial_px": list(terms.spatial_px),
        "temporal": list(terms.temporal),
        "classes": sums.rows(windows.walk.viewing.pixels_per_degree),
    }


def uniform(width_px: float, frames: int) -> AntialiasSettings:
    """The same support at all velocities, which does not end where half a pixel is covered."""
    return AntialiasSettings(
        frames=frames,
        slow_frames=frames,
        specular_frames=frames,
        support_still_px=width_px,
        support_fast_px=width_px,
        support_beyond_px=width_px,
    )


def _classes(speed_deg_s: F32, edges: tuple[float, ...]) -> list[Mask]:
    ends = [*edges[1:], np.inf]
    return [(speed_deg_s >= a) & (speed_deg_s < b) for a, b in zip(edges, ends, strict=True)]


class _Sums:
    """Sums of J^3.5 over the pixels of all probes, by mode, class and support."""

    def __init__(self, terms: Supports) -> None:
        self._terms = terms
        count = len(terms.edges_deg_s)
        self._sums = {mode: np.zeros((count, len(terms.spatial_px), len(terms.temporal))) for mode in MODES}
        self._paper = {mode: np.zeros(count) for mode in MODES}
        self.pixels = np.zeros(count, np.int64)

    def add(self, mode: str, row: int | None, column: int | None, sums: list[float]) -> None:
        """Add the classes' sums of a uniform support, or of the paper's filter (None)."""
        if row is None:
            self._paper[mode] += sums
        else:
            self._sums[mode][:, row, column] += sums

    def rows(self, pixels_per_degree: float) -> list[dict[str, Any]]:
        """The classes that have enough pixels."""
        edges, plain, found = self._terms.edges_deg_s, AntialiasSettings(), []
        for k, (a, b) in enumerate(zip(edges, [*edges[1:], None], strict=True)):
            if self.pixels[k] < MIN_PIXELS:
                continue
            scores = {mode: _rooted(self._sums[mode][k] / self.pixels[k]) for mode in MODES}
            middle = np.array([a + 1.0 if b is None else 0.5 * (a + b)], np.float32)
            row = {
                "from_deg_s": a,
                "to_deg_s": b,
                "pixels": int(self.pixels[k]),
                "paper_px": float(spatial_support_px(middle, pixels_per_degree, plain)[0]),
                "paper_frames": plain.slow_frames if a < plain.slow_deg_s else plain.frames,
                "scores": {mode: s.tolist() for mode, s in scores.items()},
                "best": {mode: self._best(s) for mode, s in scores.items()},
                "paper_score": {m: float(_rooted(self._paper[m][k] / self.pixels[k])) for m in MODES},
            }
            found.append(row)
        return found

    def _best(self, scores: Any) -> dict[str, float]:
        row, column = np.unravel_index(int(np.argmin(scores)), scores.shape)
        px, frames = self._terms.spatial_px[row], self._terms.temporal[column]
        return {"px": px, "frames": frames, "score": float(scores[row, column])}


def _raised(jnd: F32, where: Mask) -> float:
    score = score_in(jnd, where)
    return 0.0 if score is None else score**POOLING_EXPONENT * float(where.sum())


def _rooted(mean: Any) -> Any:
    return mean ** (1.0 / POOLING_EXPONENT)
