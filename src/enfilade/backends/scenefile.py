"""What a scene file says before any renderer reads it: the files it names, and its fingerprint."""

from __future__ import annotations

import hashlib
from pathlib import Path
from xml.etree import ElementTree as ET

from enfilade.errors import SceneError


def referenced_files(scene: Path) -> list[Path]:
    """Files that a Mitsuba scene names (meshes, textures, includes), found or not, each once.

    Raises
    ------
    SceneError
        The file is no well-formed XML.
    """
    found: dict[Path, None] = {}
    _collect(scene, found)
    return list(found)


def fingerprint(scene: Path) -> str:
    """SHA-256 over a scene file and every file it names, in the order in which they are named.

    Raises
    ------
    SceneError
    """
    digest = hashlib.sha256()
    for file in (scene, *referenced_files(scene)):
        if file.is_file():
            with file.open("rb") as stream:
                digest.update(hashlib.file_digest(stream, "sha256").digest())
    return digest.hexdigest()


def _collect(scene: Path, found: dict[Path, None]) -> None:
    try:
        root = ET.parse(scene).getroot()  # noqa: S314  (the scene is the user's own)
    except OSError as error:
        raise SceneError(f"can't read the scene {scene}: {error.strerror}") from error
    except ET.ParseError as error:
        raise SceneError(f"{scene} is not well-formed XML: {error}") from error
    for element in root.iter():
        if element.tag == "include":
            name = element.get("filename", "")
        elif element.tag == "string" and element.get("name") == "filename":
            name = element.get("value", "")
        else:
            continue
        file = scene.parent / name
        is_new = file not in found
        found[file] = None
        if element.tag == "include" and is_new and file.is_file():
            _collect(file, found)
