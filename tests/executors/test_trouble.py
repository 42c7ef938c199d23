"""A machine in trouble is given time; a unit that can't be done is not."""

import threading
import time

import pytest

from enfilade.errors import EnfiladeError
from enfilade.executors import ATTEMPTS, Failure, FailureKind, Graph, supervise, trouble
from enfilade.executors.executor import Event
from enfilade.executors.trouble import Trouble
from toy_worker import nothing, unit

DIED, ERROR, MEMORY = FailureKind.DIED, FailureKind.ERROR, FailureKind.MEMORY


class Clock:
    """A clock that goes only while somebody sleeps."""

    def __init__(self):
        self.now, self.slept = 1000.0, 0.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds
        self.slept += seconds


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    for module in ("supervisor", "trouble"):
        monkeypatch.setattr(f"enfilade.executors.{module}.time", clock)
    return clock


class Crowd:
    """Workers that do each unit as a test says, in half a second unless the test says more."""

    def __init__(self, clock, slots, do, seconds=None):
        self.slots, self.attempts, self.retired, self.most = slots, [], [], []
        self.shares, self.alive, self.scenes = [], set(), []
        self._clock, self._do, self._seconds, self._in_hand = clock, do, seconds or {}, {}

    def begin(self, slot, unit, *, share):
        self.attempts.append(unit.name)
        self.shares.append(share)
        self.alive.add(slot)
        self.scenes.append(len(self.alive))
        end = self._clock.now + self._seconds.get(unit.name, 0.5)
        self._in_hand[slot] = end, unit
        self.most.append(len(self._in_hand))

    def wait(self, timeout_s):
        if not self._in_hand:
            return []
        slot, (end, unit) = min(self._in_hand.items(), key=lambda item: item[1][0])
        if timeout_s is not None and end > self._clock.now + timeout_s:
            self._clock.now += timeout_s
            return []
        self._clock.now = max(end, self._clock.now)
        del self._in_hand[slot]
        kind = self._do(unit)
        return [Event(slot, None if kind is None else Failure(kind, f"it {kind.value}"))]

    def retire(self, slot):
        self.retired.append(slot)
        self.alive.discard(slot)


@pytest.fixture
def crowds():
    return []


@pytest.fixture
def spread(clock, crowds):
    """Do so many units; returns the ending, the workers and what was said of failures."""

    def do(count, act, slots=4, seconds=None):
        graph, said = Graph(), []
        for number in range(count):
            graph.add(unit(f"u{number:03d}"))
        crowds.append(crowd := Crowd(clock, slots, act, seconds))
        ending = supervise(
            graph,
            crowd,
            follow=nothing,
            is_done=lambda _: True,
            failed=lambda unit, own: said.append((unit.name, len(own), own[-1].text)),
        )
        return ending, crowd, said

    return do


@pytest.mark.parametrize("kind", [DIED, FailureKind.IO, ERROR, MEMORY])
@pytest.mark.parametrize("slots", [1, 4, 50])
def test_half_a_minute_of_trouble_sets_nothing_aside(spread, clock, kind, slots):
    begin, done = clock.now, []

    def act(unit):
        if clock.now < begin + 30.0:
            return kind
        done.append(unit.name)
        return None

    ending, _, _ = spread(100, act, slots)
    assert not ending.aside
    assert ending.stopped is None
    assert len(done) == 100


@pytest.mark.parametrize("kind", [DIED, FailureKind.IO, MEMORY])
def test_nor_where_one_unit_alone_is_left(spread, clock, kind):
    end = clock.now + 30.0
    ending, _, _ = spread(1, lambda _: kind if clock.now < end else None)
    assert not ending.aside


@pytest.mark.parametrize("kind", [DIED, ERROR, MEMORY])
@pytest.mark.parametrize("slots", [1, 4])
def test_a_unit_that_can_not_be_done_is_set_aside_after_four_attempts(spread, clock, kind, slots):
    ending, crowd, said = spread(40, lambda unit: kind if unit.name == "u003" else None, slots)
    assert [aside.name for aside, _ in ending.aside] == ["u003"]
    assert crowd.attempts.count("u003") == ATTEMPTS
    assert len(crowd.attempts) == 39 + ATTEMPTS
    assert [count for _, count, _ in said] == [1, 2, 3, 4]
    assert crowd.most[-1] <= slots


def test_so_are_some_of_many_that_can_not_be_done(spread, clock):
    bad = {f"u{number:03d}" for number in range(0, 40, 5)}
    ending, crowd, _ = spread(40, lambda unit: DIED if unit.name in bad else None)
    assert {aside.name for aside, _ in ending.aside} == bad
    assert ending.stopped is None
    assert len(set(crowd.attempts)) == 40


@pytest.mark.parametrize(("kind", "minutes"), [(DIED, 26), (FailureKind.IO, 26), (MEMORY, 28), (ERROR, 2)])
@pytest.mark.parametrize("count", [5, 1000])
def test_if_nothing_ever_succeeds_it_ends(spread, clock, kind, minutes, count):
    ending, crowd, said = spread(count, lambda _: kind)
    assert clock.slept < 60 * minutes
    assert len(crowd.attempts) < 100
    if ending.stopped is None:  # as often tried as a unit is
        assert len(ending.aside) == count == 5
        return
    assert isinstance(ending.stopped.error, EnfiladeError)
    text = str(ending.stopped.error)
    assert text.startswith("nothing succeeds any more: ")
    assert f"the last one since it {kind.value}. What is finished stays: see to the machine" in text
    assert any("all wait for " in own for _, _, own in said)
    assert all(number < ATTEMPTS for _, number, own in said if "does not count" in own)


