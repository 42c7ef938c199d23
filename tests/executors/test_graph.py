"""Units are offered when what they need is finished, those of one group to one worker."""

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


def test_a_worker_stays_with_its_group_and_out_of_others():
    graph = Graph()
    for number in range(6):
        graph.add(Unit(f"u{number}", "", order=(1, number), group=f"g{number // 2}"))
    graph.add(Unit("next", "", order=(2,), group="g0"))
    assert taken(graph, group="g1") == "u2"
    assert taken(graph, group="none", busy={"g1"}) == "u0"
    assert taken(graph, group="none", busy={"g0", "g1"}) == "u4"
    assert taken(graph, group="g0") == "u1"
    # A unit of a later stage waits for those of the present one, also where its group is at hand.
    assert taken(graph, group="g0", busy={"g1"}) == "u5"
    assert taken(graph, group="g0", busy={"g1"}) == "u3"
    assert taken(graph) == "next"


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
