"""Tasks begin when their needs and barriers allow it, neighbours in one worker."""

from __future__ import annotations

import random

import pytest

from enfilade.methods.base import Pass, Task, TaskId
from enfilade.runs.graph import BLOCK, TaskGraph, block_of

A, B, C = Pass("a"), Pass("b", is_barrier=True), Pass("c")


def taken(graph, **where):
    task = graph.take(**where)
    return task and (task.pass_name, task.frame)


def test_a_task_waits_for_its_needs():
    last = Task("c", 9, needs=(TaskId("a", 1), TaskId("a", 2)))
    graph = TaskGraph([A, C], [last, Task("a", 2), Task("a", 1)])
    assert [taken(graph) for _ in range(3)] == [("a", 1), ("a", 2), None]
    graph.finish(Task("a", 2))
    assert taken(graph) is None
    graph.finish(Task("a", 1))
    assert taken(graph) == ("c", 9)
    assert graph.unfinished == [last]
    graph.finish(last)
    assert graph.unfinished == []


def test_finished_needs_are_no_tasks():
    assert taken(TaskGraph([A, C], [Task("c", 3, needs=(TaskId("a", 3),))])) == ("c", 3)


def test_a_barrier_opens_shot_by_shot():
    tasks = [Task("a", 0, 0), Task("a", 5, 1), Task("b", 1, 0), Task("b", 6, 1)]
    graph = TaskGraph([A, B], tasks)
    assert [taken(graph) for _ in range(3)] == [("a", 0), ("a", 5), None]
    graph.finish(tasks[1])
    assert [taken(graph), taken(graph)] == [("b", 6), None]
    graph.finish(tasks[0])
    assert taken(graph) == ("b", 1)


def test_a_barrier_is_no_task_of_the_same_pass():
    """The barrier of pass b in shot 0 opens; task 0 of pass b is not finished."""
    tasks = [Task("a", 0), Task("b", 0), Task("c", 0, needs=(TaskId("b", 0),))]
    graph = TaskGraph([A, B, C], tasks)
    assert taken(graph) == ("a", 0)
    graph.finish(tasks[0])
    assert [taken(graph), taken(graph)] == [("b", 0), None]


def test_a_task_that_is_given_up_holds_up_its_successors():
    tasks = [Task("a", 0), Task("b", 0), Task("c", 0, needs=(TaskId("a", 0),)), Task("c", 1)]
    graph = TaskGraph([A, B, C], tasks)
    assert taken(graph) == ("c", 1)
    assert taken(graph) == ("a", 0)
    graph.give_up(tasks[0])
    graph.finish(tasks[3])
    assert taken(graph) is None
    assert graph.unfinished == tasks[1:3]


def test_a_task_is_offered_again():
    graph = TaskGraph([A], [Task("a", 0)])
    task = graph.take()
    assert taken(graph) is None
    graph.put_back(task)
    assert graph.take() is task


def test_a_worker_stays_in_its_block_and_out_of_others():
    frames = range(3 * BLOCK)
    graph = TaskGraph([A, C], [Task("a", f) for f in frames] + [Task("c", f) for f in (1, BLOCK)])
    assert taken(graph) == ("c", 1)  # later passes first
    assert taken(graph, block=0, busy=[0]) == ("a", 0)
    assert taken(graph, busy=[0]) == ("c", BLOCK)
    assert taken(graph, busy=[0, 1]) == ("a", 2 * BLOCK)
    assert taken(graph, block=1, busy=[0, 2]) == ("a", BLOCK)
    assert taken(graph, block=7, busy=[0, 1, 2]) == (
        "a",
        1,
    )  # rather the block of another worker than nothing


def test_a_task_belongs_to_the_block_of_its_last_need():
    assert block_of(Task("c", 1, needs=(TaskId("a", 2 * BLOCK), TaskId("a", 0)))) == 2
    assert block_of(Task("a", BLOCK)) == 1


@pytest.mark.parametrize("seed", range(20))
def test_any_graph_is_done_in_an_order_that_is_allowed(seed):
    chance = random.Random(seed)  # noqa: S311
    passes = [Pass(name, is_barrier=chance.random() < 0.4) for name in "abcd"]
    tasks = []
    for index, of in enumerate(passes):
        for frame in range(40):
            before = [task.id for task in tasks if task.pass_name != of.name and task.shot == frame // 20]
            needs = chance.sample(before, min(len(before), chance.randrange(3))) if index else []
            tasks.append(Task(of.name, frame, frame // 20, tuple(needs)))
    order = {of.name: (index, of.is_barrier) for index, of in enumerate(passes)}
    graph, done, hands, blocks = TaskGraph(passes, chance.sample(tasks, len(tasks))), set(), {}, {}
    while graph.unfinished:
        slot = chance.randrange(3)
        if slot in hands:
            task = hands.pop(slot)
            if chance.random() < 0.2:
                graph.put_back(task)
            else:
                graph.finish(task)
                done.add(task.id)
        elif task := graph.take(blocks.get(slot), [blocks[s] for s in hands]):
            index, is_barrier = order[task.pass_name]
            assert done.issuperset(task.needs)
            if is_barrier:
                earlier = {t.id for t in tasks if t.shot == task.shot and order[t.pass_name][0] < index}
                assert done.issuperset(earlier)
            hands[slot], blocks[slot] = task, block_of(task)
        else:
            assert hands
    assert len(done) == len(tasks)
