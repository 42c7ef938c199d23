"""Who renders a run: the units of its blueprint, handed to the workers of an executor until all are done."""

from __future__ import annotations

import re
import shutil
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Any

from enfilade.device import active
from enfilade.errors import EnfiladeError, NoSpaceError, UnfinishedError
from enfilade.executors import (
    ATTEMPTS,
    Executor,
    Failure,
    FailureKind,
    Graph,
    Recipe,
    Unit,
    open_executor,
    supervise,
)
from enfilade.executors.inprocess import InProcess
from enfilade.files import whole_file
from enfilade.monitor import Monitor
from enfilade.pipeline.hire import Distant
from enfilade.pipeline.job import Job, check_identity
from enfilade.pipeline.progress import Progress
from enfilade.pipeline.units import Blueprint
from enfilade.store import KINDS, Run
from enfilade.store.guest import sweep_but_guests
from enfilade.store.lock import sign_workers

ASIDE = "failed"  # folder for the logs of units that were set aside
LOGS = "logs"  # folder for what worker processes print
REPAIRS = 1000  # damaged files that are mended in one go, before something else must be wrong
SHOWN = 5  # units named in a message
LOOKS, LOOK_S = 10, 0.5  # for files that a worker elsewhere has just written
MB = 1_000_000


@dataclass(frozen=True)
class Crew:
    """Who does the work. It changes no result.

    Attributes
    ----------
    executor : str
        One of :data:`~enfilade.executors.EXECUTORS`.
    workers : int or None
        How many of them; None: one for each CPU core.
    threads : int
        Of each worker process; 0: its share of the cores.
    """

    executor: str = "in-process"
    workers: int | None = None
    threads: int = 0


def carry_out(
    job: Job,
    run: Run,
    crew: Crew,
    monitor: Monitor,
    *,
    is_wanted: Callable[[Unit], bool] | None = None,
) -> list[str]:
    """Do all units of a run that are not done.

    Parameters
    ----------
    job
    run
        Opened to write in it. Whatever workers finish, this process records.
    crew
    monitor
    is_wanted
        Which units are this command's share. Others must be finished before, or are left; but those that
        were finished once, whose files don't stand any more, are made again where the share needs them.

    Returns
    -------
    list of str
        Names of units of this command's share that wait for others.

    Raises
    ------
    UnfinishedError
        Some units failed again and again and were set aside; the rest is done.
    NoSpaceError
        The disk is full. What is finished stays.
    EnfiladeError
        What the stages raise.
    """
    try:
        return _carry_out(job, run, crew, monitor, is_wanted or _everything)
    finally:
        if run.is_sole_writer:  # of workers that were killed while they wrote
            with suppress(OSError):
                sweep_but_guests(run.folder, KINDS)


def _carry_out(
    job: Job, run: Run, crew: Crew, monitor: Monitor, is_wanted: Callable[[Unit], bool]
) -> list[str]:
    progress, aside = Progress(monitor), _Aside(run, monitor)
    for _ in range(REPAIRS):
        shift, damaged = _Shift(job, run, progress, aside, is_wanted), None
        if shift.can_begin:
            progress.tell_before()
            # Workers of their own for each shift: those of the last have what was damaged in memory, and
            # would not write it again.
            with closing(_open(job, run, crew, progress)) as executor:
                sign_workers(run.folder, executor.slots, run.part)
                damaged = shift.work(executor)
        if damaged is None:
            aside.check(len(shift.left))
            return shift.left
        progress.take_back()
        run.forget(damaged)
        monitor.say(f"{damaged} is missing or damaged: what made it is done again")
    raise EnfiladeError(f"more than {REPAIRS} files of {run.folder} were damaged while it was worked on")


def _everything(_unit: Unit) -> bool:
    return True


def _open(job: Job, run: Run, crew: Crew, progress: Progress) -> Executor:
    def hear(unit: Unit, what: str, value: Any) -> None:
        match what:
            case "line":
                run.record(value)
            case "begin":
                progress.begin(unit)
            case _:
                progress.hear(unit, what, value)

    if crew.executor == "in-process":
        return InProcess(_Here(job, run), hear)
    spec = {
        "folder": str(run.folder.resolve()),
        "part": run.part,
        "device": active().backend,
        "threads": crew.threads,
    }
    recipe = Recipe("enfilade.pipeline.hire:open_worker", spec)
    return open_executor(crew.executor, recipe, hear, workers=crew.workers, logs=run.folder / LOGS)


