"""The interface between methods and runs: tasks, passes, and the base class of methods.

A method defines how frames are made from a scene and a camera path, as passes in order. A pass maps records
of earlier passes to new records; most have one task a frame. A method contains no file, ledger, executor or
progress bar: :mod:`enfilade.runs` schedules, stores and resumes its tasks, and tests run them on few arrays.
``reference.py`` is the shortest example.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Protocol

from enfilade.methods.analysis import Analysis
from enfilade.methods.walkthrough import Walkthrough
from enfilade.settings import Section, Settings

FRAMES = "frames"  # the last pass of every method; its records are `records.Frame`


class TaskId(NamedTuple):
    """The name of a task, for its folder, the progress bar, the ledger and ``--pass``.

    Attributes
    ----------
    pass_name : str
    frame : int
        Index on the path; the first one of tasks for several frames.
    """

    pass_name: str
    frame: int


@dataclass(frozen=True)
class Task:
    """A unit of work.

    Attributes
    ----------
    pass_name : str
    frame : int
        Index on the path; the first one of tasks for several frames.
    shot : int
        Index of the shot, from 0.
    needs : tuple of TaskId
        Tasks that must be finished first.
    """

    pass_name: str
    frame: int
    shot: int = 0
    needs: tuple[TaskId, ...] = ()

    @property
    def id(self) -> TaskId:
        """The name of the task."""
        return TaskId(self.pass_name, self.frame)


@dataclass(frozen=True)
class Pass:
    """One step of a method.

    Attributes
    ----------
    name : str
    record : type or None
        Class of the records that its tasks write, one file a frame; None for passes that have metadata only.
    reads : tuple of str
        Passes whose records or metadata its tasks read: earlier ones, or the pass itself, of whose tasks
        those must be in ``needs``. Others are refused.
    is_barrier : bool
        Whether its tasks begin when all tasks of earlier passes of the same shot are finished.
    is_shared : bool
        Whether its tasks may be divided among several commands.
    """

    name: str
    record: type | None = None
    reads: tuple[str, ...] = ()
    is_barrier: bool = False
    is_shared: bool = True


@dataclass(frozen=True)
class Output:
    """The result of a task.

    Attributes
    ----------
    records : mapping of int to record
        By frame, as index on the path.
    metadata : mapping
        Values fit for JSON, for the ledger and for later passes. The report adds up ``rays`` (by kind) and
        ``dropped``, samples that were left out since they were not finite.
    """

    records: Mapping[int, Any] = field(default_factory=dict)
    metadata: Mapping[str, Any] = field(default_factory=dict)


class Inputs(Protocol):
    """Results of earlier passes."""

    @property
    def analysis(self) -> Analysis:
        """The statistics of all frames of the path."""
        ...

    def record(self, pass_name: str, frame: int) -> Any:
        """The record of a pass for a frame.

        Raises
        ------
        DamagedFileError
            Its file is missing, or is not the one that was written.
        """
        ...

    def metadata(self, pass_name: str, frame: int) -> Mapping[str, Any]:
        """The metadata of the task of a pass.

        Raises
        ------
        KeyError
            The task is not finished.
        """
        ...


class Method(ABC):
    """A way to make the frames of a camera path.

    Attributes
    ----------
    name : str
    revision : int
        To be raised with every change of the results that is not a change of settings: runs of another
        revision are not continued.
    needs_lobes : bool
        Whether it needs a renderer that separates diffuse from specular lobes, a
        :class:`~enfilade.renderer.LobeRenderer`.
    has_tone_curve : bool
        Whether it judges contrasts by the tone curve of ``[viewing] white``, not by the clipped sRGB curve.
    settings : tuple of type
        Sections that it reads. Runs that differ in other sections only are the same run.
    passes : tuple of Pass
        In order; the last one is ``frames``.
    """

    name: ClassVar[str]
    revision: ClassVar[int] = 1
    needs_lobes: ClassVar[bool] = False
    has_tone_curve: ClassVar[bool] = False
    settings: ClassVar[tuple[type[Section], ...]] = ()
    passes: ClassVar[tuple[Pass, ...]]

    def check(self, settings: Settings) -> None:
        """Refuse settings that the method does not support, before the scene is loaded.

        Raises
        ------
        SettingsError
        """
        del settings

    def libraries(self, settings: Settings) -> Mapping[str, str]:
        """Name and version of each library on which the results depend, by its purpose; none by default.

        A run is not continued with other versions. That of the renderer is always recorded.
        """
        del settings
        return {}

    def keyframes(self, analysis: Analysis) -> list[int]:
        """Initial keyframes, for plans and charts; none by default."""
        del analysis
        return []

    def cost_ratios(
        self,
        settings: Settings,
        pixels: int,
        excerpt: Mapping[str, int],
        whole: Mapping[str, int],
        shots: int,
    ) -> Mapping[str, float]:
        """Cost a pixel of a task in a walkthrough over that of one in a small excerpt, for forecasts.

        Parameters
        ----------
        settings
        pixels
            Of a frame of the walkthrough.
        excerpt, whole
            Number of tasks of each pass.
        shots
            Of the walkthrough; an excerpt is of one.

        Returns
        -------
        mapping of str to float
            By pass; 1 where left out.
        """
        del settings, pixels, excerpt, whole, shots
        return {}

    @abstractmethod
    def tasks(self, analysis: Analysis) -> Iterable[Task]:
        """All tasks, in any order.

        Parameters
        ----------
        analysis
            Of all frames of the path.
        """

    @abstractmethod
    def run(self, task: Task, inputs: Inputs, walk: Walkthrough) -> Output:
        """Do a task. The result depends on the arguments alone; the instance may hold caches."""
