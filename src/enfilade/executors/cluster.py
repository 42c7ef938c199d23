"""Units on a Ray cluster. Only paths and JSON travel; the run folder is on a disk that all see.

The one file that names Ray.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from enfilade.errors import EnfiladeError
from enfilade.executors.executor import Event, Failure, FailureKind, Hear, Recipe
from enfilade.executors.processes import Processes
from enfilade.executors.resources import cores
from enfilade.executors.unit import Unit
from enfilade.executors.watch import Limits, Watch, span

TOLD_S = 1800.0  # in Ray's hands, after which it is said; again after twice as long
GRACE_S = 60.0  # in which a node should have ended a unit that takes too long

KEPT: dict[str, Processes] = {}  # in a Ray worker: who has the scene loaded
LINES: list[list[Any]] = []  # in a Ray worker: reports of the unit in hand


@dataclass(eq=False)
class _Task:
    slot: int
    unit: Unit
    watch: Watch
    told_s: float  # after which it is said that it takes long


class Cluster:
    """Units as Ray tasks. Ray tries none again by itself: it would not do so with fewer paths in flight.

    A Ray worker hands its units to a process of its own, and ends that one when it hangs: Ray waits for it.

    Parameters
    ----------
    recipe
    hear
        Takes the reports of a unit when it ends.
    workers
        Units in hand at once. None: as many as the cluster has GPUs, or CPUs for.
    address
        Of a cluster to join; empty: a local one is started.
    logs
        Folder for what workers print; all nodes see it.
    limits
        When a worker that hangs is ended.

    Raises
    ------
    EnfiladeError
        Ray is not installed, the cluster does not answer, or has no GPU where one is needed.
    """

    def __init__(
        self,
        recipe: Recipe,
        hear: Hear,
        *,
        workers: int | None,
        address: str,
        logs: Path,
        limits: Limits | None = None,
    ) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray
        except ImportError as error:
            raise EnfiladeError(
                "--executor ray needs Ray: install it with: pip install 'enfilade[cluster]'"
            ) from error
        self._ray = ray
        self._hear = hear
        self._limits = limits or Limits()
        self._in_hand: dict[Any, _Task] = {}
        threads = max(recipe.threads, 1)
        try:
            self._connect(address, cpus=max((workers or cores() // threads) * threads, 1))
            nodes = [node["Resources"] for node in ray.nodes() if node["Alive"]]
        except (ConnectionError, RuntimeError, ValueError, TimeoutError) as error:
            raise EnfiladeError(f"no Ray cluster at {address or 'this machine'}: {error}") from error
        try:
            need = Need.of(nodes, workers=workers, threads=recipe.threads, has_gpu=recipe.needs_gpu)
        except EnfiladeError:
            ray.shutdown()
            raise
        self.slots = need.slots
        recipe = replace(recipe, spec={**recipe.spec, "threads": need.cpus})
        terms = {"recipe": asdict(recipe), "logs": str(logs.resolve()), "limits": asdict(self._limits)}
        self._terms = json.dumps(terms)
        # One worker process stays with one unit at a time; it keeps its scene for the next.
        self._do = ray.remote(num_cpus=need.cpus, num_gpus=need.gpus, max_retries=0)(do_unit)

    def begin(self, slot: int, unit: Unit, *, share: int) -> None:
        """Hand a unit to Ray."""
        order = {"name": unit.name, "kind": unit.kind, "facts": dict(unit.facts), "share": share}
        with self._answering():
            reference = self._do.remote(self._terms, json.dumps(order))
        self._in_hand[reference] = _Task(slot, unit, Watch(self._limits), TOLD_S)

    def wait(self, timeout_s: float | None) -> list[Event]:
        """Wait until Ray has finished a unit or has lost its worker or node."""
        if not self._in_hand:
            return []
        look_s = self._limits.look_s
        wait_s = look_s if timeout_s is None else min(timeout_s, look_s)
        with self._answering():
            ready, _ = self._ray.wait(list(self._in_hand), num_returns=1, timeout=wait_s)
        return [*(self._ended(reference) for reference in ready), *self._look()]

    def retire(self, slot: int) -> None:
        """Nothing: Ray lets idle workers go by itself, and after a failure they begin anew."""

    def close(self) -> None:
        """Cancel what is in hand and leave the cluster; a local one ends."""
        for reference in list(self._in_hand):
            self._cancel(reference)
        self._ray.shutdown()

    @contextlib.contextmanager
    def _answering(self) -> Iterator[None]:
        try:
            yield
        except (self._ray.exceptions.RayError, ConnectionError) as error:
            raise EnfiladeError(
                f"the Ray cluster answers no more: {_first_line(error)}; what is finished stays: start one, "
                "and run the same command again"
            ) from error

    def _connect(self, address: str, *, cpus: int) -> None:
        quiet = {"log_to_driver": False, "logging_level": "error", "include_dashboard": False}
        if address:
            del quiet["include_dashboard"]  # that cluster's own affair
            self._ray.init(address=address, **quiet)
        else:
            self._ray.init(address="local", num_cpus=cpus, **quiet)

    def _look(self) -> list[Event]:
        """Say what takes long, and end what a node should have ended: it may be out of order itself."""
        events = []
        for reference, task in list(self._in_hand.items()):
            task.watch.look()
            passed_s = task.watch.in_hand_s
            if passed_s >= task.told_s:
                task.told_s *= 2
                text = f"{task.unit.name}: in Ray's hands for {span(passed_s)}, in its queue or at work"
                self._hear(task.unit, "say", [text])
            if 0 < self._limits.unit_s < passed_s - GRACE_S:
                self._cancel(reference)
                reason = f"Ray has said nothing of it for {span(passed_s)}: more than the limit for a unit"
                events.append(Event(task.slot, Failure(FailureKind.DIED, reason)))
        return events

    def _cancel(self, reference: Any) -> None:
        del self._in_hand[reference]
        with contextlib.suppress(self._ray.exceptions.RayError, ValueError):
            self._ray.cancel(reference, force=True)

    def _ended(self, reference: Any) -> Event:
        task = self._in_hand.pop(reference)
        try:
            reports = json.loads(self._ray.get(reference))
        except self._ray.exceptions.RayError as error:
            is_scarce = isinstance(error, self._ray.exceptions.OutOfMemoryError)
            kind = FailureKind.MEMORY if is_scarce else FailureKind.DIED
            return Event(task.slot, Failure(kind, f"Ray says: {_first_line(error)}", str(error)))
        failure = None
        for what, value in reports:
            if what == "failed":
                failure = Failure.from_json(value)
            else:
                self._hear(task.unit, what, value)
        return Event(task.slot, failure)


@dataclass(frozen=True)
class Need:
    """What Ray is asked for.

    Attributes
    ----------
    slots : int
        Units in hand at once.
    cpus : int
        Of a unit, which are its threads.
    gpus : float
        Of a unit; a part of one where more units than GPUs are asked for.
    """

    slots: int
    cpus: int
    gpus: float = 0.0

    @staticmethod
    def of(nodes: Sequence[Mapping[str, float]], *, workers: int | None, threads: int, has_gpu: bool) -> Need:
        """Share out what the nodes have.

        Parameters
        ----------
        nodes
            Resources of each, as Ray names them.
        workers
            Units in hand at once, as the user asked. None: as many as there are GPUs, or CPUs for.
        threads
            Of a unit. No more than the largest node has: Ray would wait for ever. 0: a share of all CPUs.
        has_gpu
            Whether a unit needs a GPU.

        Raises
        ------
        EnfiladeError
            It does, and there is none.
        """
        cpus = [int(node.get("CPU", 0)) for node in nodes]
        gpus = int(sum(node.get("GPU", 0) for node in nodes))
        if has_gpu and not gpus:
            raise EnfiladeError(
                "the Ray cluster has no GPU, and the run is for one: start its nodes with --num-gpus, or add "
                "--device cpu"
            )
        some = workers or (gpus if has_gpu else sum(cpus))
        wanted = threads or max(sum(cpus) // max(some, 1), 1)
        each = max(min(wanted, max(cpus, default=0)), 1)
        slots = workers or (gpus if has_gpu else max(sum(count // each for count in cpus), 1))
        return Need(slots, each, 1 / math.ceil(slots / gpus) if has_gpu else 0.0)


def do_unit(terms: str, order: str) -> str:
    """Do a unit in a Ray worker; returns its reports as JSON, an error among them."""
    told = json.loads(order)
    unit = Unit(told["name"], told["kind"], told["facts"])
    LINES.clear()
    try:
        worker = _worker(terms)
        worker.begin(0, unit, share=told["share"])
        while not (events := worker.wait(None)):
            pass
        failure = events[0].failure
    except (EnfiladeError, OSError) as error:  # no process can be begun
        failure = Failure.of(error)
    if failure is not None:
        _let_go()
        LINES.append(["failed", failure.to_json()])
    return json.dumps(LINES)


def _worker(terms: str) -> Processes:
    """Who does units on these terms, with the GPU that Ray gives at present."""
    key = json.dumps([terms, os.environ.get("CUDA_VISIBLE_DEVICES")])
    if key not in KEPT:
        _let_go()  # one scene in memory
        table = json.loads(terms)
        recipe, limits = Recipe(**table["recipe"]), Limits(**table["limits"])
        KEPT[key] = Processes(recipe, _note, workers=1, logs=Path(table["logs"]), limits=limits)
    return KEPT[key]


def _let_go() -> None:
    for worker in KEPT.values():
        worker.close()
    KEPT.clear()


def _note(_unit: Unit, what: str, value: Any) -> None:
    LINES.append([what, value])


def _first_line(error: Exception) -> str:
    return next(iter(str(error).strip().splitlines()), type(error).__name__)
