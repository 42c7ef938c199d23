"""Methods without a run folder: all tasks of a path, pass by pass, with their results in dictionaries."""

from __future__ import annotations

from typing import Any

import numpy as np

from enfilade.camera.path import CameraPath
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.base import FRAMES, Method, TaskId
from enfilade.methods.walkthrough import Walkthrough
from enfilade.renderer import Renderer
from enfilade.settings import Settings


class InMemory:
    """Results of the passes of a method: the `Inputs` of its tasks."""

    def __init__(self, walk: Walkthrough) -> None:
        statistics = tuple(analyze(walk, frame) for frame in range(len(walk.path)))
        self.analysis = Analysis(walk.path, walk.settings, statistics)
        self.records: dict[TaskId, Any] = {}
        self.task_metadata: dict[TaskId, dict[str, Any]] = {}

    def record(self, pass_name: str, frame: int) -> Any:
        return self.records[TaskId(pass_name, frame)]

    def metadata(self, pass_name: str, frame: int) -> dict[str, Any]:
        return self.task_metadata[TaskId(pass_name, frame)]

    def frames_of(self, pass_name: str) -> list[int]:
        """Frames that have a record of a pass."""
        return sorted(frame for name, frame in self.records if name == pass_name)

    def total(self, key: str) -> Any:
        """Sum of a fact over all tasks."""
        return sum(metadata.get(key, 0) for metadata in self.task_metadata.values())

    def rays(self) -> int:
        """Rays of all kinds and tasks."""
        return sum(sum(metadata.get("rays", {}).values()) for metadata in self.task_metadata.values())

    @property
    def colors(self) -> np.ndarray:
        """All frames, (N, H, W, 3) float64."""
        return np.stack([self.record(FRAMES, f).color for f in range(len(self.analysis.path))]).astype(float)


def run_passes(method: Method, walk: Walkthrough) -> InMemory:
    """Run all tasks, in the order of the passes, and check what each task is given and writes."""
    results = InMemory(walk)
    order = [one.name for one in method.passes]
    tasks = sorted(method.tasks(results.analysis), key=lambda task: (order.index(task.pass_name), task.frame))
    assert len({task.id for task in tasks}) == len(tasks)
    for task in tasks:
        assert all(need in results.task_metadata for need in task.needs), task
        output = method.run(task, results, walk)
        for frame, record in output.records.items():
            assert isinstance(record, method.passes[order.index(task.pass_name)].record), task
            assert TaskId(task.pass_name, frame) not in results.records, task
            results.records[TaskId(task.pass_name, frame)] = record
        results.task_metadata[task.id] = dict(output.metadata)
    return results


def walk_of(path: CameraPath, renderer: Renderer, **tables: dict[str, Any]) -> Walkthrough:
    """A walkthrough with the settings of some tables."""
    return Walkthrough(path, Settings.from_tables(tables), renderer)


def analysis_of(path: CameraPath, speed_px: float = 1.0, **tables: dict[str, Any]) -> Analysis:
    """An analysis of constant speed, without a renderer."""
    statistics = {"speed_px": speed_px, "speed_deg_s": 1.0, "slow_percent": 0.0, "specular_percent": 0.0}
    return Analysis.from_tables(path, Settings.from_tables(tables), [statistics] * len(path))
