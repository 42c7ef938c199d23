"""Tasks on a Ray cluster: a real one in a network of its own, and the requests to Ray."""

from __future__ import annotations

import importlib.util
import pickle
import socket
import subprocess
import sys
from contextlib import closing
from types import SimpleNamespace

import pytest

from enfilade.errors import EnfiladeError
from enfilade.methods.base import Task
from enfilade.runs import child
from enfilade.runs.child import WorkerTerms, do_remotely
from enfilade.runs.cluster import Cluster, Share
from enfilade.runs.executor import Order, Workers
from enfilade.runs.failure import FailureKind
from enfilade.runs.folder import RunFolder
from enfilade.runs.render import prepare
from enfilade.settings import LimitSettings
from support.toys import attempts, command, digest, environment, order, toy_job

ALONE = ["unshare", "-n", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]  # Ray listens on all interfaces
NODE, BIG = {"CPU": 8.0, "GPU": 2.0}, {"CPU": 16.0}


@pytest.mark.slow
@pytest.mark.ray
def test_a_cluster_whose_workers_crash_makes_the_same_run(tmp_path, whole):
    if importlib.util.find_spec("ray") is None:
        pytest.skip("Ray is not installed: pip install ray")
    if subprocess.run([*ALONE, "true"], check=False, capture_output=True).returncode:  # noqa: S603
        pytest.skip("no network namespace can be made here, and Ray would listen to the network")
    order(tmp_path, light_1="kill", mean_1="raise")
    line = [*ALONE, *command(tmp_path, "ray", 2)]
    done = subprocess.run(line, env=environment(), capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    assert "light 1: Ray: " in done.stdout
    assert "mean 1: ZeroDivisionError: by nought; it is tried again" in done.stdout
    assert digest(tmp_path / "run") == whole
    assert set(attempts(tmp_path).values()) == {1, 2}


@pytest.mark.parametrize(
    ("workers", "has_gpu", "share"),
    [
        (Workers("ray", threads=1), False, Share(24, 1)),
        (Workers("ray", threads=5), False, Share(4, 5)),  # one fits on the one node, three on the other
        (Workers("ray", 3, threads=64), False, Share(3, 16)),  # Ray would wait for ever for a node of 64
        (Workers("ray", 4), False, Share(4, 6)),
        (Workers("ray", threads=2), True, Share(2, 2, 1.0)),
        (Workers("ray", 3, threads=1), True, Share(3, 1, 0.5)),
        (Workers("ray", 1, threads=1), True, Share(1, 1, 1.0)),
    ],
)
def test_shares_of_the_nodes(workers, has_gpu, share):
    assert Share.of([NODE, BIG], workers, has_gpu=has_gpu) == share


class RayError(Exception):
    pass


class OutOfMemoryError(RayError):
    pass


class Ray:
    """Stands for Ray: does a task when its result is asked for, or raises an error."""

    exceptions = SimpleNamespace(RayError=RayError, OutOfMemoryError=OutOfMemoryError)

    def __init__(self, *nodes):
        self.lost, self.options, self.begun, self.cancelled = [], {}, {}, []
        self._nodes = [{"Alive": True, "Resources": node} for node in nodes]

    def init(self, **how):
        self.begun = how

    def shutdown(self):
        self.begun = {}

    def nodes(self):
        return [*self._nodes, {"Alive": False, "Resources": {"CPU": 64.0, "GPU": 8.0}}]

    def remote(self, **options):
        self.options = options
        return lambda do: SimpleNamespace(remote=lambda *given: (do, given))

    def wait(self, references, **_how):
        return references[:1], references[1:]

    def cancel(self, reference, **_how):
        self.cancelled.append(reference)

    def get(self, reference):
        if self.lost:
            raise self.lost.pop(0)
        do, given = reference
        return do(*given)


@pytest.fixture
def listening():
    """A socket at the address of a cluster."""
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        yield server


@pytest.fixture
def joined(tmp_path, monkeypatch, listening):
    """Join a cluster of some nodes with a run."""
    prepare(toy_job(tmp_path), tmp_path / "run")
    monkeypatch.setattr(child, "_SERVERS", {})
    at = f"127.0.0.1:{listening.getsockname()[1]}"

    def join(*nodes, count=None, threads=0, address=at, device="cpu"):
        monkeypatch.setitem(sys.modules, "ray", ray := Ray(*nodes))
        run, workers = RunFolder.read(tmp_path / "run"), Workers("ray", count, threads)
        return ray, Cluster(run, LimitSettings(), workers, address=address, device=device)

    return join


def test_a_task_takes_its_share_of_ray(joined, listening, monkeypatch):
    ray, cluster = joined(NODE, BIG, count=4, threads=1)
    assert (cluster.slots, ray.begun["address"]) == (4, f"127.0.0.1:{listening.getsockname()[1]}")
    assert ray.options == {"num_cpus": 1, "num_gpus": 0.0, "max_retries": 0, "max_calls": 0}
    monkeypatch.setattr("enfilade.runs.cluster.cores", lambda: 2)
    ray, _ = joined(BIG, count=3, threads=2, address="")
    assert (ray.begun["address"], ray.begun["num_cpus"]) == ("local", 6)
    ray, _ = joined(BIG, threads=4, address="")
    assert ray.begun["num_cpus"] == 4
    monkeypatch.setattr("enfilade.runs.cluster.cores", lambda: 8)
    ray, cluster = joined({"CPU": 8.0}, count=2, address="")  # all cores are used
    assert (ray.begun["num_cpus"], ray.options["num_cpus"], cluster.slots) == (8, 4, 2)
    ray, _ = joined(BIG, address="auto")
    assert ray.begun["address"] == "auto"


def test_clusters_that_can_not_be_used(joined, monkeypatch):
    def unreachable(_ray, **_how):
        raise ConnectionError("timed out")

    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(EnfiladeError, match=r"pip install ray"):
        Workers("ray").check(LimitSettings())
    with pytest.raises(EnfiladeError, match=r"no GPU, .* add --device cpu"):
        joined(BIG, device="gpu")
    monkeypatch.setattr(Ray, "init", unreachable)
    with pytest.raises(
        EnfiladeError, match=r"no Ray cluster at 127\.0\.0\.1:\d+: timed out; start one there"
    ):
        joined(BIG)
    with pytest.raises(EnfiladeError, match="no Ray cluster could be started on this machine: timed out"):
        joined(BIG, address="")


@pytest.mark.parametrize("scheme", ["", "ray://"])
def test_an_address_at_which_nothing_listens_is_refused_before_ray_tries(
    joined, monkeypatch, listening, scheme
):
    monkeypatch.setattr(Ray, "init", lambda *_given, **_how: pytest.fail("Ray tried"))
    address = f"{scheme}127.0.0.1:{listening.getsockname()[1]}"
    listening.close()
    with pytest.raises(EnfiladeError, match=r"nothing answers there .*; start one there with `ray start"):
        joined(BIG, address=address)
    with pytest.raises(EnfiladeError, match="nothing answers there"):
        joined(BIG, address=f"{scheme}127.0.0.1:99999")


def test_results_and_losses(joined, tmp_path):
    ray, cluster = joined(BIG)
    order(tmp_path, light_2="raise")
    ray.lost = [OutOfMemoryError("killed\nby Ray"), RayError("its node died")]
    results = []
    with closing(cluster):
        for frame in (0, 0, 0, 1):
            cluster.begin(3, Order(Task("light", frame)))
            results += [(ended.slot, ended.result) for ended in cluster.wait(None)]
        cluster.begin(5, Order(Task("light", 0)))
    assert [slot for slot, _ in results] == [3, 3, 3, 3]
    memory, lost, line, failure = (result for _, result in results)
    assert (memory.kind, memory.text, memory.log) == (FailureKind.MEMORY, "Ray: killed", "killed\nby Ray")
    assert (lost.kind, lost.text) == (FailureKind.ERROR, "Ray: its node died")
    assert (line["pass"], line["frame"]) == ("light", 1)
    assert failure.text == "ZeroDivisionError: by nought"
    assert (len(ray.cancelled), ray.begun) == (1, {})


@pytest.mark.parametrize("kind", [RayError, ConnectionError])
def test_a_cluster_that_is_lost_ends_the_run(joined, kind):
    def lost(*_given, **_how):
        raise kind("the head node is gone")

    ray, cluster = joined(BIG)
    cluster.begin(0, Order(Task("light", 0)))
    ray.wait, cluster._do = lost, SimpleNamespace(remote=lost)
    for act in (lambda: cluster.wait(None), lambda: cluster.begin(1, Order(Task("light", 1)))):
        with pytest.raises(EnfiladeError, match="does not answer: the head node is gone; start one"):
            act()


def test_a_ray_worker_keeps_its_scene(joined, tmp_path):
    terms, workers = WorkerTerms(str(tmp_path / "run"), "cpu", 1), []
    for frame, reduction in ((0, 1), (1, 1), (2, 4)):
        do_remotely(terms, pickle.dumps(Order(Task("light", frame), reduction)), 0.0, 0.0)
        workers.append(child._SERVERS[terms]._worker)
    assert workers[0] is workers[1] is not workers[2]


HANG = """
import sys
import enfilade.runs.child as child
assert "drjit" not in sys.modules  # the device is chosen by the first task
terms, order = child.WorkerTerms(sys.argv[1], "cpu", 1), bytes.fromhex(sys.argv[2])
child.do_remotely(terms, order, 0.2, 3600.0)
"""


def test_a_ray_worker_that_hangs_ends_itself(tmp_path):
    prepare(toy_job(tmp_path), tmp_path / "run")
    order(tmp_path, light_1="hang")
    asked = pickle.dumps(Order(Task("light", 0))).hex()
    line = [sys.executable, "-c", HANG, str(tmp_path / "run"), asked]
    done = subprocess.run(line, env=environment(), capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 1
    assert "Timeout (0:00:00.2" in done.stderr
    assert "in misbehave" in done.stderr
