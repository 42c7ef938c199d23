"""The small presets, written and loaded once a session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mitsuba as mi
import pytest
from scene_views import View, read_path, view

from enfilade.device import activate
from studies.scenes import SCENES, SceneFiles, write_scene


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> dict[str, SceneFiles]:
    folder = tmp_path_factory.mktemp("scenes")
    return {name: write_scene(name, folder / name, preset="small") for name in SCENES}


@pytest.fixture(scope="session")
def loaded(small: dict[str, SceneFiles]) -> dict[str, Any]:
    mi.set_variant(activate("auto").variant)
    return {name: mi.load_file(str(files.scene)) for name, files in small.items()}


@pytest.fixture(scope="session")
def look(small: dict[str, SceneFiles], loaded: dict[str, Any]) -> Callable[[str, int], View]:
    def look(name: str, frame: int) -> View:
        document, poses = read_path(small[name])
        fov_deg = document["camera_path"][frame]["fov"]
        return view(loaded[name], poses[frame], poses[frame + 1], fov_deg, document["fps"])

    return look