def test_if_the_last_two_can_not_be_done_they_are_named(spread, clock):
    ending, _, _ = spread(20, lambda unit: DIED if unit.name in ("u018", "u019") else None, 2)
    assert {aside.name for aside, _ in ending.aside} == {"u018", "u019"}
    assert ending.stopped is None
    assert clock.slept < 26 * 60


def test_a_trial_is_one_unit_and_another_each_time(spread, clock):
    _, crowd, _ = spread(100, lambda _: DIED, slots=8)
    trials = crowd.attempts[-trouble.PAUSES :]
    assert len(set(trials)) == len(trials)  # the first may be what can't be done
    assert set(crowd.most[-trouble.PAUSES :]) == {1}
    assert set(crowd.retired) >= {0}


def test_what_is_at_work_elsewhere_keeps_hope(spread, clock):
    begin, bad = clock.now, ("u000", "u001")
    ending, _, _ = spread(3, lambda unit: DIED if unit.name in bad else None, 3, seconds={"u002": 7200.0})
    assert ending.stopped is None
    assert {aside.name for aside, _ in ending.aside} == set(bad)
    assert clock.now > begin + 7200.0


@pytest.mark.parametrize("kind", [DIED, MEMORY])
def test_where_workers_die_fewer_are_at_work(spread, crowds, kind):
    """Memory for five: where six are at work, one is killed, or told so."""
    ending, crowd, _ = spread(300, lambda _: kind if crowds[-1].most[-1] > 5 else None, slots=8)
    assert not ending.aside
    assert ending.stopped is None
    assert sum(count > 5 for count in crowd.most) < len(crowd.most) / 3
    assert set(crowd.retired) > {6, 7}  # who is not needed keeps no scene in memory


def test_who_is_not_needed_any_more_keeps_no_scene(spread):
    once = {"u000", "u001", "u002"}

    def act(unit):
        if unit.name in once:
            once.remove(unit.name)
            return DIED
        return None

    _, crowd, _ = spread(18, act, slots=6, seconds={"u007": 0.7, "u009": 0.9, "u011": 0.6})
    assert crowd.most[:8] == [1, 2, 3, 4, 5, 6, 6, 6]
    assert max(crowd.most[8:]) == 3
    assert max(crowd.scenes[8:]) == 3  # half as many are asked for; and none began anew while another waited
    assert len(crowd.retired) == 5


def test_where_memory_is_always_too_little_units_begin_with_less(spread, crowds):
    seconds = {f"u{number:03d}": 10.0 for number in range(100)}
    _, crowd, _ = spread(100, lambda _: MEMORY if crowds[-1].shares[-1] < 16 else None, 1, seconds)
    assert crowd.shares[:6] == [1, 1, 4, 4, 16, 16]
    assert crowd.shares.count(1) == 2
    assert len(crowd.attempts) < 100 + 16  # after each 20 that succeeded, it is tried with more


def test_a_unit_that_is_killed_three_times_has_others_begin_as_before(spread, crowds):
    killed = iter([DIED, DIED, DIED])
    _, crowd, _ = spread(10, lambda unit: next(killed, None) if unit.name == "u003" else None, slots=1)
    assert sorted(crowd.shares) == [*[1] * 12, 64]


def test_less_is_asked_of_a_machine_and_more_again():
    state = Trouble(8)
    for name in ("a", "b", "c"):
        state.succeed()
        assert state.fail(name, DIED, is_trial=False)
        assert state.slots == 8
    state.fail("a", DIED, is_trial=False)
    assert state.slots == 8  # the same again
    state.succeed()
    state.fail("d", MEMORY, is_trial=False)
    assert state.slots == 4
    state.succeed(16)
    assert state.share == 16
    for share in (4, 1):
        for _ in range(trouble.STEADY):
            state.succeed()
        assert state.slots == 8
        assert state.share == share
    assert Trouble(1).fail("a", DIED, is_trial=False)


def test_errors_that_nobody_foresaw_ask_no_less():
    state = Trouble(8)
    for number in range(20):
        state.fail(str(number), ERROR, is_trial=False)
        state.succeed()
    assert state.slots == 8


def test_with_worker_processes_an_outage_is_sat_out(work, monkeypatch):
    monkeypatch.setattr(trouble, "FIRST_PAUSE_S", 0.3)
    outage = work.folder / "outage.now"
    outage.touch()
    threading.Timer(3.0, outage.unlink).start()
    begin = time.monotonic()
    ending, _, failures = work("processes", [unit(f"u{n}", "suffers") for n in range(6)])
    assert time.monotonic() - begin > 3.0
    assert not ending.aside
    assert ending.stopped is None
    assert all((work.folder / f"u{n}").exists() for n in range(6))
    assert any("all wait for" in text for *_, text in failures)
