"""Hands out the tasks of a run until all are done: tries failed ones again, then sets them aside."""

from __future__ import annotations

import heapq
import re
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from enfilade.device import active, load
from enfilade.errors import DamagedFileError, EnfiladeError, UnfinishedError
from enfilade.files import whole_file
from enfilade.methods.base import FRAMES, Pass, Task, TaskId
from enfilade.monitor import Monitor
from enfilade.runs.delivery import ANALYSIS, CLIPS, VIDEO, VIDEO_PASSES, analysis_tasks, video_tasks
from enfilade.runs.executor import Executor, InProcess, Order, Workers
from enfilade.runs.failure import Failure, FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.graph import TaskGraph, block_of
from enfilade.runs.job import Job
from enfilade.runs.resources import cores, gpus
from enfilade.runs.worker import analysis_of
from enfilade.settings import LimitSettings

ATTEMPTS = 3  # at a task, and at a file that is found damaged again and again
DELAYS_S = (1.0, 10.0)  # before the second and the third
REDUCTION = 4  # of the paths in flight, after a lack of memory
QUARANTINED_IN_A_ROW = 4  # tasks without a success between them, after which the run ends
FAILED = "failed"  # folder of the logs of tasks that were quarantined
SHOWN = 5  # tasks named in a message

Chosen = Callable[[Sequence[Task]], list[Task]]  # those tasks of a run that this command does


def passes_of(job: Job) -> list[Pass]:
    """All passes of a run, in order."""
    return [ANALYSIS, *job.opened_method().passes, CLIPS, VIDEO]


def tasks_of(job: Job, run: RunFolder) -> list[Task]:
    """All tasks of a run; before its path is analyzed, those of the analysis alone.

    Raises
    ------
    EnfiladeError
        The method's passes and tasks contradict each other.
    """
    analysis = analysis_tasks(len(job.path))
    if not all(is_done(job, run, task) for task in analysis):
        return analysis
    method = job.opened_method()
    tasks = list(method.tasks(analysis_of(job, run)))
    if problem := _contradiction(method.passes, [*analysis, *tasks]):
        raise EnfiladeError(f"--method {job.method}: {problem}")
    return [*analysis, *tasks, *video_tasks(len(job.path))]


def _contradiction(passes: Iterable[Pass], tasks: Sequence[Task]) -> str:
    """Defect of a method's passes and tasks, those of the analysis among these; empty if there is none."""
    names, known = {of.name for of in passes}, {task.id for task in tasks}
    if reserved := names & {ANALYSIS.name, *VIDEO_PASSES}:
        return f"the name of the pass {min(reserved)} is that of a pass of every run; choose another"
    if FRAMES not in {task.pass_name for task in tasks}:
        return f"it has no task of the pass {FRAMES}, which delivers frames"
    for task in tasks:
        if task.pass_name not in {*names, ANALYSIS.name}:
            return f"its task {task.pass_name} {task.frame} is of none of its passes"
        for need in task.needs:
            if need not in known:
                return f"its task {task.pass_name} {task.frame} needs {need.pass_name} {need.frame}, no task"
    return ""


def is_done(job: Job, run: RunFolder, task: Task) -> bool:
    """Whether a task is finished and its files have the sizes on record."""
    line = run.line(task.pass_name, job.path.numbers[task.frame])
    if line is None:
        return False
    return task.pass_name not in VIDEO_PASSES or bool(line["video"] == job.video_identity)


def tasks_left(job: Job, run: RunFolder, tasks: Iterable[Task]) -> list[Task]:
    """Tasks to do, of some: those that never finished, and those whose files are lost and still needed.

    Files of frames and of the video are needed, and records that a pass with tasks to do reads.
    """
    left: list[Task] = []
    needed = {FRAMES, *VIDEO_PASSES}
    undone = [task for task in tasks if not is_done(job, run, task)]
    for of in reversed(passes_of(job)):
        own = [task for task in undone if task.pass_name == of.name]
        numbers = [job.path.numbers[task.frame] for task in own]
        if of.name in needed or any(run.recorded(of.name, number) is None for number in numbers):
            left += own
            needed.update(of.reads if own else ())
    return left


