"""What a scene asks for, read before any renderer reads it: plugins, files, sizes.

Mitsuba takes a plugin's name to ``dlopen``, and a file's name from anywhere; neither is asked here for more
than its name and its header.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from enfilade.errors import ImageError, SceneError
from enfilade.scene.headers import check_volume, mesh_elements, pixels
from enfilade.scene.scenefile import MB, Name, SceneFile, as_loaded
from enfilade.settings import LimitSettings

__all__ = ["check_scene"]

PLUGIN = re.compile(r"[a-z0-9_]+")
FILM = ("width", "height", "crop_width", "crop_height")
MILLION = 1_000_000
BLENDER = "blender"  # a plugin that is given addresses in memory, where Blender keeps a mesh
PLY_READERS = ("ply", "ellipsoids", "ellipsoidsmesh")
LEAST_BYTES = {"vertex": 6, "face": 4}  # that one takes in a PLY mesh


def check_scene(scene: Path, limits: LimitSettings) -> list[Path]:
    """Refuse a Mitsuba scene that reaches for what is not its own, or for more than it may have.

    Parameters
    ----------
    scene
        The XML file. Files that it includes are read too.
    limits

    Returns
    -------
    list of Path
        Files that it names and that are there, each once.

    Raises
    ------
    SceneError
        A file can't be read or is malformed; a plugin's name is none; a file lies outside the scene's
        folder and those that are allowed; something is too large. The message names the file, what is in it,
        and the setting.
    """
    roots = [scene.resolve().parent, *(Path(p).resolve() for p in limits.allow.split(os.pathsep) if p)]
    inspector = _Inspector(roots, limits)
    for name in as_loaded(scene):
        inspector.inspect(SceneFile(name))
    return list(inspector.files)


@dataclass(eq=False)
class _Inspector:
    roots: list[Path]
    limits: LimitSettings
    files: dict[Path, None] = field(default_factory=dict)
    meshes: set[Path] = field(default_factory=set)  # that have been looked at as such
    _of_mesh: set[Element] = field(default_factory=set)  # strings within shapes that read PLY
    _sides: dict[Element, list[int]] = field(default_factory=dict)  # of the film that a number belongs to

    def inspect(self, scene: SceneFile) -> None:
        """Check a scene file and all that it names; what it includes, before that is read."""
        for file, element, names in scene.elements():
            self._check_plugin(file, element)
            self._check_film(file, element)
            for name in names:
                self._check_file(name)
        for element, name in scene.strings():
            self._check_file(name, is_mesh=element in self._of_mesh)

    def _check_plugin(self, file: Path, element: Element) -> None:
        kind = element.get("type")
        if kind is not None and not PLUGIN.fullmatch(kind):
            raise SceneError(f"{file}: <{element.tag} type={kind!r}> is no name of a plugin")
        if kind == BLENDER:
            raise SceneError(f"{file}: only Blender itself can give a shape of type {kind!r} what it reads")
        if kind in PLY_READERS:
            self._of_mesh.update(element)

    def _check_film(self, file: Path, element: Element) -> None:
        if element.tag == "film":
            sides = [1, 1]
            self._sides.update((child, sides) for child in element)
        name = _snake_case(element.get("name", ""))
        if element in self._sides and name in FILM:
            text = element.get("value", "")
            if not re.fullmatch(r"\s*[0-9]{1,9}\s*", text):
                raise SceneError(f"{file}: a film's {name} is {text!r}, not a number of pixels")
            sides = self._sides[element]
            sides[FILM.index(name) % 2] = max(sides[FILM.index(name) % 2], int(text))
            self._bound(sides[0] * sides[1] / MILLION, "megapixels", f"{file}: a film", "million pixels")

    def _check_file(self, name: Name, *, is_mesh: bool = False) -> None:
        try:
            place = name.place.resolve()
        except (OSError, ValueError, RuntimeError) as error:  # links in a circle, a NUL
            raise SceneError(
                f"{name.file} names a file that can't be looked for: {name.text!r} ({error})"
            ) from error
        if not any(place.is_relative_to(root) for root in self.roots):
            raise SceneError(
                f"{name.file} names {name.text!r}, which leads to {place}, outside the scene's folder; "
                f"allow it with --allow {place.parent}"
            )
        if place.is_file():
            try:
                self._check_size(place, is_mesh=is_mesh or place.suffix.lower() == ".ply")
            except OSError as error:
                raise SceneError(f"can't read {place}: {error.strerror}") from error
        elif place.exists() and not place.is_dir():
            raise SceneError(f"{name.file} names {name.text!r}, which is no ordinary file")

    def _check_size(self, file: Path, *, is_mesh: bool) -> None:
        if file not in self.files:
            self.files[file] = None
            self._bound(file.stat().st_size / MB, "file_mb", str(file), "MB")
            try:
                self._bound(pixels(file) / MILLION, "megapixels", str(file), "million pixels")
            except ImageError as error:
                raise SceneError(str(error)) from error
            check_volume(file)
        if is_mesh and file not in self.meshes:
            self.meshes.add(file)
            for kind, count in mesh_elements(file).items():
                self._bound(count / MILLION, "elements_m", str(file), f"million elements ({kind})")
                if count * LEAST_BYTES.get(kind, 0) > file.stat().st_size:
                    raise SceneError(f"{file} says that it has {count} of {kind}, but is too short for it")

    def _bound(self, value: float, setting: str, what: str, unit: str) -> None:
        most = getattr(self.limits, setting)
        if value > most:
            flag = f"--limits-{setting.replace('_', '-')}"
            raise SceneError(f"{what} has {value:.6g} {unit}; at most {most} are taken: raise {flag}")


def _snake_case(name: str) -> str:
    """The name of a property as Mitsuba reads it in scenes of versions below 2: ``cropWidth``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
