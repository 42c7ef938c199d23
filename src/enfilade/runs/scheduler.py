"""Hands out the tasks of a run until all are done: tries failed ones again, then sets them aside."""

from __future__ import annotations

import heapq
import re
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing

from enfilade.device import active
from enfilade.errors import DamagedFileError, EnfiladeError, UnfinishedError
from enfilade.files import whole_file
from enfilade.methods.base import Pass, Task, TaskId
from enfilade.monitor import Monitor
from enfilade.runs.delivery import ANALYSIS, CLIPS, VIDEO, analysis_tasks, video_facts, video_tasks
from enfilade.runs.executor import Ended, Executor, InProcess, Order, Workers
from enfilade.runs.failure import Failure, FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.graph import TaskGraph, block_of
from enfilade.runs.job import Job
from enfilade.runs.resources import cores, gpus
from enfilade.runs.worker import analysis_of
from enfilade.settings import LimitSettings

ATTEMPTS = 3  # of a task
DELAYS_S = (1.0, 10.0)  # before the second and the third
REDUCTION = 4  # of the paths in flight, with each attempt after a lack of memory
SET_ASIDE_IN_A_ROW = 4  # tasks with no success between, after which the run ends
REPAIRS = 1000  # damaged files that are made again in one go
FAILED = "failed"  # folder of the logs of tasks that were set aside
SHOWN = 5  # tasks named in a message


def passes_of(job: Job) -> list[Pass]:
    """All passes of a run, in order."""
    return [ANALYSIS, *job.opened_method().passes, CLIPS, VIDEO]


def tasks_of(job: Job, run: RunFolder) -> list[Task]:
    """All tasks of a run; before its path is analyzed, those of the analysis alone."""
    count = len(job.path)
    analysis = analysis_tasks(count)
    if not all(is_done(job, run, task) for task in analysis):
        return analysis
    return [*analysis, *job.opened_method().tasks(analysis_of(job, run)), *video_tasks(count)]


def is_done(job: Job, run: RunFolder, task: Task) -> bool:
    """Whether a task is finished and its files have the sizes on record."""
    line = run.line(task.pass_name, job.path.numbers[task.frame])
    if line is None:
        return False
    is_video = task.pass_name in (CLIPS.name, VIDEO.name)
    return not is_video or line["video"] == video_facts(job)["video"]


