"""Views of a generated scene through a coarse grid of rays."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from studies.scenes import SceneFiles

PIXELS_PER_DEGREE = 28.0  # §6, at 640 pixels across
GRID = (64, 48)


@dataclass(frozen=True)
class View:
    """Surfaces along a coarse grid of rays in one frame of a walk."""

    eye: np.ndarray  # (3,), metres
    rays: np.ndarray  # (n, 3), directions
    distance: np.ndarray  # (n,), metres, infinite where nothing is hit
    is_view_dependent: np.ndarray  # (n,)
    speed_deg_s: np.ndarray  # (n,), on the screen, towards the next frame


def read_path(files: SceneFiles) -> tuple[dict[str, Any], np.ndarray]:
    document = json.loads(files.path.read_text())
    poses = np.array([entry["camera_to_world"] for entry in document["camera_path"]])
    return document, poses.reshape(-1, 4, 4)


def view(scene: Any, here: np.ndarray, there: np.ndarray, fov_deg: float, fps: int) -> View:
    width, height = GRID
    focal = height / 2 / np.tan(np.radians(fov_deg) / 2)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    local = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)
    local = local.reshape(-1, 3) / np.linalg.norm(local.reshape(-1, 3), axis=1, keepdims=True)
    rays = local @ here[:3, :3].T
    hit = scene.ray_intersect(
        mi.Ray3f(mi.Point3f(here[:3, 3].tolist()), mi.Vector3f(rays.T.astype(np.float32)))
    )
    lobes = int(mi.BSDFFlags.Glossy) | int(mi.BSDFFlags.Delta)
    distance = np.array(hit.t)
    seen = here[:3, 3] + rays * np.minimum(distance, 1e3)[:, None]
    moved = (seen - there[:3, 3]) @ there[:3, :3]
    column = width / 2 + focal * moved[:, 0] / -moved[:, 2]
    row = height / 2 - focal * moved[:, 1] / -moved[:, 2]
    flow = np.hypot(column - x.ravel(), row - y.ravel()) * 640 / width
    flags = np.array(hit.bsdf().flags(), dtype=np.int64)
    return View(here[:3, 3], rays, distance, (flags & lobes) != 0, flow * fps / PIXELS_PER_DEGREE)


def folder_bytes(folder: Path) -> dict[str, bytes]:
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }
