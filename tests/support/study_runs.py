"""Small walkthroughs for the studies: of analytic scenes, and of a room in Mitsuba's format."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from enfilade.camera.path import CameraPath
from enfilade.methods.analysis import Analysis, analyze
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Silence
from enfilade.runs.job import Job
from enfilade.scene.opener import Scene
from enfilade.settings import Settings
from studies.cases.noise_free import NoiseFreeRenderer
from studies.cases.windows import Windows
from support.analytic import AnalyticRenderer
from support.analytic_scene import AnalyticScene
from support.example_scenes import room_walk

# A screen of 64 x 48 px at the paper's 28 pixels a degree. Keyframes every 6 frames.
TABLES: dict[str, dict[str, Any]] = {
    "viewing": {"diagonal_m": 0.025},
    "keyframes": {"spacing": 6},
    "sampling": {"spp": 4},
}
ROOM = """<scene version="3.0.0">
<shape type="cube" id="walls">
  <transform name="to_world"><scale x="3" y="2" z="5"/><translate y="1"/></transform>
  <bsdf type="twosided"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
    <transform name="to_uv"><scale value="8"/></transform>
  </texture></bsdf></bsdf>
</shape>
<shape type="sphere" id="ball">
  <point name="center" x="0.5" y="0.6" z="-0.5"/><float name="radius" value="0.6"/>
  <bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.2, 0.15"/></bsdf>
</shape>
<shape type="rectangle" id="mirror">
  <transform name="to_world"><scale value="0.8"/><translate x="-0.9" y="1.2" z="-2"/></transform>
  <bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf>
</shape>
<shape type="rectangle" id="lamp">
  <transform name="to_world"><rotate x="1" angle="90"/><translate y="2.9"/></transform>
  <bsdf type="diffuse"/><emitter type="area"><rgb name="radiance" value="6"/></emitter>
</shape>
</scene>"""


def settings_of(**tables: dict[str, Any]) -> Settings:
    return Settings.from_tables(
        {name: TABLES.get(name, {}) | tables.get(name, {}) for name in {*TABLES, *tables}}
    )


def windows_of(
    scene: AnalyticScene, count: int = 24, *, path: CameraPath | None = None, folder: Path | None = None
) -> Windows:
    """Windows of a scene: without noise, or path traced with a folder."""
    renderer = AnalyticRenderer(scene)
    source = NoiseFreeRenderer(renderer) if folder is None else renderer
    walk = Walkthrough(path or room_walk(count, size=(64, 48)), settings_of(), source)
    analysis = Analysis(walk.path, walk.settings, tuple(analyze(walk, f) for f in range(len(walk.path))))
    return Windows(walk, analysis, Silence(), probes=2, reference_spp=64, folder=folder)


def room_job(folder: Path, count: int, *, method: str = "paper", **tables: dict[str, Any]) -> Job:
    """A walk through the room of Mitsuba's format, 48x36 pixels."""
    file = folder / "room.xml"
    file.write_text(ROOM)
    diagonal_m = math.hypot(48, 36) * 0.25 / 800.0
    settings = settings_of(**{"viewing": {"diagonal_m": diagonal_m}, **tables})
    return Job(Scene(file), room_walk(count, size=(48, 36)), settings, method)


def room_files(folder: Path, count: int) -> tuple[Path | str, ...]:
    """Arguments of a command for the same walk: the scene, and its path."""
    (folder / "room.xml").write_text(ROOM)
    cameras = [
        {"camera_to_world": camera.world_from_camera.ravel().tolist(), "fov": 50, "aspect": 4 / 3}
        for camera in room_walk(count, size=(48, 36)).cameras
    ]
    values = {"render_width": 48, "render_height": 36, "fps": 30, "camera_type": "perspective"}
    path = {**values, "seconds": count / 30, "camera_path": cameras}
    (folder / "camera_path.json").write_text(json.dumps(path))
    return folder / "room.xml", "--path", folder / "camera_path.json"
