"""Small sequences to be compared."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.comparison import CompareOptions, SequenceDifference, compare
from enfilade.images import write_exr
from enfilade.monitor import Silence
from enfilade.runs.identity import FORMAT
from enfilade.settings import MetricSettings

SIZE = (48, 64)


class Notes(Silence):
    """Keeps what is said."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def message(self, text: str) -> None:
        self.said.append(text)


def textured(shift: float = 0.0, level: float = 0.2) -> np.ndarray:
    """A grey texture, moved to the left."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    grey = level * (1.0 + 0.5 * np.sin(0.8 * (x + shift)) * np.cos(0.6 * y))
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


def write_sequence(
    folder: Path,
    images: list[np.ndarray],
    *,
    flow_px: float | None = None,
    layers: dict[str, Any] | None = None,
    numbers: Sequence[int] | None = None,
) -> Path:
    folder.mkdir(parents=True)
    more = dict(layers or {})
    if flow_px is not None:
        forward = np.zeros((*SIZE, 2), np.float32)
        forward[..., 0] = flow_px
        more |= {"forward": forward, "backward": -forward}
    for number, image in zip(numbers or range(1, len(images) + 1), images, strict=True):
        write_exr(folder / f"{number:04}.exr", {"RGB": image, **more})
    return folder


def write_run(
    folder: Path,
    images: list[np.ndarray],
    numbers: Sequence[int],
    *,
    selected: Sequence[int] | None = None,
    cuts: Sequence[int] = (),
    poses: str | None = None,
    **options: Any,
) -> Path:
    """A run folder that has finished the frames of some numbers, of all those that were selected."""
    write_sequence(folder / "frames", images, numbers=numbers, **options)
    path: dict[str, Any] = {"fps": 30.0, "frames": list(selected or numbers), "cuts": list(cuts)}
    if poses is not None:
        path["poses"] = poses
    (folder / "run.json").write_text(json.dumps({"format": FORMAT, "identity": {"path": path}}))
    return folder


def terms(
    *,
    mode: str = "modern",
    flow: str = "auto",
    pursuit: str = "both",
    mask_slope: float = 0.7,
    **fields: Any,
) -> CompareOptions:
    metric = MetricSettings.from_table({"pursuit": pursuit, "mask_slope": mask_slope})
    return CompareOptions(metric=metric, mode=mode, flow=flow, **fields)


def compared(
    test: Any, reference: Any, monitor: Any = None, *, second_reference: Any = None, **options: Any
) -> SequenceDifference:
    return compare(test, reference, terms(**options), monitor or Notes(), second_reference=second_reference)
