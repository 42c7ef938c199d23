"""One scene of the case studies: its files, its jobs, and the walkthroughs rendered of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from enfilade import __version__
from enfilade.codec import read_json, write_json
from enfilade.monitor import Monitor
from enfilade.path import load_path
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.job import Job, open_renderer
from enfilade.pipeline.survey import Survey, survey_path
from enfilade.pipeline.views import Views
from enfilade.records import CameraPath
from enfilade.renderer import Renderer
from enfilade.scenes import write_scene
from enfilade.settings import Settings
from enfilade.studies.cases.plain import PlainlyLit
from enfilade.studies.cases.terms import PIXEL_M, Terms
from enfilade.studies.cases.windows import Windows

__all__ = ["Case", "stretch_of"]

PLAIN_SPP = 64  # rays a pixel of a reference without noise
STRETCH_AT = 0.3  # of the path: where the stretch lies that the dearer contestants render


class Case:
    """A scene, and what was made of it.

    Parameters
    ----------
    name : {"room", "atrium"}
    terms
    folder
        Of this scene; made if it is not there. It holds ``scene/``, a run folder for each walkthrough,
        and the results as JSON.
    monitor

    Attributes
    ----------
    name, terms, folder, monitor
    """

    def __init__(self, name: str, terms: Terms, folder: Path, monitor: Monitor) -> None:
        self.name = name
        self.terms = terms
        self.folder = folder
        self.monitor = monitor

    @cached_property
    def whole(self) -> Job:
        """The whole walk, by the paper's method."""
        return self._job(self.terms.size, self.terms.spp)

    @cached_property
    def short(self) -> Job:
        """The same at the size of the windows."""
        return self._job(self.terms.window_size, self.terms.window_spp)

    @cached_property
    def renderer(self) -> Renderer:
        """The scene, loaded."""
        return open_renderer(self.whole.scene, self.whole.settings.trace)

    @cached_property
    def survey(self) -> Survey:
        """Velocities of the whole walk."""
        return Survey.from_dict(self.stored("survey", lambda: self._surveyed(self.whole), ("preset", "size")))

    @cached_property
    def short_survey(self) -> Survey:
        """Velocities of the walk at the size of the windows."""
        return Survey.from_dict(
            self.stored("survey-short", lambda: self._surveyed(self.short), ("preset", "window_size"))
        )

    @cached_property
    def windows(self) -> Windows:
        """Short sequences under the scene's own light."""
        return Windows(
            self.short, self.renderer, self.short_survey, self.folder / "windows", self.monitor,
            self.views(self.short), self.terms.window_reference_spp,
        )  # fmt: skip

    @cached_property
    def plain_windows(self) -> Windows:
        """Short sequences without noise, at the size of the whole walk."""
        return Windows(
            self.whole, PlainlyLit(self.renderer), self.survey, None, self.monitor,
            self.views(self.whole), PLAIN_SPP,
        )  # fmt: skip

    def views(self, job: Job) -> Views:
        """What the cameras of a job see."""
        return Views(self.renderer, job.path, job.viewing, Costs())

    @property
    def stretch(self) -> range:
        """Frames that `decoupled` renders, of which some are judged."""
        return stretch_of(self.whole.path, self.terms.decoupled_frames)

    def rendered(self) -> dict[str, Any]:
        """Render the whole walk by the paper's method, or go on with it: its summary."""
        return self._rendered("paper", self.whole)

    def decoupled(self) -> dict[str, Any]:
        """Render the stretch by `decoupled`: its summary."""
        path, frames = self.whole.path, self.stretch
        part = CameraPath(
            path.cameras[frames.start : frames.stop], path.numbers[frames.start : frames.stop], path.fps
        )
        return self._rendered("decoupled", replace(self.whole, path=part, method="decoupled"))

    def stored(self, name: str, make: Callable[[], Any], fields: Sequence[str]) -> Any:
        """A result from its file, made now where the file is missing or was made on other terms.

        Parameters
        ----------
        name
        make
        fields
            Of the terms, on which the result depends.
        """
        file = self.folder / f"{name}.json"
        terms = self.terms.to_dict()
        made_by = {"version": __version__, "terms": {field: terms[field] for field in fields}}
        if file.is_file():
            held = read_json(file)
            if held.get("made_by") == made_by:
                return held["result"]
            self.monitor.say(f"{file} was made on other terms; it is made anew")
        result = make()
        write_json(file, {"made_by": made_by, "result": result})
        return read_json(file)["result"]  # as a later call will read it

    def _job(self, size: tuple[int, int], spp: int) -> Job:
        file = self.folder / "scene" / "scene.xml"
        path_file = file.with_name("camera_path.json")
        if not path_file.is_file():  # which is written last
            write_scene(self.name, file.parent, preset=self.terms.preset)
        tables = {"viewing": {"diagonal_m": math.hypot(*size) * PIXEL_M}, "trace": {"spp": spp}}
        return Job(file, load_path(path_file, size=size), Settings.from_tables(tables), "paper")

    def _surveyed(self, job: Job) -> dict[str, Any]:
        return survey_path(self.views(job), job.path, job.settings, self.monitor).to_dict()

    def _rendered(self, name: str, job: Job) -> dict[str, Any]:
        from enfilade.pipeline.walkthrough import render

        folder = self.folder / name
        summary = folder / "summary.json"  # which is written last
        if summary.is_file():
            found: dict[str, Any] = read_json(summary)
            if _is_of(found, job):
                return found
        return render(job, folder, self.monitor)


def _is_of(summary: dict[str, Any], job: Job) -> bool:
    """Whether a finished run is one of this job, as far as its summary tells."""
    asked = {
        "method": job.method,
        "frames": len(job.path),
        "size": [job.path.width, job.path.height],
        "spp": job.settings.trace.spp,
    }
    return all(summary[key] == value for key, value in asked.items())


def stretch_of(path: CameraPath, length: int) -> range:
    """Frames of a path, `length` of them or all there are, from three tenths of its length on."""
    length = min(length, len(path))
    start = min(round(STRETCH_AT * len(path)), len(path) - length)
    return range(start, start + length)