def work(
    job: Job, run: RunFolder, workers: Workers, monitor: Monitor, *, chosen: Chosen | None = None
) -> None:
    """Do all tasks of a run that are not done.

    Parameters
    ----------
    job
    run
        Opened to write in it.
    workers
    monitor
    chosen
        Chooses the tasks of this command; others are done by other commands. None: all.

    Raises
    ------
    UnfinishedError
        Some tasks failed again and again and were quarantined; the rest is done.
    NoSpaceError
        The disk is full. All finished tasks stay.
    EnfiladeError
        An error of the input or of a method; a file that is damaged, or a task that is lost, again and
        again.
    """
    damages: Counter[str] = Counter()
    reduction = 1
    finished: Counter[TaskId] = Counter()
    executor: Executor | None = None
    run.refresh()
    try:
        while True:
            # The analysis alone, at first: the tasks of the method depend on it.
            mine = tasks_of(job, run) if chosen is None else chosen(tasks_of(job, run))
            left = tasks_left(job, run, mine)
            if not left:
                return
            _check_progress(job, [task for task in left if finished[task.id] >= ATTEMPTS])
            executor = executor or open_executor(job, run, workers)
            loop = _Loop(job, run, left, executor, monitor, mine, reduction)
            damaged, reduction = loop.run(), loop.reduction
            if damaged is None:
                finished.update(task.id for task in left)
                if left[0].pass_name == ANALYSIS.name:
                    _warn(job, run, monitor)
                continue

            # New workers: the old ones have the damaged file in memory, and would not write it again.
            executor.close()
            executor = None
            damages[damaged] += 1
            if damages[damaged] >= ATTEMPTS:
                raise EnfiladeError(
                    f"{run.folder / damaged} was damaged {ATTEMPTS} times during the run; check its disk"
                )
            run.forget(damaged)
            monitor.message(f"{damaged} is missing or damaged: its task is done again")
            run.refresh()
    finally:
        if executor is not None:
            executor.close()


def _check_progress(job: Job, again: Sequence[Task]) -> None:
    """Refuse to do tasks again that were finished several times."""
    if again:
        names = shortened([f"{task.pass_name} {job.path.numbers[task.frame]}" for task in again])
        raise EnfiladeError(
            f"{names}: finished {ATTEMPTS} times, and not done yet; several tasks write one file, a host has "
            "another version of OpenColorIO, or something else removes or changes their files"
        )


def _warn(job: Job, run: RunFolder, monitor: Monitor) -> None:
    """Tell of black frames, and of what no frame will show, as soon as the whole path is analyzed."""
    run.refresh()
    if all(is_done(job, run, task) for task in analysis_tasks(len(job.path))):
        line = run.line(ANALYSIS.name, job.path.numbers[0]) or {}
        for note in (analysis_of(job, run).warning, *line.get("notes", ())):
            if note and note not in run.notes:  # of the preflight
                monitor.message(note)


