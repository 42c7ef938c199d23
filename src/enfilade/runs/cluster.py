"""Tasks on a Ray cluster. Only names, numbers and ledger lines travel; all nodes see the run folder."""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import socket
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from enfilade.errors import EnfiladeError
from enfilade.runs.child import WorkerTerms, do_remotely
from enfilade.runs.executor import Ended, Order, Workers
from enfilade.runs.failure import Failure, FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.resources import cores
from enfilade.settings import LimitSettings

PROBE_S = 10.0  # Ray itself tries for minutes to reach an address


class Cluster:
    """Workers on a Ray cluster.

    Parameters
    ----------
    run
    limits
        ``task_timeout_s``: a worker that has not finished its task after this time ends itself; loading the
        scene may take ``preflight_s`` more. 0: never.
    workers
        Number of tasks at once (None: as many as the cluster has GPUs, or CPUs for), and threads of each.
    address
        Of a cluster to join; empty: a local one is started.
    device
        ``cpu`` or ``gpu``.

    Raises
    ------
    EnfiladeError
        The cluster does not answer, or has no GPU where one is needed.
    """

    def __init__(
        self, run: RunFolder, limits: LimitSettings, workers: Workers, *, address: str, device: str
    ) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        import ray

        self._ray = ray
        self._in_hand: dict[Any, int] = {}
        threads = max(workers.threads, 1)
        try:
            self._connect(address, cpus=max(cores(), (workers.count or 1) * threads))
            nodes = [node["Resources"] for node in ray.nodes() if node["Alive"]]
        except (ConnectionError, RuntimeError, ValueError, TimeoutError) as error:
            start = "start one there with `ray start --head`, or correct --executor ray:HOST:PORT"
            raise EnfiladeError(
                f"no Ray cluster at {address}: {error}; {start}"
                if address
                else f"no Ray cluster could be started on this machine: {error}"
            ) from error
        try:
            share = Share.of(nodes, workers, has_gpu=device == "gpu")
        except EnfiladeError:
            ray.shutdown()
            raise
        self.slots = share.slots
        self._terms = WorkerTerms(str(run.folder.resolve()), device, share.cpus)
        self._limits = limits
        # Nothing is repeated by Ray: the scheduler does it, with fewer paths in flight after a lack of
        # memory. Ray ends a worker after each task on a GPU unless `max_calls` is 0.
        self._do = ray.remote(num_cpus=share.cpus, num_gpus=share.gpus, max_retries=0, max_calls=0)(
            do_remotely
        )

    def begin(self, slot: int, order: Order) -> None:
        """Submit a task."""
        limits = self._limits.task_timeout_s, self._limits.preflight_s
        with self._answering():
            self._in_hand[self._do.remote(self._terms, pickle.dumps(order), *limits)] = slot

    def wait(self, timeout_s: float | None) -> list[Ended]:
        """Wait until Ray has finished a task, or has lost its worker or node."""
        with self._answering():
            ready, _ = self._ray.wait(list(self._in_hand), num_returns=1, timeout=timeout_s)
        return [self._ended(reference) for reference in ready]

    def discard(self, slot: int) -> None:
        """Nothing: after a failure a Ray worker opens the run anew."""

    def close(self) -> None:
        """Cancel the tasks in hand and leave the cluster; a local one ends."""
        for reference in self._in_hand:
            with contextlib.suppress(self._ray.exceptions.RayError, ValueError):
                self._ray.cancel(reference, force=True)
        self._ray.shutdown()

    @contextlib.contextmanager
    def _answering(self) -> Iterator[None]:
        try:
            yield
        except (self._ray.exceptions.RayError, ConnectionError) as error:
            raise EnfiladeError(
                f"the Ray cluster does not answer: {_first_line(error)}; start one, then run the same "
                "command again"
            ) from error

    def _connect(self, address: str, *, cpus: int) -> None:
        quiet = {"log_to_driver": False, "logging_level": "error"}
        if address:
            _probe(address)
            self._ray.init(address=address, **quiet)
        else:
            self._ray.init(address="local", num_cpus=cpus, include_dashboard=False, **quiet)

    def _ended(self, reference: Any) -> Ended:
        slot = self._in_hand.pop(reference)
        try:
            result = self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            is_memory = isinstance(error, self._ray.exceptions.OutOfMemoryError)
            kind = FailureKind.MEMORY if is_memory else FailureKind.ERROR
            return Ended(slot, Failure(kind, f"Ray: {_first_line(error)}", str(error)))
        return Ended(slot, result)


@dataclass(frozen=True)
class Share:
    """Resources requested from Ray.

    Attributes
    ----------
    slots : int
        Tasks at once.
    cpus : int
        Of a task, which are its threads.
    gpus : float
        Of a task; a part of one where there are more tasks than GPUs.
    """

    slots: int
    cpus: int
    gpus: float = 0.0

    @staticmethod
    def of(nodes: Sequence[Mapping[str, float]], workers: Workers, *, has_gpu: bool) -> Share:
        """Share out the resources of the nodes.

        Parameters
        ----------
        nodes
            Resources of each, as Ray names them.
        workers
            Number and threads, as far as they are given. A task gets no more threads than the largest node
            has CPUs.
        has_gpu
            Whether a task needs a GPU.

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
        some = workers.count or (gpus if has_gpu else sum(cpus))
        wanted = workers.threads or max(sum(cpus) // max(some, 1), 1)
        each = max(min(wanted, max(cpus, default=0)), 1)
        slots = workers.count or (gpus if has_gpu else max(sum(count // each for count in cpus), 1))
        return Share(slots, each, 1 / math.ceil(slots / gpus) if has_gpu else 0.0)


def _probe(address: str) -> None:
    """Refuse an address at which nothing listens; names such as ``auto`` are left to Ray.

    Raises
    ------
    ConnectionError
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdecimal():
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=PROBE_S).close()
    except (OSError, OverflowError, UnicodeError) as error:
        raise ConnectionError(f"nothing answers there ({error})") from error


def _first_line(error: Exception) -> str:
    return next(iter(str(error).strip().splitlines()), type(error).__name__)
