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

from enfilade.backends.scenefile import MB, SceneFile
from enfilade.codec.pictures import PICTURES, picture_pixels
from enfilade.errors import ImageError, SceneError
from enfilade.settings import LimitSettings

__all__ = ["check_scene"]

PLUGIN = re.compile(r"[a-z0-9_]+")
FILM = ("width", "height", "crop_width", "crop_height")
MILLION = 1_000_000
MESH_HEADER = 1 << 16  # bytes in which the header of a PLY mesh must end
FACE_BYTES, VERTEX_BYTES = 4, 6  # least that one takes in a binary file


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
    inspector = _Inspector(SceneFile(scene), roots, limits)
    inspector.inspect()
    return list(inspector.files)


@dataclass(eq=False)
class _Inspector:
    scene: SceneFile
    roots: list[Path]
    limits: LimitSettings
    files: dict[Path, None] = field(default_factory=dict)

    def inspect(self) -> None:
        """Check the scene file and all that it names; what it includes, before that is read."""
        for file, element in self.scene.elements():
            self._check_plugin(file, element)
            self._check_film(file, element)
            for name in self.scene.names(file, element):
                self._check_file(file, name)

    def _check_plugin(self, file: Path, element: Element) -> None:
        kind = element.get("type")
        if kind is not None and not PLUGIN.fullmatch(self.scene.filled(file, kind)):
            raise SceneError(f"{file}: <{element.tag} type={kind!r}> is no name of a plugin")

    def _check_film(self, file: Path, element: Element) -> None:
        if element.tag != "film":
            return
        sides = [1, 1]
        for child in element.iter("integer"):
            if child.get("name") in FILM:
                text = self.scene.filled(file, child.get("value", ""))
                if not re.fullmatch(r"\s*[0-9]{1,9}\s*", text):
                    raise SceneError(
                        f"{file}: a film's {child.get('name')} is {text!r}, not a number of pixels"
                    )
                side = FILM.index(str(child.get("name"))) % 2
                sides[side] = max(sides[side], int(text))
        self._bound(sides[0] * sides[1] / MILLION, "megapixels", f"{file}: a film", "million pixels")

    def _check_file(self, file: Path, name: str) -> None:
        try:
            place = self.scene.place(file, name).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # links in a circle, a NUL
            raise SceneError(f"{file} names a file that can't be looked for: {name!r} ({error})") from error
        if not any(place.is_relative_to(root) for root in self.roots):
            raise SceneError(
                f"{file} names {name!r}, which leads to {place}, outside the scene's folder; "
                f"allow it with --allow {place.parent}"
            )
        if place.is_file():
            if place not in self.files:
                self.files[place] = None
                self._check_size(place)
        elif place.exists() and not place.is_dir():
            raise SceneError(f"{file} names {name!r}, which is no ordinary file")

    def _check_size(self, file: Path) -> None:
        size = file.stat().st_size
        self._bound(size / MB, "file_mb", str(file), "MB")
        suffix = file.suffix.lower()
        if suffix in PICTURES:
            try:
                pixels = picture_pixels(file)
            except ImageError as error:
                raise SceneError(str(error)) from error
            self._bound(pixels / MILLION, "megapixels", str(file), "million pixels")
        elif suffix == ".ply":
            self._check_ply(file, size)

    def _check_ply(self, file: Path, size: int) -> None:
        with file.open("rb") as raw:
            header, end, _ = raw.read(MESH_HEADER).partition(b"end_header")
        if not header.startswith(b"ply") or not end:
            raise SceneError(f"{file} is no PLY mesh, or its header is damaged")
        for name, least in ((b"vertex", VERTEX_BYTES), (b"face", FACE_BYTES)):
            found = re.search(rb"element\s+" + name + rb"\s+([0-9]{1,18})\s", header)
            count = int(found[1]) if found else 0
            self._bound(count / MILLION, "elements_m", str(file), f"million elements ({name.decode()})")
            if count * least > size:
                raise SceneError(
                    f"{file} says that it has {count} of {name.decode()}, but is too short for it"
                )

    def _bound(self, value: float, setting: str, what: str, unit: str) -> None:
        most = getattr(self.limits, setting)
        if value > most:
            flag = f"--limits-{setting.replace('_', '-')}"
            raise SceneError(f"{what} has {value:.6g} {unit}; at most {most} are taken: raise {flag}")
