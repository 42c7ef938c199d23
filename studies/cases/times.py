"""Time of a frame by each method of rendering (§6, Table 2).

ART, "fully ray traced frames with antialiasing", is path tracing of every frame with a pixel filter and the
smallest spp without visible differences from a reference. RT, "one sample per pixel", is path tracing of
every frame through the pixels' centres, with the spp of keyframes. Times that were measured under different
load are compared by the cost of a path.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from enfilade.images import read_exr
from enfilade.methods.base import FRAMES
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Shading
from enfilade.renderer import PixelFilter, Purpose
from enfilade.runs.folder import RunFolder
from studies.cases.case import Case
from studies.cases.speed import even_positions
from studies.cases.visibility import Scores, Viewer, scores_in
from studies.cases.windows import load_or_render, reseeded
from studies.crops import Crop
from studies.progress import counted

PAPER_MINUTES = {  # Table 2, for a frame
    "atrium": {"art": 170.0, "rt": 40.0, "ibr_rt": 20.5},
    "room": {"art": 6.9, "rt": 1.5, "ibr_rt": 1.1},
}
MOST_VISIBLE_PERCENT = 1.0  # of the pixels above 1 JND, in images without visible differences


def measure(case: Case) -> dict[str, Any]:
    """Measure time and quality of the whole walk by each method.

    Returns
    -------
    dict
        ``methods``: for ``art``, ``rt``, ``ibr_rt`` and ``decoupled`` wall and CPU seconds of a frame
        (``wall_s``, ``cpu_s``), the number of paths of ART a pixel of the same CPU time
        (``equivalent_paths``), ``spp``, for each of ``frames`` the ``score`` and ``visible_percent`` against
        the reference in the crop, by the paper's metric in motion. Seconds of ``art`` and ``rt`` were
        measured together with ``ibr_rt``. ``art_series``: scores of ART by spp.
        ``art_is_bound``: whether even the largest spp has visible differences. ``path_us``: wall and CPU
        microseconds of a path, by pixel filter.
    """
    summary, decoupled = case.rendered("paper"), case.rendered("decoupled")
    frames = even_positions(len(case.whole.path), case.extent.crops)
    quality = _Quality(case)
    series: dict[int, list[Scores]] = {}
    powers = range(2, case.extent.most_spp.bit_length())
    for spp in counted([2**k for k in powers], "ART", case.monitor):
        series[spp] = [quality.score_art(frame, spp) for frame in frames]
    scores = {name: [quality.score_run(name, f) for f in frames] for name in ("paper", "decoupled")}
    spp, is_bound = art_spp(series)
    pixels = case.whole.path.width * case.whole.path.height
    rt_spp, path_s = case.extent.spp, summary["path_s"]
    methods: dict[str, dict[str, Any]] = {
        "art": {"spp": spp, "frames": series[spp], **_scaled(path_s["gaussian"], spp * pixels)},
        "rt": {"spp": rt_spp, "frames": None, **_scaled(path_s["centre"], rt_spp * pixels)},
        "ibr_rt": {"spp": rt_spp, "frames": scores["paper"], **_per_frame(summary)},
        "decoupled": {"spp": None, "frames": scores["decoupled"], **_per_frame(decoupled)},
    }
    for name, method in methods.items():
        run = decoupled if name == "decoupled" else summary
        method["equivalent_paths"] = method["cpu_s"] / (run["path_s"]["gaussian"]["cpu"] * pixels)
    rows, columns = quality.crop
    return {
        "numbers": [case.whole.path.numbers[f] for f in frames],
        "reference_spp": case.extent.reference_spp,
        "crop": [columns.stop - columns.start, rows.stop - rows.start],
        "art_is_bound": is_bound,
        "art_series": [{"spp": n, "frames": of} for n, of in series.items()],
        "path_us": {name: {kind: 1e6 * s for kind, s in of.items()} for name, of in path_s.items()},
        "methods": methods,
    }


def art_spp(series: dict[int, list[Scores]]) -> tuple[int, bool]:
    """Least spp without visible differences, and False; or the largest spp, and True (a lower bound)."""
    for spp in sorted(series):
        if all((of["visible_percent"] or 0.0) <= MOST_VISIBLE_PERCENT for of in series[spp]):
            return spp, False
    return max(series), True


def equal_spp(series: list[dict[str, Any]], score: float) -> float | None:
    """The spp at which ART has a score, JND, interpolated on logarithmic axes.

    None where the score is outside the series.
    """
    spp = [float(row["spp"]) for row in series]
    scores = [float(np.mean([of["score"] for of in row["frames"]])) for row in series]
    if not min(scores) <= score <= max(scores):
        return None
    order = np.argsort(scores)
    known = np.log(np.array(scores)[order])
    return float(np.exp(np.interp(np.log(score), known, np.log(np.array(spp)[order]))))


def central_crop(size: tuple[int, int], width: int, height: int) -> Crop:
    """Central crop of an image, of a width and height that are clipped to its size."""
    width, height = min(size[0], width), min(size[1], height)
    left, top = (size[0] - width) // 2, (size[1] - height) // 2
    return slice(top, top + height), slice(left, left + width)


class _Quality:
    """Scores of the central crop of frames against their references."""

    def __init__(self, case: Case) -> None:
        self._case, self._walk, second = case, case.walk, reseeded(case.walk)
        self._reference_walks = second, reseeded(second)
        path = case.walk.path
        self.crop = central_crop((path.width, path.height), *case.extent.crop)
        self._is_in_crop = np.zeros((path.height, path.width), np.bool_)
        self._is_in_crop[self.crop] = True
        height, width = self._is_in_crop[self.crop].shape
        self._viewer = Viewer(case.walk.viewing.cropped(width, height), case.walk.settings)

    def score_art(self, frame: int, spp: int) -> Scores:
        """Scores of a path-traced frame."""
        return self._scores(frame, self._traced(self._walk, frame, spp).color)

    def score_run(self, name: str, frame: int) -> Scores:
        """Scores of a frame of a run folder."""
        file = RunFolder.read(self._case.folder / name).file_of(FRAMES, self._walk.path.numbers[frame])
        return self._scores(frame, self._cropped(read_exr(file)["RGB"].astype(np.float32)))

    def _scores(self, frame: int, color: F32) -> Scores:
        stem = self._case.folder / "crops" / f"{self._walk.path.numbers[frame]:04d}"
        spp = self._case.extent.reference_spp // 2
        halves = [
            load_or_render(
                stem.with_name(f"{stem.name}-{half}"), partial(self._traced, walk, frame, spp)
            ).color
            for half, walk in enumerate(self._reference_walks, 1)
        ]
        velocity = self._cropped(self._walk.view(frame).velocity_deg_s)
        # The noise of the reference is not an error of the test.
        jnd = self._viewer.halves((color, color), halves, velocity)
        return scores_in(jnd, np.ones(jnd.shape, np.bool_))

    def _traced(self, walk: Walkthrough, frame: int, spp: int) -> Shading:
        purpose, pixel_filter = Purpose.REFERENCE, PixelFilter.GAUSSIAN
        where = self._is_in_crop
        traced = walk.trace(frame, purpose, spp=spp, pixel_filter=pixel_filter, where=where)
        image = traced.to_image(where)
        return Shading(self._cropped(image.color), self._cropped(image.variance), image.dropped)

    def _cropped(self, image: F32) -> F32:
        return np.ascontiguousarray(image[self.crop])


def _scaled(path_s: dict[str, float], paths: int) -> dict[str, float]:
    return {"wall_s": path_s["wall"] * paths, "cpu_s": path_s["cpu"] * paths}


def _per_frame(summary: dict[str, Any]) -> dict[str, Any]:
    """Seconds of a frame, from the ledger."""
    count, spent = summary["frames"], summary["time_s"]
    return {"wall_s": spent["total_s"] / count, "cpu_s": spent["cpu_s"] / count}
