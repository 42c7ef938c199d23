"""Units on a Ray cluster. Only paths and JSON travel; the run folder is on a disk that all see.

The one file that names Ray.
"""

from __future__ import annotations

import contextlib
import json
import os
import traceback
from dataclasses import asdict
from typing import Any

from enfilade.errors import EnfiladeError
from enfilade.executors.executor import Event, Failure, FailureKind, Hear, Recipe, Worker
from enfilade.executors.unit import Unit

KEPT: dict[str, Worker] = {}  # in a Ray worker: what it has loaded, by recipe
LINES: list[list[Any]] = []  # in a Ray worker: reports of the unit in hand


class Cluster:
    """Units as Ray tasks. Ray tries none again by itself: it would not do so with fewer paths in flight.

    Parameters
    ----------
    recipe
    hear
        Takes the reports of a unit when it ends.
    workers
        Units in hand at once. None: as many as the cluster has CPUs.
    address
        Of a cluster to join; empty: a local one is started.

    Raises
    ------
    EnfiladeError
        Ray is not installed, or the cluster does not answer.
    """

    def __init__(self, recipe: Recipe, hear: Hear, *, workers: int | None, address: str) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray
        except ImportError as error:
            raise EnfiladeError(
                "--executor ray needs Ray: install it with: pip install 'enfilade[cluster]'"
            ) from error
        self._ray = ray
        self._hear = hear
        self._recipe = json.dumps(asdict(recipe))
        self._in_hand: dict[Any, tuple[int, Unit]] = {}
        try:
            self._connect(workers, address)
        except (ConnectionError, RuntimeError, ValueError, TimeoutError) as error:
            raise EnfiladeError(f"no Ray cluster at {address or 'this machine'}: {error}") from error
        self.slots = workers or max(int(ray.cluster_resources().get("CPU", 1)), 1)
        # One worker process stays with one unit at a time; it keeps its scene for the next.
        self._do = ray.remote(num_cpus=1, max_retries=0)(do_unit)

    def begin(self, slot: int, unit: Unit, *, share: int) -> None:
        """Hand a unit to Ray."""
        order = json.dumps({"kind": unit.kind, "facts": dict(unit.facts), "share": share})
        self._in_hand[self._do.remote(self._recipe, order)] = slot, unit

    def wait(self, timeout_s: float | None) -> list[Event]:
        """Wait until Ray has finished a unit or has lost its worker or node."""
        if not self._in_hand:
            return []
        ready, _ = self._ray.wait(list(self._in_hand), num_returns=1, timeout=timeout_s)
        return [self._ended(reference) for reference in ready]

    def close(self) -> None:
        """Cancel what is in hand and leave the cluster; a local one ends."""
        for reference in self._in_hand:
            with contextlib.suppress(self._ray.exceptions.RayError, ValueError):
                self._ray.cancel(reference, force=True)
        self._in_hand.clear()
        self._ray.shutdown()

    def _connect(self, workers: int | None, address: str) -> None:
        quiet = {"log_to_driver": False, "logging_level": "error", "include_dashboard": False}
        if address:
            del quiet["include_dashboard"]  # that cluster's own affair
            self._ray.init(address=address, **quiet)
        else:
            self._ray.init(address="local", num_cpus=workers, **quiet)

    def _ended(self, reference: Any) -> Event:
        slot, unit = self._in_hand.pop(reference)
        try:
            reports = json.loads(self._ray.get(reference))
        except self._ray.exceptions.RayError as error:
            is_scarce = isinstance(error, self._ray.exceptions.OutOfMemoryError)
            kind = FailureKind.MEMORY if is_scarce else FailureKind.DIED
            return Event(slot, Failure(kind, f"Ray says: {_first_line(error)}", str(error)))
        failure = None
        for what, value in reports:
            if what == "failed":
                failure = Failure.from_json(value)
            else:
                self._hear(unit, what, value)
        return Event(slot, failure)


def do_unit(recipe: str, order: str) -> str:
    """Do a unit in a Ray worker; returns its reports as JSON, an error among them."""
    told = json.loads(order)
    key = json.dumps([recipe, told["share"]])
    LINES.clear()
    try:
        if key not in KEPT:
            KEPT.clear()  # one scene in memory
            KEPT[key] = Recipe(**json.loads(recipe)).make(_note, share=told["share"])
        KEPT[key](told["kind"], told["facts"])
    except Exception as error:  # noqa: BLE001  (the supervisor decides what becomes of it)
        KEPT.clear()
        LINES.append(["failed", Failure.of(error, traceback.format_exc()).to_json()])
    return json.dumps(LINES)


def _note(what: str, value: Any) -> None:
    LINES.append([what, value])


def _first_line(error: Exception) -> str:
    return next(iter(str(error).strip().splitlines()), type(error).__name__)