def open_executor(job: Job, run: RunFolder, workers: Workers) -> Executor:
    """Open the executor of a run.

    Raises
    ------
    EnfiladeError
        The Ray cluster does not answer.
    """
    kind, _, address = workers.executor.partition(":")
    device = "gpu" if active().backend == "cuda" else "cpu"
    limits = job.settings[LimitSettings]
    executor: Executor
    if kind == "in-process":
        if workers.threads:
            load().set_thread_count(workers.threads)
        executor = InProcess(job, run)
    elif kind == "processes":
        from enfilade.runs.processes import Processes

        names = gpus() if device == "gpu" else []
        count = workers.count or max(len(names), 1 if device == "gpu" else cores())
        threads = workers.threads or max(cores() // count, 1)
        executor = Processes(run, limits, device=device, workers=count, threads=threads, gpus=names)
    else:
        from enfilade.runs.cluster import Cluster

        executor = Cluster(run, limits, workers, address=address, device=device)
    if run.lock is not None:
        run.lock.sign()
    return executor


class _Loop:
    """One pass over the tasks that are left."""

    def __init__(
        self,
        job: Job,
        run: RunFolder,
        left: Sequence[Task],
        executor: Executor,
        monitor: Monitor,
        everything: Iterable[Task],
        reduction: int,
    ) -> None:
        self._job = job
        self._run = run
        self._graph = TaskGraph(passes_of(job), left)
        self._executor = executor
        self._monitor = monitor
        self._totals = Counter(task.pass_name for task in everything)
        self._counts = self._totals - Counter(task.pass_name for task in left)
        self._begun: set[str] = set()  # names of passes
        self._in_hand: dict[int, Order] = {}
        self._blocks: dict[int, int] = {}  # of the workers
        self.reduction = reduction  # of the paths in flight, after a lack of memory
        self._failures: dict[TaskId, list[Failure]] = {}
        self._delayed: list[tuple[float, TaskId, Task]] = []
        self._quarantined: list[Task] = []
        self._in_a_row = 0

    def run(self) -> str | None:
        """Do the tasks; returns the name of a damaged file if one is found."""
        while self._hand_out():
            delay_s = max(self._delayed[0][0] - time.monotonic(), 0.0) if self._delayed else None
            if not self._in_hand:  # until the next attempt at a failed task
                time.sleep(delay_s or 0.0)
                continue
            damaged = None
            results = self._executor.wait(delay_s)
            # Successes first: a fatal failure ends the run.
            for ended in sorted(results, key=lambda ended: isinstance(ended.result, Failure)):
                order = self._in_hand.pop(ended.slot)
                if not isinstance(ended.result, Failure):
                    self._finish(order, ended.result)
                elif isinstance(ended.result.error, DamagedFileError):
                    damaged = ended.result.error.file
                else:
                    self._executor.discard(ended.slot)  # it may have left the device in a bad state
                    self._fail(order, ended.result)
            if damaged is not None:
                return damaged
        self._report()
        if left := self._graph.unfinished:
            names = shortened([self._name(task) for task in left])
            raise EnfiladeError(f"--method {self._job.method}: its tasks need each other: {names}")
        return None

    def _hand_out(self) -> bool:
        """Give tasks to free workers; returns whether there is anything to wait for."""
        now = time.monotonic()
        while self._delayed and self._delayed[0][0] <= now:
            self._graph.put_back(heapq.heappop(self._delayed)[2])
        for slot in range(self._executor.slots):
            if slot in self._in_hand:
                continue
            others = [self._blocks[other] for other in self._in_hand]
            task = self._graph.take(self._blocks.get(slot), others)
            if task is None:
                break
            self._in_hand[slot], self._blocks[slot] = Order(task, self.reduction), block_of(task)
            if task.pass_name not in self._begun:
                self._begun.add(task.pass_name)
                self._show(task.pass_name)
            self._executor.begin(slot, self._in_hand[slot])
        return bool(self._in_hand or self._delayed)

    def _finish(self, order: Order, line: dict[str, Any]) -> None:
        task = order.task
        self._run.finish(line if order.reduction == 1 else line | {"reduction": order.reduction})
        self._graph.finish(task)
        self._counts[task.pass_name] += 1
        self._show(task.pass_name)
        self._in_a_row = 0

    def _show(self, name: str) -> None:
        """Show the progress of a pass."""
        self._monitor.progress(name, self._counts[name], self._totals[name])

    def _fail(self, order: Order, failure: Failure) -> None:
        if failure.kind is FailureKind.FATAL:
            raise failure.error or EnfiladeError(failure.text)
        task, fewer = order.task, ""
        if failure.kind is FailureKind.MEMORY:  # other tasks would need as much
            self.reduction = max(self.reduction, order.reduction * REDUCTION)
            fewer = ", with fewer paths in flight"
        failures = self._failures.setdefault(task.id, [])
        failures.append(failure)
        if len(failures) < ATTEMPTS:
            self._monitor.message(f"{self._name(task)}: {failure.text}; it is tried again{fewer}")
            until = time.monotonic() + DELAYS_S[len(failures) - 1]
            heapq.heappush(self._delayed, (until, task.id, task))
            return
        self._graph.give_up(task)
        self._quarantined.append(task)
        self._in_a_row += 1
        self._write_log(task, failures)
        self._monitor.message(f"{self._name(task)}: {failure.text}; it is quarantined")
        if self._in_a_row >= QUARANTINED_IN_A_ROW:
            self._report()

    def _report(self) -> None:
        """Raise an error if tasks were quarantined."""
        if not self._quarantined:
            return
        names = [self._name(task) for task in self._quarantined]
        last = self._failures[self._quarantined[-1].id][-1]
        raise UnfinishedError(
            f"{len(names)} tasks failed {ATTEMPTS} times each: {shortened(names)} ({last.text}); their logs "
            f"are in {self._run.folder / FAILED}. {len(self._graph.unfinished)} more tasks are left; the "
            "same command continues",
            tuple(names),
        )

    def _write_log(self, task: Task, failures: list[Failure]) -> None:
        text = "".join(f"attempt {n}: {f.text}\n\n{f.log}\n" for n, f in enumerate(failures, 1))
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", self._name(task))
        try:
            with whole_file(self._run.folder / FAILED / f"{name}.log") as beside:
                beside.write_text(text, encoding="utf-8")
        except EnfiladeError as error:  # the run goes on without the log
            self._monitor.message(str(error))

    def _name(self, task: Task) -> str:
        return f"{task.pass_name} {self._job.path.numbers[task.frame]}"


def shortened(names: Sequence[str]) -> str:
    """Names for a message: the first ones, and how many more there are."""
    return ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
