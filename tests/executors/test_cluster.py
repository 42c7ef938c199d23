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


def test_what_travels_to_a_cluster_is_json():
    cluster.KEPT.clear()
    recipe = json.dumps({"target": "toy_worker:open_toy", "spec": {"folder": "/nowhere", "refuses": True}})
    order = json.dumps({"kind": "fine", "facts": {"name": "a"}, "share": 1})
    [[what, value]] = json.loads(cluster.do_unit(recipe, order))
    assert (what, value["type"], value["message"]) == ("failed", "SettingsError", "no such scene")


def test_what_another_try_may_mend_is_for_the_supervisor(tmp_path):
    recipe = json.dumps({"target": "toy_worker:open_toy", "spec": {"folder": str(tmp_path)}})
    order = json.dumps({"kind": "raises", "facts": {"name": "a", "times": 1}, "share": 1})
    [[what, value]] = json.loads(cluster.do_unit(recipe, order))
    assert (what, value["kind"], value["text"]) == ("failed", "error", "ZeroDivisionError: by nought")
    assert "Traceback" in value["log"]
    assert json.loads(cluster.do_unit(recipe, order)) == [["line", {"unit": "a"}]]


class RayError(Exception):
    pass


class OutOfMemoryError(RayError):
    pass


class Ray:
    """Stands for Ray: does a task when it is asked for, or loses its worker."""

    exceptions = SimpleNamespace(RayError=RayError, OutOfMemoryError=OutOfMemoryError)

    def __init__(self, *lost):
        self.lost, self.options = list(lost), {}

    def init(self, **_where):
        pass

    def shutdown(self):
        pass

    def cluster_resources(self):
        return {"CPU": 1}

    def remote(self, **options):
        self.options = options
        return lambda do: SimpleNamespace(remote=lambda *given: (do, given))

    def wait(self, references, **_how):
        return references[:1], references[1:]

    def get(self, reference):
        if self.lost:
            raise self.lost.pop(0)
        do, given = reference
        return do(*given)


def test_what_ray_loses_is_done_again_with_fewer_paths_where_memory_was_short(tmp_path, monkeypatch):
    ray = Ray(OutOfMemoryError("killed"), RayError("its node died"))
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.0)
    graph, kinds = Graph(), []
    graph.add(Unit("a", "starves", {"name": "a", "times": 1}))
    recipe = Recipe("toy_worker:open_toy", {"folder": str(tmp_path)})
    with closing(open_executor("ray", recipe, lambda *_: None, workers=1, logs=tmp_path)) as executor:
        ending = supervise(
            graph,
            executor,
            follow=lambda _: (),
            is_done=lambda _: (tmp_path / "a").exists(),
            failed=lambda _, failures: kinds.append(failures[-1].kind),
        )
    assert ray.options["max_retries"] == 0
    assert "retry_exceptions" not in ray.options
    assert not ending.aside
    assert kinds == [FailureKind.MEMORY, FailureKind.DIED, FailureKind.MEMORY]
    shares = [line.split()[0] for line in (tmp_path / "a.tries").read_text().splitlines()]
    assert shares == ["4", "16"]
