"""Table 2: how long a frame takes by each way of rendering it (§6).

Under path tracing ART, "fully ray traced frames with antialiasing", is taken as: every frame traced with as
many paths spread over the pixel as it takes until the metric sees neither aliasing nor noise against a
reference. RT, "one sample per pixel", is: every frame traced with the keyframes' own number of paths through
pixels' centres. Times of different hours are compared by what a path cost in each.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.images import read_exr, read_shading, write_shading
from enfilade.pipeline.job import Job
from enfilade.records import F32, Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from studies.cases.case import Case
from studies.cases.seen import Viewer, score_in, visible_percent
from studies.cases.speed import spread_over

__all__ = ["PAPER_MINUTES", "Crop", "art_spp", "equal_spp", "measure"]

PAPER_MINUTES = {  # Table 2, for a frame
    "atrium": {"art": 170.0, "rt": 40.0, "ibr_rt": 20.5},
    "room": {"art": 6.9, "rt": 1.5, "ibr_rt": 1.1},
}
UNSEEN_PERCENT = 1.0  # of the pixels may lie above 1 JND where the metric is said to see nothing
REFERENCE_SALT = 1  # of the seed: the reference draws other random numbers


@dataclass(frozen=True)
class Crop:
    """A part of a frame in its middle."""

    rows: slice
    columns: slice

    @staticmethod
    def of(job: Job, size: tuple[int, int]) -> Crop:
        """Cut width and height from the middle, or all there is."""
        width, height = min(size[0], job.path.width), min(size[1], job.path.height)
        left, top = (job.path.width - width) // 2, (job.path.height - height) // 2
        return Crop(slice(top, top + height), slice(left, left + width))

    @property
    def size(self) -> tuple[int, int]:
        """Height and width."""
        return self.rows.stop - self.rows.start, self.columns.stop - self.columns.start

    def pixels(self, job: Job) -> npt.NDArray[np.uint32]:
        """Flat indices of its pixels in the frame."""
        every = np.arange(job.path.width * job.path.height, dtype=np.uint32)
        chosen = every.reshape(job.path.height, job.path.width)[self.rows, self.columns]
        return np.ascontiguousarray(chosen).ravel()

    def cut(self, image: Any) -> Any:
        """That part of an image."""
        return np.ascontiguousarray(image[self.rows, self.columns])


def measure(case: Case) -> dict[str, Any]:
    """Time every way of rendering the whole walk, and judge what it gives.

    Returns
    -------
    dict
        ``ways``: of ``art``, ``rt``, ``ibr_rt`` and ``decoupled`` wall and CPU seconds of a frame
        (``wall_s``, ``cpu_s``), the latter as so many of ART's paths a pixel at the speed that the machine
        had then (``worth_paths``), ``spp`` and by ``frames`` the ``score`` and ``visible_percent`` against
        the reference in the crop, by the paper's metric in motion; ``stages`` where there are several.
        Seconds of ``art`` and ``rt`` are of the hours of ``ibr_rt``. ``art_series``: the same scores by
        number of paths. ``art_is_bound``: no number up to the most did. ``path_us``: wall and CPU
        microseconds of a path in these hours, by pixel filter.
    """
    summary, light = case.rendered("paper"), case.rendered("decoupled")
    frames = spread_over(len(case.whole.path), case.terms.crops)
    judge = _Judge(case)
    case.monitor.stage(f"{case.name}: ART and reference", len(frames) * (len(_series(case)) + 1))
    series = {spp: [judge.art(frame, spp) for frame in frames] for spp in _series(case)}
    spp, is_bound = art_spp(series)
    pixels = case.whole.path.width * case.whole.path.height
    own, path_s = case.whole.settings.trace.spp, summary["path_s"]
    ways: dict[str, dict[str, Any]] = {
        "art": {"spp": spp, "frames": series[spp], **_scaled(path_s["gaussian"], spp * pixels)},
        "rt": {"spp": own, "frames": None, **_scaled(path_s["centre"], own * pixels)},
        "ibr_rt": {"spp": own, "frames": judge.run("paper", frames), **_per_frame(summary)},
        "decoupled": {"spp": None, "frames": judge.run("decoupled", frames), **_per_frame(light)},
    }
    for name, way in ways.items():
        hour = light if name == "decoupled" else summary
        way["worth_paths"] = way["cpu_s"] / (hour["path_s"]["gaussian"]["cpu"] * pixels)
    return {
        "numbers": [case.whole.path.numbers[f] for f in frames],
        "reference_spp": case.terms.reference_spp,
        "crop": list(reversed(judge.crop.size)),
        "art_is_bound": is_bound,
        "art_series": [{"spp": n, "frames": said} for n, said in series.items()],
        "path_us": {name: {kind: 1e6 * s for kind, s in of.items()} for name, of in path_s.items()},
        "ways": ways,
    }


def art_spp(series: dict[int, list[dict[str, float]]]) -> tuple[int, bool]:
    """The least number of paths at which the metric sees nothing in any of the frames.

    Returns
    -------
    int
        That number, or the largest.
    bool
        Whether it is but a lower bound.
    """
    for spp in sorted(series):
        if all(said["visible_percent"] <= UNSEEN_PERCENT for said in series[spp]):
            return spp, False
    return max(series), True


def equal_spp(series: list[dict[str, Any]], score: float) -> float | None:
    """Number of paths at which ART is as good as something of that score, JND, by straight lines on log axes.

    Parameters
    ----------
    series
        ``art_series`` of :func:`measure`.
    score

    Returns
    -------
    float or None
        None where the score lies beyond the series.
    """
    spp = [float(row["spp"]) for row in series]
    scores = [float(np.mean([said["score"] for said in row["frames"]])) for row in series]
    if not min(scores) <= score <= max(scores):
        return None
    by_score = np.argsort(scores)
    known = np.log(np.array(scores)[by_score])
    return float(np.exp(np.interp(np.log(score), known, np.log(np.array(spp)[by_score]))))


def _series(case: Case) -> list[int]:
    return [2**k for k in range(2, int(np.log2(case.terms.most_spp)) + 1)]


class _Judge:
    """Looks at a part of frames of the whole walk."""

    def __init__(self, case: Case) -> None:
        self._case = case
        self._job = case.whole
        self.crop = Crop.of(case.whole, case.terms.crop)
        height, width = self.crop.size
        self._viewer = Viewer(self._job.viewing.cropped(width, height), self._job.settings)
        self._views = case.views(self._job)
        self._folder = case.frames_of(self._job)

    def art(self, frame: int, spp: int) -> dict[str, float]:
        """Judge a frame that was traced by itself with many paths."""
        made = self._traced(frame, spp, 0)
        self._case.monitor.advance()
        return self._said(frame, made.color)

    def run(self, name: str, frames: list[int]) -> list[dict[str, float]]:
        """Judge frames of a run folder."""
        found = []
        for frame in frames:
            number = self._job.path.numbers[frame]
            color = read_exr(self._case.folder / name / "frames" / f"{number:04d}.exr")["RGB"]
            found.append(self._said(frame, self.crop.cut(color.astype(np.float32))))
        return found

    def _said(self, frame: int, color: F32) -> dict[str, float]:
        reference = self._reference(frame)
        velocity = self.crop.cut(self._views[frame].velocity_deg_s)
        # The reference's own noise is no one's error.
        jnd = self._viewer.paper(color, reference.color, velocity, noise=reference.variance)
        everywhere = np.ones(jnd.shape, bool)
        return {
            "score": score_in(jnd, everywhere) or 0.0,
            "visible_percent": visible_percent(jnd, everywhere) or 0.0,
        }

    def _reference(self, frame: int) -> Shading:
        file = self._file(frame)
        if not file.is_file():
            write_shading(file, self._traced(frame, self._case.terms.reference_spp, REFERENCE_SALT))
            self._case.monitor.advance()
        return read_shading(file)

    def _file(self, frame: int) -> Path:
        terms = self._case.terms
        name = f"crop-{terms.crop[0]}x{terms.crop[1]}-{terms.reference_spp}"
        return self._folder / name / f"{self._job.path.numbers[frame]:04d}.exr"

    def _traced(self, frame: int, spp: int, salt: int) -> Shading:
        path, seed = self._job.path, self._job.settings.trace.seed
        made = self._case.renderer.trace(
            path.cameras[frame],
            self.crop.pixels(self._job),
            RandomKey((seed + salt) % 2**32, path.numbers[frame], Purpose.REFERENCE),
            spp=spp,
            pixel_filter=PixelFilter.GAUSSIAN,
        )
        size = self.crop.size
        return Shading(made.color.reshape(*size, 3), made.variance.reshape(size), made.dropped)


def _scaled(path_s: dict[str, float], paths: int) -> dict[str, float]:
    return {"wall_s": path_s["wall"] * paths, "cpu_s": path_s["cpu"] * paths}


def _per_frame(summary: dict[str, Any]) -> dict[str, Any]:
    """Seconds of a frame, in total and by stage, as the ledger has them."""
    count, spent = summary["frames"], summary["table2"]
    stages = {
        name: {kind: seconds / count for kind, seconds in of.items()} for name, of in spent["stages"].items()
    }
    return {"wall_s": spent["total_s"] / count, "cpu_s": spent["cpu_s"] / count, "stages": stages}
