"""Does tasks of a run: loads the inputs, calls the method, writes the records, returns the ledger line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any

from enfilade.arrays import release_memory
from enfilade.cache import LruCache, images_within_memory
from enfilade.errors import RunFolderError
from enfilade.images.records import read_record, write_record
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.base import FRAMES, Method, Output, Pass, Task
from enfilade.methods.walkthrough import Walkthrough
from enfilade.renderer import Renderer
from enfilade.runs.delivery import (
    ANALYSIS,
    ANALYZED_FRAMES,
    CLIPS,
    VIDEO,
    VIDEO_PASSES,
    write_clip,
    write_frame,
    write_video,
)
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.runs.ledger import plain
from enfilade.runs.stopwatch import Stopwatch

CACHED_RECORDS = 8  # decoupled reads seven shaded frames for each
RESERVED = frozenset({"pass", "frame", "files", "cost", "reduction", "sum"})  # keys of a ledger line


class Worker:
    """Does tasks of a run, one after the other.

    Parameters
    ----------
    job
    run
        It is only read; the lines that :meth:`do` returns are appended by the scheduler.
    method, renderer
        Already opened, to share their kernels among several runs; by default the job's, opened when needed.
    """

    def __init__(
        self, job: Job, run: RunFolder, *, method: Method | None = None, renderer: Renderer | None = None
    ) -> None:
        self._job = job
        self._run = run
        self._method = method or job.opened_method()
        self._renderer = renderer
        self._stopwatch = Stopwatch()
        self._inputs = _Inputs(job, run, self._method.passes, self._stopwatch)

    def prepare(self, task: Task) -> None:
        """Load the scene, unless the task needs none."""
        if task.pass_name not in VIDEO_PASSES:
            _ = self._walk

    def do(self, task: Task) -> dict[str, Any]:
        """Do a task.

        Returns
        -------
        dict
            Its line for the ledger. All files that it names are written.

        Raises
        ------
        EnfiladeError
        """
        metadata: Mapping[str, Any] = {}
        files: list[Path] = []
        if task.pass_name in VIDEO_PASSES:
            metadata = {"video": self._job.video_identity}
        with self._stopwatch.timed(task.pass_name):
            match task.pass_name:
                case ANALYSIS.name:
                    frames = range(task.frame, min(task.frame + ANALYZED_FRAMES, len(self._job.path)))
                    metadata = {"frames": [asdict(analyze(self._walk, frame)) for frame in frames]}
                    metadata["notes"] = self._walk.renderer.describe().notes
                case CLIPS.name:
                    files = [write_clip(self._run, self._job, task.frame)]
                case VIDEO.name:
                    files = [write_video(self._run, self._job)]
                case _:
                    self._inputs.begin(task.pass_name)
                    metadata, files = self._write(task, self._method.run(task, self._inputs, self._walk))
        release_memory()
        if taken := RESERVED.intersection(metadata):
            raise ValueError(f"metadata have names of the ledger's own: {', '.join(sorted(taken))}")
        number = self._job.path.numbers[task.frame]
        line = {"pass": task.pass_name, "frame": number, **metadata, "files": self._run.record_of(files)}
        return plain({**line, "cost": self._stopwatch.take()})

    def _write(self, task: Task, output: Output) -> tuple[Mapping[str, Any], list[Path]]:
        """Write the records of a task; returns its metadata and the files."""
        metadata, files = output.metadata, []
        with self._stopwatch.timed("files"):
            for frame, record in output.records.items():
                stem = self._run.stem(task.pass_name, self._job.path.numbers[frame])
                if task.pass_name == FRAMES:
                    files.append(write_frame(stem, record, self._walk.view(frame), self._job))
                    metadata = {**metadata, "provenance": record.counts, "is_black": not record.color.any()}
                else:
                    files.append(write_record(stem, record))
                    self._inputs.keep(task.pass_name, frame, record)
        return metadata, files

    @cached_property
    def _walk(self) -> Walkthrough:
        settings = self._job.rendering_settings()
        renderer = self._renderer or self._job.open_renderer()
        return Walkthrough(self._job.path, settings, renderer, timed=self._stopwatch.timed)


class _Inputs:
    """Records and metadata of earlier passes, from the run folder."""

    def __init__(self, job: Job, run: RunFolder, passes: Iterable[Pass], stopwatch: Stopwatch) -> None:
        self._job = job
        self._run = run
        self._passes = {of.name: of for of in passes}
        self._reader: Pass | None = None
        self._stopwatch = stopwatch
        self._records: LruCache[tuple[str, int], Any] = LruCache(
            images_within_memory(job.path.width * job.path.height, CACHED_RECORDS)
        )

    @cached_property
    def analysis(self) -> Analysis:
        """The statistics of all frames."""
        self._run.refresh()
        return analysis_of(self._job, self._run)

    def record(self, pass_name: str, frame: int) -> Any:
        """See :class:`enfilade.methods.base.Inputs`."""
        self._check_reader(pass_name)
        return self._records.get((pass_name, frame), lambda: self._read(pass_name, frame))

    def metadata(self, pass_name: str, frame: int) -> Mapping[str, Any]:
        """See :class:`enfilade.methods.base.Inputs`."""
        self._check_reader(pass_name)
        number = self._job.path.numbers[frame]
        line = self._run.recorded(pass_name, number)
        if line is None:  # finished by another process, perhaps
            self._run.refresh()
            line = self._run.recorded(pass_name, number)
        if line is None:
            raise KeyError(f"{pass_name} {number} is not finished")
        return line

    def begin(self, pass_name: str) -> None:
        """Note the pass whose tasks read from now on."""
        self._reader = self._passes[pass_name]

    def keep(self, pass_name: str, frame: int, record: Any) -> None:
        """Cache a record that was just written."""
        self._records.put((pass_name, frame), record)

    def _check_reader(self, pass_name: str) -> None:
        if self._reader is not None and pass_name not in self._reader.reads:
            raise ValueError(f"pass {self._reader.name!r} does not declare that it reads {pass_name!r}")

    def _read(self, pass_name: str, frame: int) -> Any:
        kind = self._passes[pass_name].record
        if kind is None:
            raise ValueError(f"pass {pass_name!r} writes no records")
        with self._stopwatch.timed("files"):
            return read_record(self._run.file_of(pass_name, self._job.path.numbers[frame]), kind)


def analysis_of(job: Job, run: RunFolder) -> Analysis:
    """The analysis of all frames, from the ledger.

    Raises
    ------
    RunFolderError
        It is not finished.
    """
    tables: list[Mapping[str, Any]] = []
    for first in range(0, len(job.path), ANALYZED_FRAMES):
        line = run.line(ANALYSIS.name, job.path.numbers[first])
        if line is None:
            raise RunFolderError(f"{run.folder}: the path is not analyzed yet")
        tables += line["frames"]
    return Analysis.from_tables(job.path, job.rendering_settings(), tables)
