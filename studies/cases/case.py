"""A scene of the case studies: files, walkthroughs and results."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from enfilade import __version__
from enfilade.camera import load_path
from enfilade.errors import RunFolderError
from enfilade.files import read_json, write_json
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.renderer import Renderer
from enfilade.runs.job import Job
from enfilade.runs.render import render
from enfilade.scene.opener import Scene
from enfilade.settings import AntialiasSettings, SamplingSettings, Settings, ViewingSettings
from studies.cases.extent import PIXEL_M, Extent
from studies.cases.noise_free import NoiseFreeRenderer
from studies.cases.speed import mean_cost, path_costs
from studies.cases.windows import Windows
from studies.progress import Prefixed, counted
from studies.scenes import write_scene
from studies.versions import origin

PAPER_FILTER = AntialiasSettings(support_fast_px=9.0, support_beyond_px=11.0, separate_shapes=False)  # §5.2
PLAIN_SPP = 64  # rays a pixel of keyframes and references without noise
EXTENT_FILE = "extent.json"


@dataclass(frozen=True)
class Result:
    """A measurement.

    Attributes
    ----------
    value
        Result, as plain values.
    origin : dict of str to str
        See :func:`~studies.versions.origin`.
    """

    value: Any
    origin: dict[str, str]


def read_result(file: Path) -> Result:
    """Read a result that was measured before."""
    table = read_json(file)
    return Result(table["result"], table["origin"])


def open_folder(folder: Path, extent: Extent) -> None:
    """Create a folder of results, or continue one of the same version and extent.

    Raises
    ------
    RunFolderError
        The folder holds results of another version or extent.
    """
    file, identity = folder / EXTENT_FILE, {"enfilade": __version__, **extent.to_dict()}
    if file.is_file():
        existing = read_json(file)
        if changed := [key for key in identity if existing.get(key) != identity[key]]:
            raise RunFolderError(
                f"{folder} holds case studies of another extent ({', '.join(changed)}); choose another "
                "--out, or delete the folder"
            )
    write_json(file, identity)


class Case:
    """A scene with its renderings and results.

    Parameters
    ----------
    name : {"room", "atrium"}
    extent
    folder
        Folder of this scene: ``scene/``, a run folder for each walkthrough, traced frames in ``windows/``,
        results as JSON.
    monitor
    """

    def __init__(self, name: str, extent: Extent, folder: Path, monitor: Monitor) -> None:
        self.name, self.extent, self.folder = name, extent, folder
        self.monitor = Prefixed(monitor, name)

    @cached_property
    def whole(self) -> Job:
        """The whole walk, by the paper's method."""
        return self._job(self.extent.size, self.extent.spp)

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
        extent, job = self.extent, self._job(self.extent.window_size, self.extent.window_spp)
        walk = Walkthrough(job.path, job.settings, self._renderer)
        return Windows(
            walk, self._analyzed("analysis-windows", walk), self.monitor, probes=extent.traced_windows,
            reference_spp=extent.window_reference_spp, folder=self.folder / "windows",
        )  # fmt: skip

    @cached_property
    def noise_free_windows(self) -> Windows:
        """Short sequences without noise, at the size of the whole walk."""
        settings = self.whole.settings.replace(SamplingSettings, spp=PLAIN_SPP)
        walk = Walkthrough(self.whole.path, settings, NoiseFreeRenderer(self._renderer))
        probes = self.extent.windows
        return Windows(walk, self.analysis, self.monitor, probes=probes, reference_spp=PLAIN_SPP)

    def rendered(self, method: str) -> dict[str, Any]:
        """Render the whole walk by a method, or continue.

        Returns
        -------
        dict
            The summary of the run, and in ``path_s`` the mean cost of a path before and after it
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
        """Read a result from its file; measure it if the file is missing."""
        file = self.folder / f"{name}.json"
        if not file.is_file():
            write_json(file, {"result": measure(), "origin": origin()})
        return read_result(file)

    def _analyzed(self, name: str, walk: Walkthrough) -> Analysis:
        frames = counted(range(len(walk.path)), "analysis", self.monitor)
        tables = self.result(name, lambda: [asdict(analyze(walk, frame)) for frame in frames]).value
        return Analysis.from_tables(walk.path, walk.settings, tables)

    def _job(self, size: tuple[int, int], spp: int) -> Job:
        viewing = ViewingSettings(diagonal_m=math.hypot(*size) * PIXEL_M)
        path = load_path(self._scene.parent / "camera_path.json", size=size)
        return Job(
            Scene(self._scene), path, Settings(viewing, SamplingSettings(spp=spp), PAPER_FILTER), "paper"
        )

    @cached_property
    def _scene(self) -> Path:
        """The scene file; written if the scene is incomplete (its camera path is written last)."""
        folder = self.folder / "scene"
        if not (folder / "camera_path.json").is_file():
            write_scene(self.name, folder, preset=self.extent.preset)
        return folder / "scene.xml"

    @cached_property
    def _renderer(self) -> Renderer:
        return self.whole.open_renderer()
