"""The generated scenes: ROOM and ATRIUM of the case studies (§6), others of the bench alone.

Heavy libraries are imported when a scene is written.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from enfilade.errors import SceneError, SettingsError

SCENES = ("room", "atrium", "gallery", "kitchen", "courtyard")
PRESETS = ("full", "small")


@dataclass(frozen=True)
class SceneFiles:
    """Files of a written scene.

    Attributes
    ----------
    scene
        Mitsuba 3 XML; meshes and textures are in adjacent folders.
    path
        The camera path, nerfstudio's `camera_path.json`.
    """

    scene: Path
    path: Path


def write_scene(
    name: str, folder: Path, *, preset: str = "full", size: tuple[int, int] | None = None
) -> SceneFiles:
    """Write a generated scene and its camera path. The same call writes the same bytes.

    Parameters
    ----------
    name
        `room`: diffuse, a walk of varying speed with rests, 448 frames. `atrium`: mirrors, glass,
        metal and a polished floor, a steady walk, 200 frames. `gallery`: a low sun through blinds, showcases
        and a mirror, 300 frames. `kitchen`: coated, rough and metallic materials under small lamps,
        300 frames. `courtyard`: arcades around an open court under sun and sky, 300 frames.
    folder
        Created if absent; files of the same names are replaced.
    preset
        `full` (640 x 480) or `small` (320 x 240, fewer frames, coarser shapes).
    size
        Width and height of the frames, pixels, instead of the preset's. The vertical field of view is kept.

    Raises
    ------
    SceneError
        No scene has this name.
    SettingsError
        No preset has this name, no image this size, or a library of the generators is missing.
    """
    if name not in SCENES:
        known = ", ".join(SCENES)
        raise SceneError(f"there is no generated scene {name!r}; the known ones are {known}")
    if preset not in PRESETS:
        known = ", ".join(PRESETS)
        raise SettingsError(f"there is no preset {preset!r}; the known ones are {known}")
    if size is not None and min(size) < 1:
        raise SettingsError(f"there is no image of {size[0]}x{size[1]} pixels")
    try:
        from studies.scenes.build import build_scene
    except ModuleNotFoundError as error:
        raise SettingsError(
            f"{error.name} is not installed; run `make setup`, or install the group `studies`"
        ) from error

    scene, path = build_scene(name, Path(folder), preset, size)
    return SceneFiles(scene=scene, path=path)


__all__ = ["PRESETS", "SCENES", "SceneFiles", "write_scene"]
