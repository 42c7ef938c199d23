"""The small presets, written once a session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mitsuba as mi
import pytest
from scene_views import View, read_path, view

from enfilade.device import activate
from studies.scenes import SCENES, SceneFiles, write_scene

Load = Callable[[str], Any]


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> dict[str, SceneFiles]:
    folder = tmp_path_factory.mktemp("scenes")
    return {name: write_scene(name, folder / name, preset="small") for name in SCENES}


@pytest.fixture(scope="module")
def loaded(small: dict[str, SceneFiles]) -> Load:
    """Loads a scene. One at a time: the materials of open scenes are compiled into all kernels."""
    mi.set_variant(activate("auto").variant)
    opened: dict[str, Any] = {}

    def load(name: str) -> Any:
        if name not in opened:
            opened.clear()
            opened[name] = mi.load_file(str(small[name].scene))
        return opened[name]

    return load


@pytest.fixture(scope="module")
def look(small: dict[str, SceneFiles], loaded: Load) -> Callable[[str, int], View]:
    def look(name: str, frame: int) -> View:
        document, poses = read_path(small[name])
        fov_deg = document["camera_path"][frame]["fov"]
        return view(loaded(name), poses[frame], poses[frame + 1], fov_deg, document["fps"])

    return look