class _Shift:
    """One pass over the units, until all are done or a damaged file is found."""

    def __init__(
        self, job: Job, run: Run, progress: Progress, aside: _Aside, is_wanted: Callable[[Unit], bool]
    ) -> None:
        self._blueprint = Blueprint(job, run)
        self._run = run
        self._is_wanted = is_wanted
        self._graph = Graph()
        self._progress = progress
        self._aside = aside
        self._known: set[str] = set()  # units, whether they are taken up or not
        self._gates: dict[str, Unit] = {}
        self._lost: dict[str, Unit] = {}  # of others, finished once: their files don't stand any more
        self._take_up(self._blueprint.first())

    @property
    def can_begin(self) -> bool:
        """Whether there is a unit that waits for nothing."""
        unit = self._graph.take()
        if unit is not None:
            self._graph.put_back(unit)
        return unit is not None

    @property
    def left(self) -> list[str]:
        """Names of units that are to be done."""
        return [unit.name for unit in self._graph.unfinished() if self._is_wanted(unit)]

    def work(self, executor: Executor) -> str | None:
        """Returns the name of a damaged file, if one is found."""
        try:
            ending = supervise(
                self._graph,
                executor,
                follow=self._finished,
                is_done=self._is_done,
                failed=self._failed,
            )
        except NoSpaceError as error:
            raise self._no_space(error) from error
        stopped = ending.stopped
        if stopped is not None and stopped.kind is not FailureKind.DAMAGED:
            reason = stopped.error or EnfiladeError(stopped.text)
            raise self._no_space(reason) if stopped.kind is FailureKind.SPACE else reason
        return None if stopped is None else stopped.file

    def _take_up(self, units: Any) -> None:
        """Add units to the graph; those that are done bring theirs at once."""
        pending = deque(units)
        if not pending:
            return
        while pending:
            unit = pending.popleft()
            is_done = not unit.is_gate and self._blueprint.is_done(unit)
            self._known.add(unit.name)
            if unit.is_gate:
                self._gates[unit.name] = unit
            elif not is_done and not self._is_wanted(unit):
                if self._run.was_finished(unit.name):
                    self._lost[unit.name] = unit
                continue
            self._add(unit, is_done=is_done)
            if is_done:
                pending.extend(self._blueprint.follow(unit))
        lost = self._lost_needs() if self._lost else []
        for unit in lost:
            self._add(unit, is_done=False)
        if lost:
            names = shortened([unit.name for unit in lost])
            self._progress.monitor.say(f"files of earlier steps are missing and made again here: {names}")

    def _add(self, unit: Unit, *, is_done: bool) -> None:
        if is_done:
            self._graph.finish(unit.name)
            self._aside.drop(unit)
        elif unit.name in self._aside:
            self._graph.set_aside(unit.name)
        self._graph.add(unit)
        if not is_done or self._is_wanted(unit):
            self._progress.add(unit, is_done=is_done)

    def _lost_needs(self) -> list[Unit]:
        """Take those of the lost units that are needed, by this share or by one another."""
        pending = deque(name for unit in self._graph.unfinished() for name in unit.needs)
        seen: set[str] = set()
        while pending:
            name = pending.popleft()
            unit = self._lost.get(name) or self._gates.get(name)
            if unit is not None and name not in seen:
                pending.extend(unit.needs)
            seen.add(name)
        # What nobody knows yet comes of a unit that must be done before, and may be among the lost.
        found = [unit for unit in self._lost.values() if unit.name in seen or not seen <= self._known]
        for unit in found:
            del self._lost[unit.name]
        return found

    def _is_done(self, unit: Unit) -> bool:
        if self._blueprint.is_done(unit):
            return True
        self._run.refresh()  # another command that shares the run may have finished it meanwhile
        return self._blueprint.is_done(unit) or (self._run.was_finished(unit.name) and self._comes(unit))

    def _comes(self, unit: Unit) -> bool:
        """Look again for the files of a unit that was just finished: a network disk may show them late."""
        folders = [self._run.folder, *(self._run.folder / kind for kind in KINDS)]
        for _ in range(LOOKS):
            for folder in folders:  # which has NFS ask its server, also for names that were not there before
                with suppress(OSError):
                    list(folder.iterdir())
            if self._blueprint.is_done(unit):
                return True
            time.sleep(LOOK_S)
        return False

    def _finished(self, unit: Unit) -> tuple[Unit, ...]:
        self._progress.finish(unit)
        self._take_up(self._blueprint.follow(unit))
        return ()

    def _failed(self, unit: Unit, failures: list[Failure]) -> None:
        self._progress.take_back(unit)
        failure, attempt = failures[-1], len(failures)
        after = "it is tried again" if attempt < ATTEMPTS else "it is set aside"
        has_starved = failure.kind is FailureKind.MEMORY and attempt < ATTEMPTS
        if has_starved or (failure.kind is FailureKind.DIED and attempt == ATTEMPTS - 1):
            after += " with fewer paths in flight, and may have other noise"
            after += "; if that is enough, so are those after it" if has_starved else ""
        self._progress.monitor.say(f"{unit.name}: {failure.text}; {after}")
        if attempt >= ATTEMPTS:
            self._aside.add(unit, failures)

    def _no_space(self, error: Exception) -> NoSpaceError:
        need = bytes_needed(self._run, [unit.name for unit in self._graph.unfinished()])
        free = shutil.disk_usage(self._run.folder).free
        told = (
            f"what is left will need about {max(need / MB, 1.0):.0f} MB"
            if need
            else "what is left needs room"
        )
        return NoSpaceError(f"{error} ({told}; {free / MB:.1f} MB are free)")


