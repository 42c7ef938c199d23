"""Units are offered when what they need is finished, those of one group to one worker."""

import random
import time
from bisect import bisect_right

import pytest

from enfilade.executors import Graph, Unit


def taken(graph, **where):
    unit = graph.take(**where)
    return None if unit is None else unit.name


def test_order_and_needs():
    graph = Graph()
    graph.add(Unit("c", "", needs=("a", "b"), order=(2,)))
    graph.add(Unit("b", "", order=(1, 2)))
    graph.add(Unit("a", "", order=(1, 1)))
    assert [taken(graph) for _ in range(3)] == ["a", "b", None]
    graph.finish("a")
    assert taken(graph) is None
    graph.finish("b")
    assert taken(graph) == "c"
    assert [u.name for u in graph.unfinished()] == ["c"]
    graph.finish("c")
    assert graph.unfinished() == []


def test_what_is_needed_may_come_later():
    graph = Graph()
    graph.add(Unit("b", "", needs=("a",)))
    assert taken(graph) is None
    graph.add(Unit("a", ""))
    graph.finish(taken(graph))
    assert taken(graph) == "b"


def test_a_unit_that_was_finished_before_is_not_offered():
    graph = Graph()
    graph.finish("a")
    graph.add(Unit("a", ""))
    graph.add(Unit("b", "", needs=("a",)))
    assert [taken(graph), taken(graph)] == ["b", None]


def test_gates_open_by_themselves():
    graph = Graph()
    graph.add(Unit("open", "", is_gate=True))
    graph.add(Unit("gate", "", needs=("a", "open"), is_gate=True))
    graph.add(Unit("inner", "", needs=("gate",), is_gate=True))
    graph.add(Unit("z", "", needs=("inner",)))
    graph.add(Unit("a", ""))
    assert [taken(graph), taken(graph)] == ["a", None]
    graph.finish("a")
    assert taken(graph) == "z"
    assert [u.name for u in graph.unfinished()] == ["z"]


def in_groups(count, size):
    graph = Graph()
    units = [Unit(f"u{n}", "", order=(1, n), group=f"g{n // size}") for n in range(count)]
    for unit in units:
        graph.add(unit)
    return graph, units


def test_a_worker_stays_with_its_group_and_out_of_others():
    graph, units = in_groups(6, 2)
    later = Unit("later", "", order=(2,), group="g0")
    graph.add(later)
    assert taken(graph, last=units[3]) == "u2"
    assert taken(graph, busy=[units[2]]) == "u0"
    assert taken(graph, busy=[units[0], units[2]]) == "u4"
    assert taken(graph, last=units[0]) == "u1"
    # A unit of a later stage waits for those of the present one, also where its group is at hand.
    assert taken(graph, last=later, busy=[units[2]]) == "u5"
    assert taken(graph, last=units[5], busy=[units[2]]) == "u3"  # rather the group of another than nothing
    assert taken(graph) == "later"


def test_one_worker_alone_does_all_in_order():
    graph, units = in_groups(12, 3)
    last = None
    for unit in units:
        last = graph.take(last)
        assert last is unit


@pytest.mark.parametrize("workers", [2, 3, 7])
def test_workers_go_on_with_what_follows(workers):
    graph, units = in_groups(400, 4)
    lasts: list[Unit | None] = [None] * workers
    hands: list[Unit | None] = [None] * workers
    done, jumps = [], 0
    while len(done) < len(units):
        for slot in range(workers):  # all are equally fast
            if hands[slot] is not None:
                done.append(hands[slot])
            others = [unit for at, unit in enumerate(hands) if at != slot and unit is not None]
            last, unit = lasts[slot], graph.take(lasts[slot], others)
            if unit is not None and last is not None:
                jumps += not last.order < unit.order <= (1, last.order[1] + 4)
            lasts[slot], hands[slot] = unit or last, unit
    assert sorted(unit.order for unit in done) == [unit.order for unit in units]
    assert jumps < 8 * workers  # of 100 groups


def test_what_was_set_aside_before_it_came_is_not_offered():
    graph = Graph()
    graph.set_aside("a")
    graph.add(Unit("a", ""))
    graph.add(Unit("b", "", needs=("a",)))
    graph.add(Unit("c", ""))
    assert [taken(graph), taken(graph)] == ["c", None]


def test_what_was_set_aside_holds_up_who_needs_it():
    graph = Graph()
    graph.add(Unit("a", ""))
    graph.add(Unit("b", "", needs=("a",)))
    graph.set_aside(taken(graph))
    assert taken(graph) is None
    assert [u.name for u in graph.unfinished()] == ["b"]


def plainly(graph, last, busy):
    """The unit that is to be begun next, as all groups that are ready are looked through."""
    heads = {group: heap[0] for group, heap in graph._ready.items()}
    if not heads:
        return None
    stage = min(order for order, _ in heads.values())[:1]
    groups = sorted((g for g in heads if heads[g][0][:1] == stage), key=lambda g: heads[g][0])
    return heads[chosen({group: heads[group][0] for group in groups}, last, busy)][1]


def chosen(ready, last, busy):
    if last is not None and last.group in ready:
        return last.group
    taken = {unit.group for unit in busy}
    free = [group for group in ready if group not in taken] or list(ready)
    if not busy:
        return free[0]
    marks = sorted(unit.order for unit in (*busy, last) if unit is not None)
    stretches = {}
    for group in free:
        stretches.setdefault(bisect_right(marks, ready[group]), []).append(group)
    if last is not None and (following := stretches.get(bisect_right(marks, last.order))):
        return following[0]
    at, longest = max(stretches.items(), key=lambda item: len(item[1]))
    return longest[len(longest) // 2 if at else 0]


@pytest.mark.parametrize("seed", range(30))
def test_the_choice_is_that_of_looking_through_all(seed):
    chance = random.Random(seed)  # noqa: S311
    graph, hands, lasts, added = Graph(), {}, {}, 0
    for _ in range(400):
        act = chance.random()
        if act < 0.4:
            for _ in range(chance.randrange(1, 9)):
                place = chance.randrange(60)  # so few that some are alike
                needs = (f"u{chance.randrange(added + 5)}",) if chance.random() < 0.2 else ()
                order = (chance.randrange(3), place, 0)[: chance.randrange(1, 4)]
                group = f"g{place // 4}" if chance.random() < 0.9 else ""
                graph.add(Unit(f"u{added}", "", needs=needs, order=order, group=group))
                added += 1
        slot = chance.randrange(5)
        if slot in hands:
            unit = hands.pop(slot)
            graph.finish(unit.name) if chance.random() < 0.8 else graph.put_back(unit)
        else:
            expected = plainly(graph, lasts.get(slot), hands.values())
            unit = graph.take(lasts.get(slot), hands.values())
            assert (unit and unit.name) == expected
            if unit is not None:
                hands[slot] = lasts[slot] = unit


def test_many_groups_cost_one_unit_no_more():
    graph, units = in_groups(20_000, 1)
    begin = time.process_time()
    for number in range(1000):
        graph.take(units[number], units[number + 1 : number + 8])
    assert time.process_time() - begin < 2.0  # 0.04 s; where all groups are looked through, half a minute
