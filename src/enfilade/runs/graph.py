"""The task graph of a run: finished tasks, ready tasks, and the order in which workers take them."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable

from enfilade.methods.base import Pass, Task, TaskId

BLOCK = 16  # frames; neighbouring tasks are best done by one worker, which has their inputs in memory

Gate = tuple[str, str, int]  # "barrier", its pass and shot: never equal to the name of a task


class TaskGraph:
    """Tasks with their needs.

    A worker stays in its block of frames as long as tasks are ready there; then it takes a block that no
    other worker is in. In a block later passes come first, so that frames are finished early and records are
    read while they are still in memory.

    Parameters
    ----------
    passes
        All passes, in order.
    tasks
        Tasks to do.
    """

    def __init__(self, passes: Iterable[Pass], tasks: Iterable[Task]) -> None:
        self._passes = {of.name: (index, of) for index, of in enumerate(passes)}
        self._tasks = {task.id: task for task in tasks}
        self._blocked: dict[TaskId, int] = {}  # number of unfinished needs
        self._waiting: dict[TaskId | Gate, list[TaskId]] = {}
        self._open: dict[tuple[int, int], int] = {}  # unfinished tasks of a pass and shot
        self._ready: dict[int, list[tuple[int, int, TaskId]]] = {}  # block -> heap
        self._unfinished = set(self._tasks)
        self._given_up: set[TaskId] = set()
        for task in self._tasks.values():
            place = self._index(task), task.shot
            self._open[place] = self._open.get(place, 0) + 1
        for task in self._tasks.values():
            self._add(task)

    @property
    def unfinished(self) -> list[Task]:
        """Tasks that are neither finished nor given up, in order."""
        left = [self._tasks[name] for name in self._unfinished - self._given_up]
        return sorted(left, key=lambda task: (self._index(task), task.frame))

    def take(self, block: int | None = None, busy: Collection[int] = ()) -> Task | None:
        """Take the task to begin next; None if none is ready.

        Parameters
        ----------
        block
            In which the worker did its last task.
        busy
            Blocks that other workers are in.
        """
        if not self._ready:
            return None
        if block not in self._ready:
            free = [b for b in self._ready if b not in busy] or list(self._ready)
            block = min(free, key=lambda b: (self._ready[b][0][0], b))
        heap = self._ready[block]
        _, _, name = heapq.heappop(heap)
        if not heap:
            del self._ready[block]
        return self._tasks[name]

    def put_back(self, task: Task) -> None:
        """Offer a task again."""
        heapq.heappush(self._ready.setdefault(block_of(task), []), self._entry(task))

    def finish(self, task: Task) -> None:
        """Mark a task as finished; others may become ready."""
        self._unfinished.discard(task.id)
        place = self._index(task), task.shot
        self._open[place] -= 1
        released = self._waiting.pop(task.id, [])
        if not self._open[place]:
            released = [*released, *self._opened_gates(task.shot)]
        for name in released:
            self._blocked[name] -= 1
            if not self._blocked[name]:
                self.put_back(self._tasks[name])

    def give_up(self, task: Task) -> None:
        """Set a task aside; tasks that need it never become ready."""
        self._given_up.add(task.id)

    def _add(self, task: Task) -> None:
        needs: list[TaskId | Gate] = [name for name in dict.fromkeys(task.needs) if name in self._unfinished]
        index, of = self._passes[task.pass_name]
        if of.is_barrier and not self._is_open(index, task.shot):
            needs.append(("barrier", task.pass_name, task.shot))
        self._blocked[task.id] = len(needs)
        for need in needs:
            self._waiting.setdefault(need, []).append(task.id)
        if not needs:
            self.put_back(task)

    def _is_open(self, index: int, shot: int) -> bool:
        """Whether all earlier passes of a shot are finished."""
        return not any(self._open.get((earlier, shot)) for earlier in range(index))

    def _opened_gates(self, shot: int) -> list[TaskId]:
        """Tasks that waited for a barrier of a shot, if it has just opened."""
        released: list[TaskId] = []
        for name, (index, of) in self._passes.items():
            gate = "barrier", name, shot
            if of.is_barrier and gate in self._waiting and self._is_open(index, shot):
                released += self._waiting.pop(gate)
        return released

    def _index(self, task: Task) -> int:
        return self._passes[task.pass_name][0]

    def _entry(self, task: Task) -> tuple[int, int, TaskId]:
        return -self._index(task), task.frame, task.id


def block_of(task: Task) -> int:
    """The block of frames of a task: that of the last frame that it needs."""
    return max([task.frame, *(need.frame for need in task.needs)]) // BLOCK
