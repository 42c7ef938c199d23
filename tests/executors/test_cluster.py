"""A run on a local Ray cluster, in a network of its own where that can be had."""

import dataclasses
import importlib.util
import json
import subprocess
import sys

import pytest

from enfilade.errors import EnfiladeError
from enfilade.executors import Recipe, open_executor
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
    from enfilade.executors import cluster

    cluster.KEPT.clear()
    recipe = json.dumps({"target": "toy_worker:open_toy", "spec": {"folder": "/nowhere", "refuses": True}})
    order = json.dumps({"kind": "fine", "facts": {"name": "a"}, "share": 1})
    [[what, value]] = json.loads(cluster.do_unit(recipe, order))
    assert (what, value["type"], value["message"]) == ("failed", "SettingsError", "no such scene")


def test_what_another_try_may_mend_is_raised_for_ray(tmp_path):
    from enfilade.executors import cluster

    recipe = json.dumps({"target": "toy_worker:open_toy", "spec": {"folder": str(tmp_path)}})
    order = json.dumps({"kind": "raises", "facts": {"name": "a", "times": 1}, "share": 1})
    with pytest.raises(ZeroDivisionError):
        cluster.do_unit(recipe, order)
    assert json.loads(cluster.do_unit(recipe, order)) == [["line", {"unit": "a"}]]
