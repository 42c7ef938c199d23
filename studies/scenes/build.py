"""Build a generated scene: furnish it, lay out its walk, write both."""

from __future__ import annotations

from pathlib import Path

from studies.scenes import atrium, courtyard, gallery, kitchen, room
from studies.scenes.presets import PRESETS
from studies.scenes.walk import write_path
from studies.scenes.writer import SceneWriter


def build_scene(name: str, folder: Path, preset_name: str, size: tuple[int, int] | None) -> tuple[Path, Path]:
    """Write `scene.xml` and `camera_path.json` of a known scene and preset; return both paths."""
    designs = {"room": room, "atrium": atrium, "gallery": gallery, "kitchen": kitchen, "courtyard": courtyard}
    design = designs[name]
    preset = PRESETS[preset_name]
    size = size or preset.size
    writer = SceneWriter(folder)
    design.furnish(writer, preset)
    walk, frames = design.walk(preset)
    poses = walk.poses(frames)
    scene = writer.write(camera_to_world=poses[0], fov_deg=walk.fov_deg, size=size)
    path = folder / "camera_path.json"
    write_path(path, poses, fov_deg=walk.fov_deg, size=size)
    return scene, path
