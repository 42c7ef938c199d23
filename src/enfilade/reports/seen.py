"""A run folder opened to be looked at: who would see it on what screen, and its finished frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from enfilade import __version__
from enfilade.errors import ImageError, RunFolderError
from enfilade.images import read_exr
from enfilade.records import F32, LOBE_LAYERS, U8, Flow
from enfilade.reports.alive import silent_since
from enfilade.settings import MaskSettings, VideoSettings, ViewingSettings
from enfilade.store import Run, tally
from enfilade.store.lock import writers_of
from enfilade.viewing import Viewing

__all__ = ["SeenFrame", "SeenRun"]


@dataclass(frozen=True, eq=False)
class SeenFrame:
    """A frame of the run.

    Attributes
    ----------
    index : int
        On the path, from 0.
    number : int
        By which the user knows it.
    color : (H, W, 3) float32
        Linear Rec.709.
    source : (H, W) uint8 or None
        :class:`~enfilade.records.Provenance`; None where the file has no such layer.
    flow : Flow or None
        Pixels per frame; None where the file has no such layers.
    is_raw : bool
        Whether it is not antialiased yet.
    """

    index: int
    number: int
    color: F32
    source: U8 | None
    flow: Flow | None
    is_raw: bool = False


class SeenRun:
    """A finished or a running run, opened to be read.

    Parameters
    ----------
    folder

    Attributes
    ----------
    run : Run
    identity : dict
        As ``run.json`` has it.
    lines : list of dict
        Of the ledger, when the folder was opened.
    figures : dict
        See :func:`~enfilade.store.tally`.
    numbers : tuple of int
        Of all frames of the path.
    speed_deg_s : list of float or None
        Mean velocity of each, once the run has surveyed its path.
    finished : tuple of int
        Indices of the frames that are finished, rising.
    there : tuple of int
        The same, and of those that wait for antialiasing.
    viewing : Viewing
    exposure_ev : float
        Stops.
    video : VideoSettings
    writers : list of dict
        Who worked on it when it was opened, see :func:`~enfilade.store.lock.writers_of`.
    silent_since : datetime or None
        When they gave the last sign, where that is long ago; see :func:`~enfilade.reports.alive.silent_since`.
    notes : list of str
        What is odd about the run, for the user to know.

    Raises
    ------
    RunFolderError
        It is no run folder, is damaged, or is of a version that kept other facts.
    """

    def __init__(self, folder: Path) -> None:
        self.run = Run.existing(folder, is_lenient=True)
        self.identity = self.run.identity
        self.writers = writers_of(folder)
        self.notes = list(self.run.notes)
        self.lines = list(self.run.lines())
        try:
            self.silent_since = silent_since(folder, self.writers, self.lines)
            self._read()
        except (KeyError, TypeError, ValueError, IndexError, ZeroDivisionError) as error:
            raise RunFolderError(
                f"{folder} can't be shown: its run.json or ledger.jsonl hasn't what is needed ({error!r}); "
                f"it is of another version ({_version(self.identity)}, this is {__version__}) or of another "
                "command; render it again"
            ) from error
        if _version(self.identity) != __version__:
            self.notes.append(f"made with version {_version(self.identity)}; this page by {__version__}")

    def _read(self) -> None:
        path, settings = self.identity["path"], self._settings()
        self.numbers = tuple(int(number) for number in path["frames"])
        survey = next((line["survey"] for line in self.lines if "survey" in line), None)
        self.speed_deg_s = None if survey is None else [float(v) for v in survey["speed_deg_s"]]
        self.figures = tally({**self.identity, "settings": settings}, self.lines, self.speed_deg_s)
        done, raw = (
            {line["frame"] for line in self.lines if line["unit"].startswith(kind)}
            for kind in ("frame ", "raw ")
        )
        self.finished = tuple(i for i, number in enumerate(self.numbers) if number in done)
        self.there = tuple(i for i, number in enumerate(self.numbers) if number in done | raw)
        of = ViewingSettings.from_table(_known(settings.get("viewing", {}), ViewingSettings))
        self.exposure_ev = of.exposure_ev
        self.video = VideoSettings.from_table(_known(settings.get("video", {}), VideoSettings))
        width, height = path["size"]
        self.viewing = Viewing(
            int(width),
            int(height),
            diagonal_m=of.diagonal_m,
            distance_m=of.distance_m,
            fps=float(path["fps"]),
            peak_cd_m2=of.peak_cd_m2,
            black_cd_m2=of.black_cd_m2,
            persistence=of.persistence,
        )
        self._cuts = frozenset(path.get("cuts", ()))

    def _settings(self) -> dict[str, Any]:
        """Tables of settings; those that tables are needed of are there."""
        given = self.identity.get("settings", {"trace": self.identity.get("trace", {})})  # the bench has few
        return {**given, "masks": asdict(MaskSettings()) | given.get("masks", {})}

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.run.folder.resolve().name

    @property
    def is_finished(self) -> bool:
        """Whether all frames are there, and the video; runs of the bench may have none."""
        has_video = any(line["unit"] == "video" for line in self.lines)
        return len(self.finished) == len(self.numbers) and (has_video or "settings" not in self.identity)

    def begins_shot(self, index: int) -> bool:
        """Whether nothing is carried to a frame from the one before."""
        return index == 0 or self.numbers[index] in self._cuts

    def neighbours(self, index: int) -> tuple[int | None, int | None]:
        """Numbers of the frames before and after, to which flow leads; None at the ends of a shot."""
        after = index + 1
        is_last = after == len(self.numbers) or self.begins_shot(after)
        before = None if self.begins_shot(index) else self.numbers[index - 1]
        return before, None if is_last else self.numbers[after]

    def frame(self, index: int) -> SeenFrame:
        """Read a frame that is finished or waits for antialiasing; its checksum is compared.

        Raises
        ------
        ImageError, RunFolderError
            It is missing or damaged, of another size, or holds a NaN. The message names the file.
        """
        is_raw = index not in self.finished
        file = self.run.file("raw" if is_raw else "frames", self.numbers[index])
        self.run.check(file)
        layers = read_exr(file)
        size = (self.viewing.height_px, self.viewing.width_px)
        color = layers.get("RGB")
        if color is None or color.shape != (*size, 3):
            raise ImageError(f"{file} holds no image of {size[1]}x{size[0]} pixels")
        color = color.astype(np.float32)
        # What mirrors, glass and gloss show is kept apart until the end.
        for name in LOBE_LAYERS if is_raw else ():
            if name in layers:
                color += layers[name]
        if not np.isfinite(color).all():
            raise ImageError(f"{file} holds pixels that are NaN or infinite")
        source = layers.get("source")
        return SeenFrame(
            index,
            self.numbers[index],
            color,
            None if source is None else source.astype(np.uint8),
            self._flow(index, layers),
            is_raw,
        )

    def _flow(self, index: int, layers: Mapping[str, Any]) -> Flow | None:
        if "forward" not in layers or "backward" not in layers:
            return None
        before, after = self.neighbours(index)
        backward, forward = (
            np.ascontiguousarray(layers[name], np.float32) for name in ("backward", "forward")
        )
        return Flow(backward, forward, has_backward=before is not None, has_forward=after is not None)


def _version(identity: Mapping[str, Any]) -> str:
    versions = identity.get("versions")
    return str(versions.get("enfilade", "unknown")) if isinstance(versions, dict) else "unknown"


def _known(table: Mapping[str, Any], section: type[Any]) -> dict[str, Any]:
    return {f.name: table[f.name] for f in fields(section) if f.name in table}
