"""Toy workers, and who supervises them."""

from pathlib import Path

import pytest

from enfilade.executors import Graph, Recipe, open_executor, supervise
from toy_worker import nothing

TESTS = Path(__file__).parents[1]


@pytest.fixture
def toys(tmp_path, monkeypatch):
    """The recipe of a toy worker; worker processes find it."""
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    return lambda **spec: Recipe("toy_worker:open_toy", {"folder": str(tmp_path), **spec})


@pytest.fixture
def work(tmp_path, monkeypatch, toys):
    """Do units with toy workers; returns the ending, who was told of what, and who failed."""
    monkeypatch.setattr("enfilade.executors.supervisor.FIRST_DELAY_S", 0.01)
    monkeypatch.setattr("enfilade.executors.supervisor.LONGER_OF_MACHINE", 2)

    def do(name, units, workers=2, follow=nothing, **spec):
        told, failures, graph = [], [], Graph()
        for unit in units:
            graph.add(unit)
        executor = open_executor(
            name, toys(**spec), lambda *r: told.append(r), workers=workers, logs=tmp_path / "logs"
        )
        try:
            ending = supervise(
                graph,
                executor,
                follow=follow,
                is_done=lambda unit: (tmp_path / unit.name).exists(),
                failed=lambda unit, own: failures.append((unit.name, own[-1].kind, len(own), own[-1].text)),
            )
        finally:
            executor.close()
        return ending, told, failures

    do.folder = tmp_path
    return do