def work(
    job: Job,
    run: RunFolder,
    workers: Workers,
    monitor: Monitor,
    *,
    chosen: Callable[[Sequence[Task]], list[Task]] | None = None,
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
        Chooses the tasks of this command from all; others are done by other commands.

    Raises
    ------
    UnfinishedError
        Some tasks failed again and again and were set aside; the rest is done.
    NoSpaceError
        The disk is full. All finished tasks stay.
    EnfiladeError
        An error of the input or of a method.
    """
    for _ in range(REPAIRS):
        # New workers after each repair: the old ones have the damaged file in memory, and would not write it.
        with closing(_Opened(job, run, workers)) as executor:
            damaged = _work_once(job, run, executor, monitor, chosen)
        if damaged is None:
            return
        run.forget(damaged)
        monitor.say(f"{damaged} is missing or damaged: its task is done again")
    raise EnfiladeError(f"more than {REPAIRS} files of {run.folder} were damaged while it was worked on")


def _work_once(
    job: Job,
    run: RunFolder,
    executor: _Opened,
    monitor: Monitor,
    chosen: Callable[[Sequence[Task]], list[Task]] | None,
) -> str | None:
    """Do all tasks; returns the name of a damaged file where one was found."""
    while True:
        everything = tasks_of(job, run)
        mine = everything if chosen is None else chosen(everything)
        left = [task for task in mine if not is_done(job, run, task)]
        if left:
            loop = _Loop(job, run, TaskGraph(passes_of(job), left), executor.get(), monitor, mine)
            if (damaged := loop.run()) is not None:
                return damaged
        elif len(everything) > len(analysis_tasks(len(job.path))):
            return None


class _Opened:
    """The executor, opened when it is first needed."""

    def __init__(self, job: Job, run: RunFolder, workers: Workers) -> None:
        self._job = job
        self._run = run
        self._workers = workers
        self._executor: Executor | None = None

    def get(self) -> Executor:
        """The executor."""
        if self._executor is None:
            self._executor = open_executor(self._job, self._run, self._workers)
            if self._run.lock is not None:
                self._run.lock.sign(self._executor.slots)
        return self._executor

    def close(self) -> None:
        """End its workers."""
        if self._executor is not None:
            self._executor.close()


def open_executor(job: Job, run: RunFolder, workers: Workers) -> Executor:
    """Open the executor of a run.

    Raises
    ------
    EnfiladeError
        Ray is not installed, or its cluster does not answer.
    """
    kind, _, address = workers.executor.partition(":")
    if kind == "in-process":
        return InProcess(job, run)
    device = "gpu" if active().backend == "cuda" else "cpu"
    timeout_s = job.settings[LimitSettings].task_timeout_s
    if kind == "processes":
        from enfilade.runs.processes import Processes

        names = gpus() if device == "gpu" else []
        count = workers.count or max(len(names), 1 if device == "gpu" else cores())
        threads = workers.threads or max(cores() // count, 1)
        return Processes(run, device=device, workers=count, threads=threads, timeout_s=timeout_s, gpus=names)
    from enfilade.runs.cluster import Cluster

    return Cluster(run, workers, address=address, device=device, timeout_s=timeout_s)


class _Loop:
    """One pass over the tasks that are left."""

    def __init__(
        self,
        job: Job,
        run: RunFolder,
        graph: TaskGraph,
        executor: Executor,
        monitor: Monitor,
        everything: Iterable[Task],
    ) -> None:
        self._job = job
        self._run = run
        self._graph = graph
        self._executor = executor
        self._progress = _Progress(monitor, everything, graph.unfinished)
        self._monitor = monitor
        self._in_hand: dict[int, Task] = {}
        self._blocks: dict[int, int] = {}  # of the workers
        self._failures: dict[TaskId, list[Failure]] = {}
        self._delayed: list[tuple[float, int, Task]] = []
        self._set_aside: list[Task] = []
        self._in_a_row = 0

    def run(self) -> str | None:
        """Do the tasks; returns the name of a damaged file where one was found."""
        while True:
            self._hand_out()
            if not self._in_hand:
                if not self._delayed:
                    break
                time.sleep(max(self._delayed[0][0] - time.monotonic(), 0.0))
                continue
            wait_s = max(self._delayed[0][0] - time.monotonic(), 0.0) if self._delayed else None
            for ended in self._executor.wait(wait_s):
                task = self._in_hand.pop(ended.slot)
                if ended.failure is None:
                    self._finish(task, ended)
                elif ended.failure.kind is FailureKind.DAMAGED:
                    assert isinstance(ended.failure.error, DamagedFileError)  # noqa: S101
                    return ended.failure.error.file
                else:
                    self._fail(task, ended.failure, ended.slot)
        self._report()
        return None

    def _hand_out(self) -> None:
        now = time.monotonic()
        while self._delayed and self._delayed[0][0] <= now:
            self._graph.put_back(heapq.heappop(self._delayed)[2])
        for slot in range(self._executor.slots):
            if slot in self._in_hand:
                continue
            others = [block for other, block in self._blocks.items() if other != slot and other in self._in_hand]
            task = self._graph.take(self._blocks.get(slot), others)
            if task is None:
                break
            self._in_hand[slot], self._blocks[slot] = task, block_of(task)
            starved = sum(f.kind is FailureKind.MEMORY for f in self._failures.get(task.id, ()))
            self._executor.begin(slot, Order(task, REDUCTION**starved))

    def _finish(self, task: Task, ended: Ended) -> None:
        self._run.finish(ended.line or {})
        self._graph.finish(task)
        self._progress.advance(task)
        self._in_a_row = 0

    def _fail(self, task: Task, failure: Failure, slot: int) -> None:
        if failure.kind is FailureKind.FATAL:
            raise failure.error or EnfiladeError(failure.text)
        self._executor.discard(slot)  # it may have left the device in a bad state
        failures = self._failures.setdefault(task.id, [])
        failures.append(failure)
        if len(failures) < ATTEMPTS:
            delay_s = DELAYS_S[len(failures) - 1]
            heapq.heappush(self._delayed, (time.monotonic() + delay_s, id(task), task))
            fewer = ", with fewer paths in flight" if failure.kind is FailureKind.MEMORY else ""
            self._monitor.say(f"{self._name(task)}: {failure.text}; it is tried again{fewer}")
            return
        self._graph.give_up(task)
        self._set_aside.append(task)
        self._in_a_row += 1
        self._write_log(task, failures)
        self._monitor.say(f"{self._name(task)}: {failure.text}; it is set aside")
        if self._in_a_row >= SET_ASIDE_IN_A_ROW:
            self._report()

    def _report(self) -> None:
        """Raise an error where tasks were set aside."""
        if not self._set_aside:
            return
        names = [self._name(task) for task in self._set_aside]
        last = self._failures[self._set_aside[-1].id][-1]
        raise UnfinishedError(
            f"{len(names)} of the run's tasks failed {ATTEMPTS} times each: {shortened(names)} ({last.text}); their logs "
            f"are in {self._run.folder / FAILED}. {len(self._graph)} more are left; the same command goes on",
            tuple(names),
        )

    def _write_log(self, task: Task, failures: list[Failure]) -> None:
        text = "".join(f"attempt {n}: {f.text}\n\n{f.log}\n" for n, f in enumerate(failures, 1))
        name = re.sub(r"[^a-z0-9_-]+", "-", self._name(task))
        try:
            with whole_file(self._run.folder / FAILED / f"{name}.log") as beside:
                beside.write_text(text, encoding="utf-8")
        except EnfiladeError as error:  # the run goes on without the log
            self._monitor.say(str(error))

    def _name(self, task: Task) -> str:
        return f"{task.pass_name} {self._job.path.numbers[task.frame]}"


class _Progress:
    """Counts the finished tasks of each pass for a monitor."""

    def __init__(self, monitor: Monitor, everything: Iterable[Task], left: Iterable[Task]) -> None:
        self._monitor = monitor
        self._totals: dict[str, int] = {}
        for task in everything:
            self._totals[task.pass_name] = self._totals.get(task.pass_name, 0) + 1
        self._done = dict(self._totals)
        for task in left:
            self._done[task.pass_name] -= 1
        before = [f"{name} {n} of {self._totals[name]}" for name, n in self._done.items() if n]
        if len(before) > 1:  # more than the analysis
            monitor.say(f"done before: {', '.join(before)}")

    def advance(self, task: Task) -> None:
        """Count a task."""
        self._done[task.pass_name] += 1
        self._monitor.progress(task.pass_name, self._done[task.pass_name], self._totals[task.pass_name])


def shortened(names: Sequence[str]) -> str:
    """Names for a message: the first ones, and how many more there are."""
    return ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
