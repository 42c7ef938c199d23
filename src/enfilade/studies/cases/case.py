"""One scene of the case studies: its files, its jobs, and the walkthroughs rendered of it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from enfilade import __version__
from enfilade.codec import read_json, write_json
from enfilade.errors import RunFolderError
from enfilade.monitor import Monitor
from enfilade.path import load_path
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.job import Job, open_renderer
from enfilade.pipeline.survey import Survey, survey_path
from enfilade.pipeline.views import Views
from enfilade.records import CameraPath
from enfilade.renderer import Renderer
from enfilade.scenes import SceneFiles, write_scene
from enfilade.settings import Settings
from enfilade.studies.cases.plain import PlainlyLit
from enfilade.studies.cases.terms import PIXEL_M, Terms
from enfilade.studies.cases.windows import Windows

__all__ = ["Case", "stretch_of"]

PLAIN_SPP = 64  # rays a pixel of a reference without noise
MADE_BY = "made_by.json"  # in the scene's folder, written last
DIGITS = 12  # of a job's checksum, by which its frames are kept
STRETCH_AT = 0.3  # of the path: where the stretch lies that the dearer contestants render


class Case:
    """A scene, and what was made of it.

    Parameters
    ----------
    name : {"room", "atrium"}
    terms
    folder
        Of this scene; made if it is not there. It holds ``scene/``, a run folder for each walkthrough,
        traced frames of sequences in ``windows/``, and the results as JSON.
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
            self.short, self.renderer, self.short_survey, self.frames_of(self.short), self.monitor,
            self.views(self.short), self.terms.window_reference_spp,
        )  # fmt: skip

    @cached_property
    def plain_windows(self) -> Windows:
        """Short sequences without noise, at the size of the whole walk."""
        return Windows(
            self.whole, PlainlyLit(self.renderer), self.survey, None, self.monitor,
            self.views(self.whole), PLAIN_SPP,
        )  # fmt: skip

    def frames_of(self, job: Job) -> Path:
        """Folder in which traced frames of a job are kept, and those of no other scene or settings."""
        identity = json.dumps(job.identity(), sort_keys=True)
        return self.folder / "windows" / hashlib.sha256(identity.encode()).hexdigest()[:DIGITS]

    def views(self, job: Job) -> Views:
        """What the cameras of a job see."""
        return Views(self.renderer, job.path, job.viewing, Costs())

    @property
    def stretch(self) -> range:
        """Frames that `decoupled` renders, of which some are judged."""
        return stretch_of(self.whole.path, self.terms.decoupled_frames)

    def check(self) -> None:
        """Refuse a folder with the scene of another preset or version: nothing in it would be of use.

        Raises
        ------
        RunFolderError
        """
        file = self.folder / "scene" / MADE_BY
        if file.is_file() and (there := read_json(file)) != self._scene_of:
            was, now = json.dumps(there), json.dumps(self._scene_of)
            raise RunFolderError(
                f"{self.folder} holds other case studies: {was} there, {now} now. Choose another --out, or "
                f"delete {self.folder} to begin anew"
            )

    def rendered(self) -> dict[str, Any]:
        """Render the whole walk by the paper's method, or go on with it: its summary.

        Raises
        ------
        RunFolderError
            The folder holds a run of another scene, version or settings. It is not replaced: it took long.
        """
        return self._rendered("paper", self.whole)

    def decoupled(self) -> dict[str, Any]:
        """Render the stretch by `decoupled`, or go on with it: its summary. Raises as :meth:`rendered`."""
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
        is_there = file.is_file()
        if is_there:
            held = read_json(file)
            if held.get("made_by") == made_by:
                return held["result"]
        result = make()
        write_json(file, {"made_by": made_by, "result": result})
        if is_there:
            self.monitor.say(f"{file} was made on other terms, and was made anew")
        return read_json(file)["result"]  # as a later call will read it

    def _job(self, size: tuple[int, int], spp: int) -> Job:
        files = self._scene
        tables = {"viewing": {"diagonal_m": math.hypot(*size) * PIXEL_M}, "trace": {"spp": spp}}
        path = load_path(files.path, size=size)
        return Job(files.scene, path, Settings.from_tables(tables), "paper")

    @cached_property
    def _scene(self) -> SceneFiles:
        """The scene's files, written unless they are there."""
        self.check()
        folder = self.folder / "scene"
        if not (folder / MADE_BY).is_file():
            write_scene(self.name, folder, preset=self.terms.preset)
            write_json(folder / MADE_BY, self._scene_of)
        return SceneFiles(folder / "scene.xml", folder / "camera_path.json")

    @property
    def _scene_of(self) -> dict[str, str]:
        return {"preset": self.terms.preset, "version": __version__}

    def _surveyed(self, job: Job) -> dict[str, Any]:
        return survey_path(self.views(job), job.path, job.settings, self.monitor).to_dict()

    def _rendered(self, name: str, job: Job) -> dict[str, Any]:
        from enfilade.pipeline.walkthrough import render

        return render(job, self.folder / name, self.monitor)


def stretch_of(path: CameraPath, length: int) -> range:
    """Frames of a path, `length` of them or all there are, from three tenths of its length on."""
    length = min(length, len(path))
    start = min(round(STRETCH_AT * len(path)), len(path) - length)
    return range(start, start + length)
