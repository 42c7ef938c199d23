"""An imported scene folder: what the importer says of it, and the settings that come from the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade.errors import CameraPathError, RunFolderError, SceneError
from enfilade.files import read_json
from enfilade.scene.blender.notes import TITLES, Note, NoteKind
from enfilade.scene.blender.process import RESULT_FILE, printable
from enfilade.settings import read_tables

FORMAT, VERSION = "enfilade-import", 1
SCENE_FILE, PATH_FILE, SETTINGS_FILE = "scene.xml", "camera_path.json", "settings.toml"
CHECK_PAGE = "check.html"
CAMERA_NODE = "Camera"  # of the note on a camera that is not exported


@dataclass(frozen=True)
class SourceView:
    """The view transform that the file asks for.

    Attributes
    ----------
    display, view_transform, look : str
        Blender's names; a look of ``None`` is none.
    """

    display: str
    view_transform: str
    look: str


@dataclass(frozen=True)
class ImportedScene:
    """A scene folder that was imported from a file of Blender, or of a format that Blender reads.

    Attributes
    ----------
    folder : Path
        With ``scene.xml``, its files, ``settings.toml`` and, if there is a camera, ``camera_path.json``.
    source : str
        Name of the file.
    blender : str
        Version.
    scene, camera : str
        Names in the file; no camera: empty.
    fps : float
    frames : tuple of int
        First and last, as the file numbers them.
    size : tuple of int
        Width and height of the images, pixels.
    exposure_ev : float
    view : SourceView
    counts : dict of str to int
        Of ``objects``, ``instances``, ``triangles``, ``materials``, ``textures``.
    notes : tuple of Note
        How the parts of the file were carried over.
    files : tuple of Path
        Libraries and images that the file uses.
    """

    folder: Path
    source: str
    blender: str
    scene: str
    camera: str
    fps: float
    frames: tuple[int, int]
    size: tuple[int, int]
    exposure_ev: float
    view: SourceView
    counts: Mapping[str, int]
    notes: tuple[Note, ...]
    files: tuple[Path, ...] = ()

    @property
    def scene_file(self) -> Path:
        """The scene."""
        return self.folder / SCENE_FILE

    @property
    def path_file(self) -> Path | None:
        """The camera path; None if the file has no camera."""
        file = self.folder / PATH_FILE
        return file if file.is_file() else None

    def checked_path(self) -> Path:
        """The camera path.

        Raises
        ------
        CameraPathError
            The file has no camera.
        """
        if self.path_file is None:
            left_out = self.notes_of(NoteKind.NOT_CARRIED)
            reasons = [f"{note.object}: {note.what}" for note in left_out if note.node == CAMERA_NODE]
            about = ", ".join([f"scene {self.scene!r}", *reasons])
            raise CameraPathError(
                f"{self.source} has no camera that can be used ({about}); add a perspective one to it, "
                "choose one by --set blender.camera=NAME, or give a path by --path"
            )
        return self.path_file

    @property
    def summary(self) -> str:
        """One line on the file, and one on its parts."""
        width, height = self.size
        camera = f"camera {self.camera}" if self.camera else "no camera"
        frames = f"frames {self.frames[0]}-{self.frames[1]} at {self.fps:g} fps"
        counted = ", ".join(f"{count:,} {name}" for name, count in self.counts.items())
        kinds = ", ".join(f"{len(self.notes_of(kind))} {title}" for kind, title in TITLES.items())
        shown = f"{width}x{height}, view {self.view.view_transform}"
        return f"{self.source} by Blender {self.blender}: {counted}; {camera}, {frames}, {shown}\n{kinds}"

    def notes_of(self, *kinds: NoteKind) -> tuple[Note, ...]:
        """Notes of some kinds."""
        return tuple(note for note in self.notes if note.kind in kinds)

    def tables_under(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Tables of settings of the file, under those that are given, which win.

        A given configuration of OpenColorIO replaces the file's view as a whole, another view its look. The
        file's white goes with its view.

        Raises
        ------
        SettingsError
            ``settings.toml`` can't be read, or holds something else.
        """
        tables = read_tables(self.folder / SETTINGS_FILE)
        video, viewing = tables.get("video", {}), dict(tables.get("viewing", {}))
        changed = given.get("video", {})
        names = ("ocio", "view", "display", "look")
        if any(changed.get(name, video.get(name)) != video.get(name) for name in names):
            viewing.pop("white", None)
        if "ocio" in changed:
            video = {}
        elif "ocio" in video:
            video = {**video, "ocio": str((self.folder / video["ocio"]).resolve())}
            if given.get("video", {}).get("view", video.get("view")) != video.get("view"):
                video.pop("look", None)
        merged = dict(given)
        for name, table in {**tables, "viewing": viewing, "video": video}.items():
            merged[name] = {**table, **given.get(name, {})}
        return merged

    @staticmethod
    def read(folder: Path) -> ImportedScene:
        """Read what the importer has written.

        Raises
        ------
        SceneError
            The folder holds no imported scene, or is damaged.
        """
        file = folder / RESULT_FILE
        if not file.is_file():
            raise SceneError(f"{folder} holds no imported scene: it has no {RESULT_FILE}")
        try:
            return _of(folder, read_json(file))
        except RunFolderError as error:
            raise SceneError(str(error)) from error
        except (ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
            raise SceneError(f"{file} is damaged ({error!r}); import the file again") from error


def _of(folder: Path, table: Mapping[str, Any]) -> ImportedScene:
    if (table["format"], table["version"]) != (FORMAT, VERSION):
        raise ValueError(f"format {table['format']!r}, version {table['version']!r}")
    first, last = map(int, table["frames"])
    width, height = map(int, table["size"])
    view = table["view"]
    return ImportedScene(
        folder=folder,
        source=printable(str(table["source"])),
        blender=printable(str(table["blender"])),
        scene=printable(str(table["scene"] or "")),
        camera=printable(str(table["camera"] or "")),
        fps=float(table["fps"]),
        frames=(first, last),
        size=(width, height),
        exposure_ev=float(table["exposure_ev"]),
        view=SourceView(*(printable(str(view[key])) for key in ("display", "view_transform", "look"))),
        counts={printable(str(name)): int(count) for name, count in table["counts"].items()},
        notes=tuple(map(Note.from_json, table["notes"])),
        files=tuple(map(Path, table.get("files", ()))),  # absent in scenes of earlier versions
    )