class _Aside:
    """Units that were set aside, over all shifts: one that comes later does not hand them out again."""

    def __init__(self, run: Run, monitor: Monitor) -> None:
        self._folder = run.folder / ASIDE
        self._monitor = monitor
        self._last: dict[str, str] = {}  # unit -> how it failed last

    def __contains__(self, name: str) -> bool:
        return name in self._last

    def add(self, unit: Unit, failures: list[Failure]) -> None:
        """Write what its workers said into its log."""
        self._last[unit.name] = failures[-1].text
        parts = [f"attempt {n}: {f.text}\n\n{f.log}\n" for n, f in enumerate(failures, 1)]
        file = self._folder / f"{re.sub(r'[^a-z0-9-]+', '-', unit.name.lower())}.log"
        try:
            with whole_file(file) as beside:
                beside.write_text("".join(parts), encoding="utf-8")
        except EnfiladeError as error:  # the run goes on without its log
            self._monitor.say(str(error))

    def drop(self, unit: Unit) -> None:
        """Strike out a unit that another command has finished."""
        self._last.pop(unit.name, None)

    def check(self, left: int) -> None:
        """Raise an error if there is one; `left` more need them."""
        names = tuple(self._last)
        if not names:
            return
        raise UnfinishedError(
            f"{len(names)} of the run's units failed again and again: {shortened(names)} "
            f"({self._last[names[0]]}); their logs are in {self._folder}. The rest is done but for "
            f"{left} that need them; the same command tries them again",
            names,
        )


class _Here:
    """The recipe of the worker that is this process: it writes in the run itself."""

    def __init__(self, job: Job, run: Run) -> None:
        self._job = job
        self._run = run

    def make(self, tell: Any, *, share: int = 1) -> Callable[[str, Mapping[str, Any]], None]:
        """Make the worker."""
        from enfilade.arrays import release_memory
        from enfilade.pipeline.worker import Worker, smaller

        check_identity(self._job, self._run)
        release_memory()  # of one that failed
        return Worker(smaller(self._job, share), self._run, Distant(tell)).do


def shortened(names: Sequence[str]) -> str:
    """Names for a message: some of them, and how many more there are."""
    return ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")


def bytes_needed(run: Run, names: list[str]) -> float:
    """What units of these names will take on the disk, from what others of their kind took."""
    sizes: dict[str, list[int]] = {}
    for line in run.lines():
        sizes.setdefault(line["unit"].partition(" ")[0], []).append(
            sum(record["bytes"] for record in line["files"].values())
        )
    kinds = [name.partition(" ")[0] for name in names]
    # A frame nobody has finished yet takes as much as one on its way to it.
    known = {kind: sum(found) / len(found) for kind, found in sizes.items()}
    usual = max(known.values(), default=0.0)
    return sum(known.get(kind, usual) for kind in kinds)
