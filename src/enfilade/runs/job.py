"""A walkthrough to render: scene, camera path, method, settings."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from enfilade import __version__
from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import CENTRE, Camera
from enfilade.errors import RunFolderError, SettingsError
from enfilade.files import read_json, write_json
from enfilade.images import check_encodable
from enfilade.images.view import view_identity
from enfilade.methods.base import Method
from enfilade.methods.opener import open_method, sections_of
from enfilade.renderer import Renderer, why_inseparable
from enfilade.scene.opener import Scene
from enfilade.settings import (
    LimitSettings,
    OutputSettings,
    Settings,
    VideoSettings,
    ViewingSettings,
)
from enfilade.viewing import Viewing

JOB_FILE = "job.json"  # in a run folder


@dataclass(frozen=True, eq=False)
class Job:
    """A walkthrough to render.

    Attributes
    ----------
    scene : Scene
    path : CameraPath
    settings : Settings
    method : str
        A built-in method's name, or ``module:Class``.
    """

    scene: Scene
    path: CameraPath
    settings: Settings = field(default_factory=Settings)
    method: str = "decoupled"

    @property
    def viewing(self) -> Viewing:
        """Viewing conditions of the video."""
        return self.settings[ViewingSettings].conditions(self.path.width, self.path.height, self.path.fps)

    def opened_method(self) -> Method:
        """A new instance of the method.

        Raises
        ------
        SettingsError
            There is no such method.
        """
        return open_method(self.method)

    def rendering_settings(self) -> Settings:
        """The settings with all sections that the method does not read at their defaults."""
        return self.settings.only([*self.opened_method().settings, LimitSettings])

    def identity(self) -> dict[str, Any]:
        """Everything on which the frames depend: a run folder holds the results of one identity.

        Limits of resources are left out, and so is the video, which is encoded again if its settings change.

        Raises
        ------
        SceneError
            The scene is missing or malformed.
        """
        method = self.opened_method()
        settings = self.settings.replace(OutputSettings, layers=self.settings[OutputSettings].ordered)
        return {
            "enfilade": __version__,
            "method": {
                "name": method.name,
                "revision": method.revision,
                **method.libraries(self.settings),
            },
            "scene": self.scene.identity(),
            "path": path_identity(self.path),
            "settings": settings.to_tables([*method.settings, OutputSettings]),
        }

    @cached_property
    def video_identity(self) -> dict[str, Any]:
        """Everything on which the video depends beside the frames: clips of another one are encoded again."""
        settings = self.settings[VideoSettings]
        exposure_ev = self.settings[ViewingSettings].exposure_ev
        table = {name: value for name, value in settings.to_table().items() if name != "ocio"}  # a path
        return {**table, **view_identity(settings), "exposure_ev": exposure_ev}

    def check(self) -> None:
        """Refuse everything that can be known to be wrong before the scene is loaded.

        Raises
        ------
        InputError
        """
        _ = self.viewing
        self.opened_method().check(self.settings)
        self.scene.check(self.settings[LimitSettings])
        check_encodable(
            self.settings[VideoSettings],
            fps=self.path.fps,
            width=self.path.width,
            height=self.path.height,
            exposure_ev=self.settings[ViewingSettings].exposure_ev,
        )

    def preflight(self) -> list[str]:
        """Load the scene once in a process of its own, with limits of memory and time.

        Returns
        -------
        list of str
            What the scene has and the frames will not show.

        Raises
        ------
        SceneError
        SettingsError
            The method can't render it.
        """
        found = self.scene.preflight(self.settings)
        self._check_lobes(found.why_inseparable)
        return found.notes

    def open_renderer(self) -> Renderer:
        """Load the scene.

        Raises
        ------
        SceneError
            The scene is missing or malformed.
        SettingsError
            The method can't render it.
        DeviceError
            No usable LLVM or CUDA.
        """
        renderer = self.scene.open(self.settings)
        self._check_lobes(why_inseparable(renderer))
        return renderer

    def _check_lobes(self, reason: str) -> None:
        if reason and self.opened_method().needs_lobes:
            raise SettingsError(
                f"--method {self.method} can't render {self.scene.file}: {reason}; take --method "
                "paper or --method reference"
            )

    def to_json(self) -> dict[str, Any]:
        """The whole job, fit for JSON; read back by :meth:`from_json`."""
        path = self.path
        return {
            "scene": self.scene.to_json(),
            "method": self.method,
            "settings": self.settings.to_tables(sections_of(self.opened_method())),
            "path": {
                "size": [path.width, path.height],
                "fps": path.fps,
                "numbers": list(path.numbers),
                "cuts": sorted(path.cuts),
                "poses": [camera.world_from_camera.ravel().tolist() for camera in path.cameras],
                "fov_deg": [camera.fov_deg for camera in path.cameras],
                "principal_points": [list(camera.principal_point) for camera in path.cameras],
            },
        }

    @staticmethod
    def from_json(table: dict[str, Any]) -> Job:
        """Read back from :meth:`to_json`.

        Raises
        ------
        SettingsError
            There is no such method or setting.
        ArithmeticError, AttributeError, LookupError, TypeError, ValueError
            It is something else.
        """
        path = table["path"]
        width, height = map(int, path["size"])
        poses = np.array(path["poses"], np.float64).reshape(-1, 4, 4)
        points = path["principal_points"]
        cameras = tuple(
            Camera(pose, float(fov), width, height, (float(x), float(y)))
            for pose, fov, (x, y) in zip(poses, path["fov_deg"], points, strict=True)
        )
        numbers = tuple(int(number) for number in path["numbers"])
        return Job(
            scene=Scene.from_json(table["scene"]),
            path=CameraPath(cameras, numbers, float(path["fps"]), frozenset(path["cuts"])),
            settings=Settings.from_tables(table["settings"], sections_of(open_method(table["method"]))),
            method=table["method"],
        )


def read_job(folder: Path) -> Job:
    """The job of a run folder.

    Raises
    ------
    RunFolderError
        It holds none, or is damaged.
    SettingsError
        Its method can't be imported, or its settings are unknown here.
    """
    file = folder / JOB_FILE
    if not file.is_file():
        out = shlex.quote(str(folder))
        raise RunFolderError(f"{folder} holds no run; begin one with `enfilade render SCENE --out {out}`")
    table = read_table(folder)
    try:
        return Job.from_json(table)
    except SettingsError:  # a method that can't be imported here, or an unknown setting
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise _damaged(file, error) from error


def write_job(folder: Path, job: Job) -> None:
    """Write the job of a run folder, unless it is there.

    Files in the folder, as those of an imported scene, are named by their places in it: it may be moved.

    Raises
    ------
    RunFolderError, NoSpaceError
    """
    home = folder.resolve()

    def in_folder(name: str) -> str:
        file = Path(name).absolute()
        return str(file.relative_to(home) if file.is_relative_to(home) else file)

    table = _relocated(job.to_json(), in_folder)
    with suppress(RunFolderError):  # there is none yet, or it is damaged
        if read_json(folder / JOB_FILE) == table:
            return
    write_json(folder / JOB_FILE, table)


def read_table(folder: Path) -> dict[str, Any]:
    """The job of a run folder as plain values, with absolute names of files.

    Raises
    ------
    RunFolderError
        It can't be read, or is damaged.
    """
    file = folder / JOB_FILE
    try:
        return _relocated(read_json(file), lambda name: str(folder.resolve() / name))
    except (AttributeError, LookupError, TypeError) as error:
        raise _damaged(file, error) from error


def _relocated(table: dict[str, Any], place: Callable[[str], str]) -> dict[str, Any]:
    """A job as plain values, with the files of its scene and view at other places.

    The names of OpenColorIO's own configurations, such as ``ocio://default``, are no files.
    """
    scene, video = table["scene"], table["settings"]["video"]
    ocio = video.get("ocio", "")
    return {
        **table,
        "scene": {**scene, "file": place(scene["file"])},
        "settings": {
            **table["settings"],
            "video": {**video, "ocio": place(ocio) if ocio and "://" not in ocio else ocio},
        },
    }


def _damaged(file: Path, error: Exception) -> RunFolderError:
    return RunFolderError(f"{file} is damaged ({error}); run the command that made the run again")


def path_identity(path: CameraPath) -> dict[str, Any]:
    """Plain values, fit for JSON, that differ between any two camera paths."""
    digest = hashlib.sha256()
    for camera in path.cameras:
        digest.update(camera.world_from_camera.tobytes())
        digest.update(repr(float(camera.fov_deg)).encode())
        if camera.principal_point != CENTRE:
            digest.update(repr(camera.principal_point).encode())
    return {
        "size": [path.width, path.height],
        "fps": path.fps,
        "frames": list(path.numbers),
        "cuts": sorted(path.numbers[i] for i in path.cuts),
        "poses": digest.hexdigest(),
    }
