"""One scene of the case studies: its files, its jobs, and the walkthroughs rendered of it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from enfilade import __version__
from enfilade.camera import load_path
from enfilade.errors import RunFolderError
from enfilade.files import read_json, write_json
from enfilade.monitor import Monitor
from enfilade.pipeline.cost import Costs
from enfilade.pipeline.job import Job
from enfilade.pipeline.survey import Survey, survey_path
from enfilade.pipeline.versions import code_digest, makers
from enfilade.pipeline.views import Views
from enfilade.renderer import Renderer
from enfilade.settings import Settings
from studies.cases.plain import PlainlyLit
from studies.cases.speed import mean_cost, path_costs
from studies.cases.terms import PIXEL_M, Terms
from studies.cases.windows import Windows
from studies.scenes import SceneFiles, write_scene

__all__ = ["Case", "Measured"]

PLAIN_SPP = 64  # rays a pixel of a reference without noise
MADE_BY = "made_by.json"  # in the scene's folder, written last
DIGITS = 12  # of a job's checksum, by which its frames are kept


@dataclass(frozen=True)
class Measured:
    """A result.

    Attributes
    ----------
    result
        As JSON has it.
    date : str
        On which it was measured, UTC.
    code : str
        Of :func:`~enfilade.pipeline.versions.code_digest`, then.
    """

    result: Any
    date: str
    code: str

    @property
    def is_current(self) -> bool:
        """Whether the code is still the same."""
        return self.code == code_digest()


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
        return self.whole.open_renderer()

    @cached_property
    def survey(self) -> Survey:
        """Velocities of the whole walk."""
        made = self.stored("survey", lambda: self._surveyed(self.whole), ("preset", "size"))
        return Survey.from_dict(made.result)

    @cached_property
    def short_survey(self) -> Survey:
        """Velocities of the walk at the size of the windows."""
        made = self.stored("survey-short", lambda: self._surveyed(self.short), ("preset", "window_size"))
        return Survey.from_dict(made.result)

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

    def rendered(self, method: str = "paper") -> dict[str, Any]:
        """Render the whole walk by a method, or go on with it.

        Returns
        -------
        dict
            Its summary, with what a path cost (:func:`~studies.cases.speed.path_costs`) before and
            after each session of rendering, on the mean, as ``path_s``.

        Raises
        ------
        RunFolderError
            The folder holds a run of another scene, version or settings. It is not replaced: it took long.
        """
        from enfilade.pipeline.walkthrough import render

        file, job = self.folder / f"{method}-speed.json", replace(self.whole, method=method)
        new = {"code": makers()["code"], "is_finished": False, "path_s": []}
        kept: dict[str, Any] = read_json(file) if file.is_file() else new
        if kept["code"] != new["code"]:
            kept = new

        def measure_speed(*, is_finished: bool) -> None:
            if not kept["is_finished"]:
                kept["path_s"].append(path_costs(self.renderer, self.whole))
                kept["is_finished"] = is_finished
                write_json(file, kept)

        measure_speed(is_finished=False)
        summary = render(job, self.folder / method, self.monitor)
        measure_speed(is_finished=True)
        return {**summary, "path_s": mean_cost(kept["path_s"])}

    def stored(
        self, name: str, make: Callable[[], Any], fields: Sequence[str], images: str | None = None
    ) -> Measured:
        """A result from its file, made now where a file is missing or was made on other terms.

        One of other code is kept, and said to be so: it may have taken hours.

        Parameters
        ----------
        name
        make
        fields
            Of the terms, on which the result depends.
        images
            A file that is made with it.
        """
        kept = self.kept(name, fields, images)
        if kept is not None:
            if not kept.is_current:
                file = self._file(name)
                self.monitor.say(f"{file} was measured on {kept.date} by other code; delete it to begin anew")
            return kept
        file = self._file(name)
        is_there = file.is_file()
        result = make()
        measured = {"date": datetime.now(UTC).date().isoformat(), "code": code_digest()}
        write_json(file, {"made_by": self._made_by(fields), "measured": measured, "result": result})
        if is_there:
            self.monitor.say(f"{file} was made on other terms, and was made anew")
        return Measured(read_json(file)["result"], **measured)  # as a later call will read it

    def kept(self, name: str, fields: Sequence[str], images: str | None = None) -> Measured | None:
        """A result that was made before, on these terms; parameters are those of :meth:`stored`."""
        file = self._file(name)
        if not file.is_file() or (images and not (self.folder / images).is_file()):
            return None
        held = read_json(file)
        if held.get("made_by") != self._made_by(fields):
            return None
        return Measured(held["result"], **held["measured"])

    def _file(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def _made_by(self, fields: Sequence[str]) -> dict[str, Any]:
        terms = self.terms.to_dict()
        return {"version": __version__, "terms": {field: terms[field] for field in fields}}

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
