"""A run on a local Ray cluster, in a network of its own where that can be had."""

import dataclasses
import importlib.util
import json
import subprocess
import sys
from contextlib import closing
from types import SimpleNamespace

import pytest

from enfilade.errors import EnfiladeError
from enfilade.executors import FailureKind, Graph, Recipe, Unit, cluster, open_executor, supervise
from enfilade.monitor import Silence
from enfilade.pipeline.job import read_job
from enfilade.pipeline.walkthrough import prepare, render
from enfilade.store import Run
from scenes_analytic import room, room_walk
from small_runs import job_of

ALONE = ["unshare", "-n", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]


@pytest.fixture(scope="module")
def alone():
    """Prefix of commands in a network of their own: Ray listens on every interface there is."""
    if importlib.util.find_spec("ray") is None:
        pytest.skip("Ray is not installed: pip install 'enfilade[cluster]'")
    if subprocess.run([*ALONE, "true"], check=False, capture_output=True).returncode:  # noqa: S603
        pytest.skip("no network namespace can be made here, and Ray would listen to the network")
    return ALONE


@pytest.mark.slow
@pytest.mark.ray
def test_ray_makes_the_same_run(alone, tmp_path):
    scene = dataclasses.replace(room(specular=True), noise=0.05)
    tables = {"trace": {"spp": 4}, "viewing": {"diagonal_m": 0.0125}}
    job = job_of(tmp_path, scene, room_walk(7, size=(32, 24)), **tables)
    render(job, tmp_path / "here", Silence())
    prepare(job, tmp_path / "there")
    assert read_job(tmp_path / "there").to_json() == read_job(tmp_path / "here").to_json()
    line = [*alone, sys.executable, "-m", "enfilade", "work", tmp_path / "there", "--executor", "ray"]
    done = subprocess.run(  # noqa: S603
        [*line, "--workers", "2", "--device", "cpu"], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert Run.existing(tmp_path / "there").digest() == Run.existing(tmp_path / "here").digest()


def test_without_ray_it_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(EnfiladeError, match=r"pip install 'enfilade\[cluster\]'"):
        open_executor("ray", Recipe(""), lambda *_: None, workers=1, logs=tmp_path)


@pytest.fixture
def in_ray(tmp_path, toys):
    """Do a unit as a Ray worker does; returns its reports."""

    def do(kind, *, limits=None, spec=None, **facts):
        recipe = dataclasses.asdict(toys(**(spec or {})))
        terms = {"recipe": recipe, "logs": str(tmp_path / "logs"), "limits": limits or {}}
        order = {"name": "a", "kind": kind, "facts": {"name": "a", **facts}, "share": 1}
        return json.loads(cluster.do_unit(json.dumps(terms), json.dumps(order)))

    yield do
    cluster._let_go()


def test_what_travels_to_a_cluster_is_json(in_ray):
    [[what, value]] = in_ray("fine", spec={"refuses": True})
    assert (what, value["type"], value["message"]) == ("failed", "SettingsError", "no such scene")


def test_what_another_try_may_mend_is_for_the_supervisor(in_ray):
    [[what, value]] = in_ray("raises", times=1)
    assert (what, value["kind"], value["text"]) == ("failed", "error", "ZeroDivisionError: by nought")
    assert "Traceback" in value["log"]
    assert in_ray("raises", times=1) == [["line", {"unit": "a"}]]


def test_a_worker_that_hangs_on_a_node_is_ended_there(in_ray):
    [[what, value]] = in_ray("stops", limits={"idle_s": 0.8}, times=1)
    assert (what, value["kind"]) == ("failed", "died")
    assert value["text"].endswith("(it is stopped) and was ended")
    assert in_ray("stops", times=1) == [["line", {"unit": "a"}]]


def test_a_ray_worker_keeps_its_scene_and_takes_the_gpu_it_is_given(in_ray, tmp_path, monkeypatch):
    for gpu in "001":
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", gpu)
        in_ray("fine")
    pids = (tmp_path / "a.tries").read_text().split()[1::2]
    assert pids[0] == pids[1] != pids[2]


class RayError(Exception):
    pass


class OutOfMemoryError(RayError):
    pass


class Ray:
    """Stands for Ray: does a task when it is asked for, or loses its worker."""

    exceptions = SimpleNamespace(RayError=RayError, OutOfMemoryError=OutOfMemoryError)

    def __init__(self, *lost, nodes=({"CPU": 1.0},)):
        self.lost, self.options, self.begun = list(lost), {}, {}
        self.is_deaf, self.cancelled = False, []
        self._nodes = [{"Alive": True, "Resources": node} for node in nodes]

    def init(self, **how):
        self.begun = how

    def shutdown(self):
        pass

    def nodes(self):
        return [*self._nodes, {"Alive": False, "Resources": {"CPU": 64.0, "GPU": 8.0}}]

    def remote(self, **options):
        self.options = options
        return lambda do: SimpleNamespace(remote=lambda *given: (do, given))

    def wait(self, references, **_how):
        return ([], references) if self.is_deaf else (references[:1], references[1:])

    def cancel(self, reference, **_how):
        self.cancelled.append(reference)

    def get(self, reference):
        if self.lost:
            raise self.lost.pop(0)
        do, given = reference
        return do(*given)


@pytest.fixture
def joined(tmp_path, monkeypatch):
    """Join a cluster that has what it is said to have."""

    def join(*nodes, name="ray:head", workers=None, **spec):
        ray = Ray(nodes=nodes)
        monkeypatch.setitem(sys.modules, "ray", ray)
        recipe = Recipe("", spec)
        return ray, open_executor(name, recipe, lambda *_: None, workers=workers, logs=tmp_path)

    return join


NODE, BIG = {"CPU": 8.0, "GPU": 2.0}, {"CPU": 16.0}


@pytest.mark.parametrize(
    ("workers", "spec", "slots", "cpus", "gpus"),
    [
        (None, {"threads": 1}, 24, 1, 0),
        (None, {"threads": 4}, 6, 4, 0),
        (None, {"threads": 5}, 4, 5, 0),  # one fits on the one node, three on the other
        (3, {"threads": 64}, 3, 16, 0),  # Ray would wait for ever for a node of 64
        (4, {"threads": 0}, 4, 6, 0),
        (None, {"threads": 2, "device": "cuda"}, 2, 2, 1.0),
        (4, {"threads": 1, "device": "cuda"}, 4, 1, 0.5),
        (3, {"threads": 1, "device": "cuda"}, 3, 1, 0.5),
        (1, {"threads": 1, "device": "cuda"}, 1, 1, 1.0),
    ],
)
def test_ray_is_asked_for_what_a_unit_takes(joined, workers, spec, slots, cpus, gpus):
    ray, executor = joined(NODE, BIG, workers=workers, **spec)
    assert executor.slots == slots
    assert (ray.options["num_cpus"], ray.options["num_gpus"]) == (cpus, gpus)
    assert json.loads(executor._terms)["recipe"]["spec"]["threads"] == cpus


def test_a_cluster_without_a_gpu_is_refused_where_one_is_needed(joined):
    with pytest.raises(EnfiladeError, match=r"no GPU, .* add --device cpu"):
        joined(BIG, device="cuda")


def test_a_local_cluster_has_room_for_its_workers(joined):
    ray, _ = joined(BIG, name="ray", workers=3, threads=2)
    assert ray.begun["num_cpus"] == 6


def test_a_node_that_says_nothing_is_given_up(joined, monkeypatch):
    ray, executor = joined(BIG, name="ray:head,unit=0.001", workers=1)
    said = []
    executor._hear = lambda *report: said.append(report)
    monkeypatch.setattr(cluster, "GRACE_S", 0.05)
    monkeypatch.setattr(cluster, "TOLD_S", 0.02)
    ray.is_deaf = True
    executor.begin(0, Unit("a", "fine"), share=1)
    while not (events := executor.wait(None)):
        pass
    assert events[0].failure.kind is FailureKind.DIED
    assert "more than the limit for a unit" in events[0].failure.text
    assert len(ray.cancelled) == 1
    assert said[0][2][0].startswith("a: in Ray's hands for ")


@pytest.mark.parametrize("kind", [RayError, ConnectionError])
def test_a_cluster_that_is_lost_is_said(joined, kind):
    def lost(*_given, **_how):
        raise kind("the head node is gone")

    ray, executor = joined(BIG, workers=1)
    executor.begin(0, Unit("a", "fine"), share=1)
    ray.wait = lost
    with pytest.raises(EnfiladeError, match="answers no more: the head node is gone; what is finished stays"):
        executor.wait(None)
    executor._do = SimpleNamespace(remote=lost)
    with pytest.raises(EnfiladeError, match="answers no more: the head node is gone"):
        executor.begin(1, Unit("b", "fine"), share=1)


def test_what_ray_loses_is_done_again_with_fewer_paths_where_memory_was_short(tmp_path, monkeypatch, toys):
    ray = Ray(OutOfMemoryError("killed"), RayError("its node died"))
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.0)
    graph, kinds = Graph(), []
    graph.add(Unit("a", "starves", {"name": "a", "times": 1}))
    with closing(open_executor("ray", toys(), lambda *_: None, workers=1, logs=tmp_path)) as executor:
        ending = supervise(
            graph,
            executor,
            follow=lambda _: (),
            is_done=lambda _: (tmp_path / "a").exists(),
            failed=lambda _, failures: kinds.append(failures[-1].kind),
        )
    cluster._let_go()
    assert ray.options["max_retries"] == 0
    assert "retry_exceptions" not in ray.options
    assert not ending.aside
    assert kinds == [FailureKind.MEMORY, FailureKind.DIED, FailureKind.MEMORY]
    shares = [line.split()[0] for line in (tmp_path / "a.tries").read_text().splitlines()]
    assert shares == ["4", "16"]
