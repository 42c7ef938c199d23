"""A finished or running run, opened for its report."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import ImageError, RunFolderError, SceneError
from enfilade.images import read_exr
from enfilade.methods.base import FRAMES
from enfilade.records import F32, U8, Flow
from enfilade.runs.delivery import VIDEO
from enfilade.runs.folder import RunFolder
from enfilade.runs.identity import RUN_FILE
from enfilade.runs.job import JOB_FILE, read_table
from enfilade.runs.ledger import LEDGER_FILE
from enfilade.runs.lock import holder_of
from enfilade.runs.statistics import statistics
from enfilade.scene.blender.imported import ImportedScene
from enfilade.scene.blender.process import RESULT_FILE
from enfilade.settings import VideoSettings, ViewingSettings


@dataclass(frozen=True, eq=False)
class DeliveredFrame:
    """A delivered frame; layers that its file does not have are None.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear Rec.709.
    provenance : (H, W) uint8 or None
        :class:`~enfilade.records.Provenance`.
    flow : Flow or None
    """

    color: F32
    provenance: U8 | None
    flow: Flow | None


class ReportedRun:
    """A run folder, opened to be read; it is not locked. Method, scene and renderer are not loaded.

    Parameters
    ----------
    folder

    Attributes
    ----------
    folder : Path
    identity : dict
        Of ``run.json``.
    lines : list of dict
        Of the ledger.
    summary : dict
        See :func:`~enfilade.runs.statistics.statistics`.
    numbers : tuple of int
        Of all frames of the path.
    there : tuple of int
        Indices of the frames that are finished and have their file, rising.
    video : VideoSettings
    viewing_settings : ViewingSettings
    viewing : Viewing
    holder : dict or None
        The command that writes the run, see :func:`~enfilade.runs.lock.holder_of`.
    last_result : datetime
    imported : ImportedScene or None
        What Blender's importer says of the scene, if it was imported.
    notes : list of str
        Damage.

    Raises
    ------
    RunFolderError
        It is no run folder, or is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self._run = RunFolder.read(folder)
        self.folder, self.identity = folder, self._run.identity
        self.lines, self.summary = list(self._run.lines()), statistics(self._run)
        path = self.identity["path"]
        self.numbers: tuple[int, ...] = tuple(path["frames"])
        self._starts = {self.numbers[0], *path["cuts"]}
        self.there = tuple(i for i, number in enumerate(self.numbers) if self._run.line(FRAMES, number))
        job = read_table(folder)
        self.viewing_settings, self.video = _settings(job, folder)
        width, height = path["size"]
        self.viewing = self.viewing_settings.conditions(width, height, path["fps"])
        self.holder = holder_of(folder)
        ledger = folder / LEDGER_FILE
        changed = ledger if ledger.exists() else folder / RUN_FILE
        self.last_result = datetime.fromtimestamp(changed.stat().st_mtime, UTC)
        there = {self.numbers[i] for i in self.there}
        lost = [str(n) for n in self.numbers if self._run.recorded(FRAMES, n) and n not in there]
        self.notes = list(self._run.notes)
        self.imported = self._imported(job)
        if lost:
            self.notes.append(f"the files of these frames are missing or damaged: {', '.join(lost)}")

    @property
    def is_finished(self) -> bool:
        """Whether all frames and the video, as it is set, are finished."""
        line = self._run.line(VIDEO.name, self.numbers[0])
        wanted = self.video.to_table() | {"exposure_ev": self.viewing_settings.exposure_ev}
        del wanted["ocio"]  # a path, which the identity of a video leaves out
        return self.has_all_frames and line is not None and wanted.items() <= line["video"].items()

    @property
    def has_all_frames(self) -> bool:
        """Whether all frames are finished and have their files."""
        return len(self.there) == len(self.numbers)

    def frame(self, index: int) -> DeliveredFrame:
        """Read a frame; its checksum is compared.

        Raises
        ------
        DamagedFileError, ImageError
            Its file is missing, damaged, or holds no image of the size of the run.
        """
        number, size = self.numbers[index], (self.viewing.height_px, self.viewing.width_px)
        file = self._run.file_of(FRAMES, number)
        layers = read_exr(file)
        color = layers.get("RGB")
        if color is None or color.shape != (*size, 3):
            raise ImageError(f"{file} holds no image of {size[1]}x{size[0]} pixels")
        provenance = layers.get("provenance")
        known = None if provenance is None else provenance.astype(np.uint8)
        return DeliveredFrame(color.astype(np.float32), known, self._flow(index, layers))

    def _imported(self, job: dict[str, Any]) -> ImportedScene | None:
        """The imported scene of the job; None where it was not imported, or is not there."""
        folder = Path(str(job.get("scene", {}).get("file", ""))).parent
        if not (folder / RESULT_FILE).is_file():
            return None
        try:
            return ImportedScene.read(folder)
        except SceneError as error:
            self.notes.append(str(error))
            return None

    def _flow(self, index: int, layers: dict[str, Any]) -> Flow | None:
        if "forward" not in layers or "backward" not in layers:
            return None
        backward, forward = (
            np.ascontiguousarray(layers[name], np.float32) for name in ("backward", "forward")
        )
        after = self.numbers[index + 1 : index + 2]
        has_forward = bool(after) and after[0] not in self._starts
        return Flow(
            backward, forward, has_backward=self.numbers[index] not in self._starts, has_forward=has_forward
        )


def _settings(job: dict[str, Any], folder: Path) -> tuple[ViewingSettings, VideoSettings]:
    """Settings of viewing and video, which not every method has in its identity."""
    try:
        tables = job["settings"]
        return ViewingSettings.from_table(tables["viewing"]), VideoSettings.from_table(tables["video"])
    except (KeyError, TypeError) as error:
        raise RunFolderError(
            f"{folder / JOB_FILE} is damaged ({error!r}); run the command that made the run again"
        ) from error
