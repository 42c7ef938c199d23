"""One scene of the case studies: its files, its walkthroughs, and its results."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from enfilade import __version__
from enfilade.camera import load_path
from enfilade.errors import RunFolderError
from enfilade.files import read_json, write_json
from enfilade.methods.analysis import Analysis, analyze, to_table
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.renderer import Renderer
from enfilade.runs.job import Job
from enfilade.runs.render import render
from enfilade.scene.opener import Scene
from enfilade.settings import SamplingSettings, Settings, ViewingSettings
from studies.cases.plain import PlainlyLit
from studies.cases.speed import mean_cost, path_costs
from studies.cases.terms import PIXEL_M, Terms
from studies.cases.windows import Windows
from studies.progress import Prefixed, counted
from studies.scenes import write_scene
from studies.versions import origin

PLAIN_SPP = 64  # rays a pixel of a reference without noise
TERMS_FILE = "terms.json"


@dataclass(frozen=True)
class Result:
    """A measurement.

    Attributes
    ----------
    value
        As JSON has it.
    made : dict of str to str
        Its :func:`~studies.versions.origin`.
    """

    value: Any
    made: dict[str, str]


def read_result(file: Path) -> Result:
    """A result that was measured before."""
    table = read_json(file)
    return Result(table["result"], table["made"])


def begin(folder: Path, terms: Terms) -> None:
    """Begin a folder of results, or go on with one: all of it is of one version, and on the same terms.

    Raises
    ------
    RunFolderError
        The folder holds results on other terms.
    """
    file, now = folder / TERMS_FILE, {"enfilade": __version__, **terms.to_dict()}
    if file.is_file():
        there = read_json(file)
        if changed := [key for key in now if there.get(key) != now[key]]:
            raise RunFolderError(
                f"{folder} holds case studies on other terms ({', '.join(changed)}); choose another --out, "
                "or delete it to begin anew"
            )
    write_json(file, now)


class Case:
    """A scene, and everything made of it.

    Parameters
    ----------
    name : {"room", "atrium"}
    terms
    folder
        Of this scene: ``scene/``, a run folder for each walkthrough, traced frames in ``windows/``, results
        as JSON.
    monitor
    """

    def __init__(self, name: str, terms: Terms, folder: Path, monitor: Monitor) -> None:
        self.name, self.terms, self.folder = name, terms, folder
        self.monitor = Prefixed(monitor, name)

    @cached_property
    def whole(self) -> Job:
        """The whole walk, by the paper's method."""
        return self._job(self.terms.size, self.terms.spp)

    @cached_property
    def walk(self) -> Walkthrough:
        """The whole walk, with the scene loaded."""
        return Walkthrough(self.whole.path, self.whole.settings, self._renderer)

    @cached_property
    def analysis(self) -> Analysis:
        """Velocities of the whole walk."""
        return self._analyzed("analysis", self.walk)

    @cached_property
    def windows(self) -> Windows:
        """Short sequences, path traced."""
        terms, job = self.terms, self._job(self.terms.window_size, self.terms.window_spp)
        walk = Walkthrough(job.path, job.settings, self._renderer)
        return Windows(
            walk, self._analyzed("analysis-windows", walk), self.monitor, probes=terms.traced_windows,
            reference_spp=terms.window_reference_spp, folder=self.folder / "windows",
        )  # fmt: skip

    @cached_property
    def plain_windows(self) -> Windows:
        """Short sequences without noise, at the size of the whole walk."""
        walk = Walkthrough(self.whole.path, self.whole.settings, PlainlyLit(self._renderer))
        probes = self.terms.windows
        return Windows(walk, self.analysis, self.monitor, probes=probes, reference_spp=PLAIN_SPP)

    def rendered(self, method: str) -> dict[str, Any]:
        """Render the whole walk by a method, or go on with it.

        Returns
        -------
        dict
            Its summary, and as ``path_s`` the mean cost of a path before and after
            (:func:`~studies.cases.speed.path_costs`).

        Raises
        ------
        RunFolderError
            The folder holds another run.
        """
        file, job = self.folder / f"{method}-speed.json", replace(self.whole, method=method)
        before = None if file.is_file() else path_costs(self.walk)
        summary = render(job, self.folder / method, Prefixed(self.monitor, method))
        if before is not None:
            write_json(file, mean_cost([before, path_costs(self.walk)]))
        return {**summary, "path_s": read_json(file)}

    def result(self, name: str, measure: Callable[[], Any]) -> Result:
        """A result from its file, measured where it is missing."""
        file = self.folder / f"{name}.json"
        if not file.is_file():
            write_json(file, {"result": measure(), "made": origin()})
        return read_result(file)

    def _analyzed(self, name: str, walk: Walkthrough) -> Analysis:
        frames = counted(range(len(walk.path)), "analysis", self.monitor)
        tables = self.result(name, lambda: [to_table(analyze(walk, frame)) for frame in frames]).value
        return Analysis.from_tables(walk.path, walk.settings, tables)

    def _job(self, size: tuple[int, int], spp: int) -> Job:
        viewing = ViewingSettings(diagonal_m=math.hypot(*size) * PIXEL_M)
        path = load_path(self._scene.parent / "camera_path.json", size=size)
        return Job(Scene(self._scene), path, Settings(viewing, SamplingSettings(spp=spp)), "paper")

    @cached_property
    def _scene(self) -> Path:
        """The scene file, written unless all of the scene is there; its camera path is written last."""
        folder = self.folder / "scene"
        if not (folder / "camera_path.json").is_file():
            write_scene(self.name, folder, preset=self.terms.preset)
        return folder / "scene.xml"

    @cached_property
    def _renderer(self) -> Renderer:
        return self.whole.open_renderer()
