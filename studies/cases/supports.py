"""§5.2: how wide the antialiasing filter should be at each velocity.

Uniform supports, spatial and temporal, are tried on traced frames sampled at pixels' centres, and what comes
out is compared with what should have: the same frame through a pixel filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from enfilade.methods.paper.support import spatial_support_px
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.records import F32, Mask
from enfilade.settings import AntialiasSettings
from studies.cases.filtering import antialiased
from studies.cases.seen import Viewer, score_in
from studies.cases.windows import Windows

__all__ = ["Supports", "measure"]

LEAST_PIXELS = 500  # of a velocity's class, over all probes: fewer say nothing


@dataclass(frozen=True)
class Supports:
    """What is tried.

    Attributes
    ----------
    spatial_px : tuple of float
        1 is no filter.
    temporal : tuple of int
        Frames.
    edges_deg_s : tuple of float
        Of the classes of velocity, rising; the last one has no end.
    """

    spatial_px: tuple[float, ...] = (1.0, 3.0, 5.0, 7.0, 9.0, 11.0)
    temporal: tuple[int, ...] = (1, 5, 11, 15, 21)
    edges_deg_s: tuple[float, ...] = (0.0, 0.15, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)


def measure(windows: Windows, probes: list[int], terms: Supports) -> dict[str, Any]:
    """Score every support in every class of velocity.

    Specular surfaces are left out: what they show does not move as they do (§5.4).

    Returns
    -------
    dict
        ``classes``: of each its ends (None: no end), ``pixels``, what §5.2 asks for (``paper_px``,
        ``paper_frames``), and ``scores``: by mode of the metric, a row for each spatial and a column for
        each temporal support, JND in motion; ``best``: by mode, the supports with the least score;
        ``paper_score``: that of the paper's adaptive filter. ``spatial_px``, ``temporal``.
    """
    windows.monitor.stage("filter supports", len(probes) * len(terms.spatial_px))
    viewer = Viewer(windows.job.viewing, windows.job.settings)
    sums = _Sums(terms)
    for frame in probes:
        view = windows.view(frame)
        valid = view.geometry.is_hit & ~view.geometry.is_specular
        reference = windows.reference(frame).color
        places = [valid & where for where in _classes(view.speed_deg_s, terms.edges_deg_s)]

        def judged(settings: AntialiasSettings, at: int = frame, wanted: F32 = reference) -> dict[str, F32]:
            color = antialiased(windows, at, lambda f: windows.traced(f).color, settings)
            velocity = windows.view(at).velocity_deg_s
            return {
                "paper": viewer.paper(color, wanted, velocity),
                "modern": viewer.modern(color, wanted, velocity),
            }

        sums.add_paper(judged(windows.job.settings.antialias), places)
        for row, width in enumerate(terms.spatial_px):
            for column, count in enumerate(terms.temporal):
                sums.add(row, column, judged(uniform(width, count)), places)
            windows.monitor.advance()
    return {
        "probes": [windows.job.path.numbers[f] for f in probes],
        "spatial_px": list(terms.spatial_px),
        "temporal": list(terms.temporal),
        "classes": sums.rows(windows.job.viewing.pixels_per_degree),
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

    MODES = ("paper", "modern")

    def __init__(self, terms: Supports) -> None:
        self._terms = terms
        count = len(terms.edges_deg_s)
        shape = count, len(terms.spatial_px), len(terms.temporal)
        self._sums = {mode: np.zeros(shape) for mode in self.MODES}
        self._paper = {mode: np.zeros(count) for mode in self.MODES}
        self._pixels = np.zeros(count, np.int64)

    def add(self, row: int, column: int, jnd: dict[str, F32], places: list[Mask]) -> None:
        """Add a map for one support."""
        for mode in self.MODES:
            self._sums[mode][:, row, column] += [_raised(jnd[mode], where) for where in places]

    def add_paper(self, jnd: dict[str, F32], places: list[Mask]) -> None:
        """Add a map for the paper's filter, and count the pixels."""
        for mode in self.MODES:
            self._paper[mode] += [_raised(jnd[mode], where) for where in places]
        self._pixels += [int(where.sum()) for where in places]

    def rows(self, pixels_per_degree: float) -> list[dict[str, Any]]:
        """The classes that have enough pixels."""
        edges = self._terms.edges_deg_s
        plain = AntialiasSettings()
        found = []
        for k, (a, b) in enumerate(zip(edges, [*edges[1:], None], strict=True)):
            if self._pixels[k] < LEAST_PIXELS:
                continue
            scores = {mode: _rooted(self._sums[mode][k] / self._pixels[k]) for mode in self.MODES}
            middle = np.array([a + 1.0 if b is None else 0.5 * (a + b)], np.float32)
            found.append(
                {
                    "from_deg_s": a,
                    "to_deg_s": b,
                    "pixels": int(self._pixels[k]),
                    "paper_px": float(spatial_support_px(middle, pixels_per_degree, plain)[0]),
                    "paper_frames": plain.slow_frames if a < plain.slow_deg_s else plain.frames,
                    "scores": {mode: s.tolist() for mode, s in scores.items()},
                    "best": {mode: self._best(s) for mode, s in scores.items()},
                    "paper_score": {
                        mode: float(_rooted(self._paper[mode][k] / self._pixels[k])) for mode in self.MODES
                    },
                }
            )
        return found

    def _best(self, scores: Any) -> dict[str, float]:
        row, column = np.unravel_index(int(np.argmin(scores)), scores.shape)
        return {
            "px": self._terms.spatial_px[row],
            "frames": self._terms.temporal[column],
            "score": float(scores[row, column]),
        }


def _raised(jnd: F32, where: Mask) -> float:
    score = score_in(jnd, where)
    return 0.0 if score is None else score**POOLING_EXPONENT * float(where.sum())


def _rooted(mean: Any) -> Any:
    return mean ** (1.0 / POOLING_EXPONENT)
