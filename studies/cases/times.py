"""Table 2: time of a frame by each way of rendering (§6).

Under path tracing ART, "fully ray traced frames with antialiasing", is every frame traced with paths spread
over the pixel, as many as it takes until the metric sees neither aliasing nor noise against a reference. RT,
"one sample per pixel", is every frame traced with the keyframes' spp through the pixels' centres. Times of
different hours are compared by the cost of a path in each.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enfilade.images import read_exr
from enfilade.methods.base import FRAMES
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Shading
from enfilade.renderer import PixelFilter, Purpose
from enfilade.runs.folder import RunFolder
from studies.cases.case import Case
from studies.cases.seen import Scores, Viewer, scores_in
from studies.cases.speed import spread_over
from studies.cases.windows import other_seed, stored
from studies.crops import Crop
from studies.progress import counted

PAPER_MINUTES = {  # Table 2, for a frame
    "atrium": {"art": 170.0, "rt": 40.0, "ibr_rt": 20.5},
    "room": {"art": 6.9, "rt": 1.5, "ibr_rt": 1.1},
}
UNSEEN_PERCENT = 1.0  # of the pixels may lie above 1 JND where the metric is said to see nothing


def measure(case: Case) -> dict[str, Any]:
    """Time every way of rendering the whole walk, and measure its quality.

    Returns
    -------
    dict
        ``ways``: of ``art``, ``rt``, ``ibr_rt`` and ``decoupled`` wall and CPU seconds of a frame
        (``wall_s``, ``cpu_s``), the latter also as a number of ART's paths a pixel at the speed of the
        machine in that hour (``worth_paths``), ``spp``, and by ``frames`` the ``score`` and
        ``visible_percent`` against the reference in the crop, by the paper's metric in motion; ``stages`` of
        those that have several. Seconds of ``art`` and ``rt`` are of the hours of ``ibr_rt``. ``art_series``:
        the same scores by spp. ``art_is_bound``: even the largest spp leaves visible differences.
        ``path_us``: wall and CPU microseconds of a path in these hours, by pixel filter.
    """
    summary, decoupled = case.rendered("paper"), case.rendered("decoupled")
    frames = spread_over(len(case.whole.path), case.terms.crops)
    quality = _Quality(case)
    series: dict[int, list[Scores]] = {}
    powers = range(2, case.terms.most_spp.bit_length())
    for spp in counted([2**k for k in powers], "ART", case.monitor):
        series[spp] = [quality.of_art(frame, spp) for frame in frames]
    scores = {name: [quality.of_run(name, f) for f in frames] for name in ("paper", "decoupled")}
    spp, is_bound = art_spp(series)
    pixels = case.whole.path.width * case.whole.path.height
    own, path_s = case.terms.spp, summary["path_s"]
    ways: dict[str, dict[str, Any]] = {
        "art": {"spp": spp, "frames": series[spp], **_scaled(path_s["gaussian"], spp * pixels)},
        "rt": {"spp": own, "frames": None, **_scaled(path_s["centre"], own * pixels)},
        "ibr_rt": {"spp": own, "frames": scores["paper"], **_per_frame(summary)},
        "decoupled": {"spp": None, "frames": scores["decoupled"], **_per_frame(decoupled)},
    }
    for name, way in ways.items():
        hour = decoupled if name == "decoupled" else summary
        way["worth_paths"] = way["cpu_s"] / (hour["path_s"]["gaussian"]["cpu"] * pixels)
    rows, columns = quality.crop
    return {
        "numbers": [case.whole.path.numbers[f] for f in frames],
        "reference_spp": case.terms.reference_spp,
        "crop": [columns.stop - columns.start, rows.stop - rows.start],
        "art_is_bound": is_bound,
        "art_series": [{"spp": n, "frames": of} for n, of in series.items()],
        "path_us": {name: {kind: 1e6 * s for kind, s in of.items()} for name, of in path_s.items()},
        "ways": ways,
    }


def art_spp(series: dict[int, list[Scores]]) -> tuple[int, bool]:
    """The least spp at which the metric sees nothing in any frame; or the largest, and True: a bound."""
    for spp in sorted(series):
        if all((of["visible_percent"] or 0.0) <= UNSEEN_PERCENT for of in series[spp]):
            return spp, False
    return max(series), True


def equal_spp(series: list[dict[str, Any]], score: float) -> float | None:
    """The spp at which ART has a score, JND, interpolated linearly on logarithmic axes.

    None where the score lies beyond the series.
    """
    spp = [float(row["spp"]) for row in series]
    scores = [float(np.mean([of["score"] for of in row["frames"]])) for row in series]
    if not min(scores) <= score <= max(scores):
        return None
    order = np.argsort(scores)
    known = np.log(np.array(scores)[order])
    return float(np.exp(np.interp(np.log(score), known, np.log(np.array(spp)[order]))))


def middle(size: tuple[int, int], width: int, height: int) -> Crop:
    """Rows and columns of that width and height, or all there are, in the middle of an image of a size."""
    width, height = min(size[0], width), min(size[1], height)
    left, top = (size[0] - width) // 2, (size[1] - height) // 2
    return slice(top, top + height), slice(left, left + width)


class _Quality:
    """Scores of the middle of frames of the whole walk against their references."""

    def __init__(self, case: Case) -> None:
        self._case, self._walk, self._reference_walk = case, case.walk, other_seed(case.walk)
        path = case.walk.path
        self.crop = middle((path.width, path.height), *case.terms.crop)
        self._where = np.zeros((path.height, path.width), np.bool_)
        self._where[self.crop] = True
        height, width = self._where[self.crop].shape
        self._viewer = Viewer(case.walk.viewing.cropped(width, height), case.walk.settings)

    def of_art(self, frame: int, spp: int) -> Scores:
        """Scores of a frame that is path traced by itself."""
        return self._scores(frame, self._traced(self._walk, frame, spp).color)

    def of_run(self, name: str, frame: int) -> Scores:
        """Scores of a frame of a run folder."""
        file = RunFolder.read(self._case.folder / name).file_of(FRAMES, self._walk.path.numbers[frame])
        return self._scores(frame, self._cut(read_exr(file)["RGB"].astype(np.float32)))

    def _scores(self, frame: int, color: F32) -> Scores:
        stem = self._case.folder / "crops" / f"{self._walk.path.numbers[frame]:04d}"
        spp = self._case.terms.reference_spp
        reference = stored(stem, lambda: self._traced(self._reference_walk, frame, spp))
        velocity = self._cut(self._walk.view(frame).velocity_deg_s)
        # The reference's own noise is not an error of the test.
        jnd = self._viewer.paper(color, reference.color, velocity, noise=reference.variance)
        return scores_in(jnd, np.ones(jnd.shape, np.bool_))

    def _traced(self, walk: Walkthrough, frame: int, spp: int) -> Shading:
        purpose, pixel_filter = Purpose.REFERENCE, PixelFilter.GAUSSIAN
        image = walk.trace(frame, self._where, purpose, spp=spp, pixel_filter=pixel_filter).to_image(
            self._where
        )
        return Shading(self._cut(image.color), self._cut(image.variance), image.dropped)

    def _cut(self, image: F32) -> F32:
        return np.ascontiguousarray(image[self.crop])


def _scaled(path_s: dict[str, float], paths: int) -> dict[str, float]:
    return {"wall_s": path_s["wall"] * paths, "cpu_s": path_s["cpu"] * paths}


def _per_frame(summary: dict[str, Any]) -> dict[str, Any]:
    """Seconds of a frame, in total and by stage, as the ledger has them."""
    count, spent = summary["frames"], summary["time_s"]
    stages = {
        name: {kind: seconds / count for kind, seconds in of.items()} for name, of in spent["stages"].items()
    }
    return {"wall_s": spent["total_s"] / count, "cpu_s": spent["cpu_s"] / count, "stages": stages}
