"""The files that a scene was imported from: checksums and choices, to know whether they have changed."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from enfilade.errors import RunFolderError, SceneError
from enfilade.files import read_json, write_json

SOURCE_FILE = "source.json"  # in an imported scene folder
SUFFIXES = frozenset(
    {".blend", ".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz", ".fbx", ".obj"}
)  # files that Blender opens or imports


def is_importable(file: Path) -> bool:
    """Whether a file has the suffix of a format that Blender imports."""
    return file.suffix.lower() in SUFFIXES


def check_source(file: Path) -> None:
    """Refuse files that are missing, empty, or no files.

    Raises
    ------
    SceneError
    """
    if not is_importable(file):
        known = ", ".join(sorted(SUFFIXES))
        raise SceneError(f"{file} has none of the suffixes of files that Blender imports: {known}")
    if file.is_dir():
        raise SceneError(f"{file} is a folder; give the file in it")
    if not file.is_file():
        raise SceneError(f"there is no file {file}")
    try:
        with file.open("rb") as stream:
            is_empty = not stream.read(1)
    except OSError as error:
        raise SceneError(f"can't read {file}: {error.strerror}") from error
    if is_empty:
        raise SceneError(f"{file} is empty")


@dataclass(frozen=True)
class Choices:
    """What of a file is imported, and how.

    Attributes
    ----------
    scene, view_layer, camera : str
        Names; empty: the file's own.
    size, frames : tuple of int or None
        Width and height in pixels, first and last frame; None: the file's own.
    bake_px, bake_samples : int
        Of baked textures.
    """

    scene: str = ""
    view_layer: str = ""
    camera: str = ""
    size: tuple[int, int] | None = None
    frames: tuple[int, int] | None = None
    bake_px: int = 1024
    bake_samples: int = 16


@dataclass(frozen=True)
class FileState:
    """A file at the time when it was read.

    Attributes
    ----------
    file : str
        Its absolute path.
    bytes, mtime_ns : int
    sha256 : str
    """

    file: str
    bytes: int
    mtime_ns: int
    sha256: str

    @staticmethod
    def of_file(file: Path) -> FileState:
        """The present state of a file.

        Raises
        ------
        SceneError
            It can't be read.
        """
        try:
            status = file.stat()
            with file.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise SceneError(f"can't read {file}: {error.strerror}") from error
        return FileState(str(file.resolve()), status.st_size, status.st_mtime_ns, digest)

    def has_changed(self, file: Path) -> bool:
        """Whether a file has other content; one that was copied or touched has not."""
        status = file.stat()
        if (status.st_size, status.st_mtime_ns) == (self.bytes, self.mtime_ns):
            return False
        return status.st_size != self.bytes or FileState.of_file(file).sha256 != self.sha256


@dataclass(frozen=True)
class Source(FileState):
    """A file at the time when it was imported.

    Attributes
    ----------
    choices : dict
        See :class:`Choices`.
    others : tuple of FileState
        Libraries and images that it uses.
    wall_s, cpu_s : float
        Time of the import.
    """

    choices: dict[str, Any] = field(default_factory=dict)
    others: tuple[FileState, ...] = ()
    wall_s: float = 0.0
    cpu_s: float = 0.0

    @staticmethod
    def of(file: Path, choices: Choices) -> Source:
        """The present state of a file, without others.

        Raises
        ------
        SceneError
            It can't be read.
        """
        return Source(**asdict(FileState.of_file(file)), choices=_plain(choices))

    @staticmethod
    def read(folder: Path) -> Source:
        """Of an imported scene folder.

        Raises
        ------
        RunFolderError
            It holds none, or is damaged.
        """
        file = folder / SOURCE_FILE
        try:
            table = read_json(file)
            others = tuple(FileState(**other) for other in table.pop("others", ()))
            return Source(**table, others=others)
        except TypeError as error:
            raise RunFolderError(f"{file} is damaged ({error}); delete {folder}") from error

    def write(self, folder: Path) -> None:
        """Into an imported scene folder."""
        write_json(folder / SOURCE_FILE, asdict(self))

    def differences(self, file: Path, choices: Choices) -> list[str]:
        """What has changed since the import.

        Parameters
        ----------
        file
            It must exist. For others that are missing the imported scene stands.
        choices
            That are wanted now.
        """
        now = _plain(choices)
        changes = [
            f"{name}: {self.choices.get(name)!r} there, {value!r} now"
            for name, value in now.items()
            if self.choices.get(name) != value
        ]
        others = [(Path(other.file), other) for other in self.others]
        files = [(file, self), *((path, other) for path, other in others if path.is_file())]
        return changes + [
            f"{path} has changed since it was imported" for path, state in files if state.has_changed(path)
        ]


def _plain(choices: Choices) -> dict[str, Any]:
    """As JSON reads it back."""
    values = asdict(choices)
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}
