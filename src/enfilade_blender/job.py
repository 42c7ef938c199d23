# SPDX-License-Identifier: GPL-3.0-or-later
"""The job file: what to read, what of it, and where the result goes."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from enfilade_blender.failure import ExportError


@dataclass(frozen=True)
class Limits:
    """Bounds of a scene.

    Attributes
    ----------
    instances : int
        Objects of the evaluated scene, instances included.
    triangles : int
        Triangles that are written.
    """

    instances: int = 1_000_000
    triangles: int = 50_000_000


@dataclass(frozen=True)
class Job:
    """One task.

    Attributes
    ----------
    task : "export" or "cycles"
    source : Path
        A .blend file, or one that Blender imports.
    out : Path
        An empty folder.
    scene, view_layer, camera : str or None
        Names in the file; None takes the active ones.
    frames : (first, last) or None
        None takes the scene's range.
    size : (width, height) or None
        Pixels; None takes the scene's resolution.
    limits
    library_folders : tuple of Path
        Folders besides the source's own that linked libraries and images may lie in.
    bake_px : int
        Largest width of a baked texture.
    bake_samples : int
        Cycles' samples for a texel.
    spp : int
        Cycles' samples for a pixel, of the task "cycles".
    denoise : bool
        Whether Cycles denoises by Open Image Denoise.
    frame_list : tuple of int
        Frames of the task "cycles"; empty: the first.
    unbiased : bool
        Whether Cycles renders without clamping, filtered glossy and light threshold, through a box filter.
    seed : int
        Of Cycles.
    """

    task: Literal["export", "cycles"]
    source: Path
    out: Path
    scene: str | None = None
    view_layer: str | None = None
    camera: str | None = None
    frames: tuple[int, int] | None = None
    size: tuple[int, int] | None = None
    limits: Limits = Limits()
    library_folders: tuple[Path, ...] = ()
    bake_px: int = 1024
    bake_samples: int = 16
    spp: int = 64
    denoise: bool = False
    frame_list: tuple[int, ...] = ()
    unbiased: bool = False
    seed: int = 0


def read_job(file: Path) -> Job:
    """Read a job file.

    Raises
    ------
    ExportError
        A key is unknown or missing.
    """
    values: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    known = {field.name for field in fields(Job)}
    wrong = sorted(set(values) - known) + sorted({"task", "source", "out"} - set(values))
    if wrong or values["task"] not in ("export", "cycles"):
        raise ExportError(
            f"unknown or missing: {', '.join(wrong) or values['task']}",
            str(file),
            f"keys are {', '.join(sorted(known))}",
        )
    values["source"], values["out"] = Path(values["source"]), Path(values["out"])
    values["library_folders"] = tuple(Path(folder) for folder in values.get("library_folders", ()))
    values["limits"] = Limits(**values.get("limits", {}))
    values["frame_list"] = tuple(values.get("frame_list", ()))
    for key in ("frames", "size"):
        pair = values.get(key)
        values[key] = (int(pair[0]), int(pair[1])) if pair else None
    return Job(**values)
