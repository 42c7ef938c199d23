"""What is to be rendered, and by whom."""

from __future__ import annotations

import hashlib
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera
from enfilade.device import active
from enfilade.errors import CameraPathError, RunFolderError, SettingsError
from enfilade.files import read_json
from enfilade.images import check_encodable
from enfilade.images.view import view_identity
from enfilade.methods.denoise import denoiser_name, why_no_denoiser
from enfilade.pipeline.versions import makers
from enfilade.renderer import Renderer, why_inseparable
from enfilade.scene.opener import check_scene, identify_scene, open_renderer
from enfilade.scene.preflight import preflight
from enfilade.settings import Settings
from enfilade.store import Run
from enfilade.viewing import Viewing

JOB_FILE = "job.json"  # in a run folder: what its workers read


@dataclass(frozen=True, eq=False)
class Job:
    """A walkthrough to render.

    Attributes
    ----------
    scene : Path
        A Mitsuba scene, or one for the renderer.
    path : CameraPath
    settings : Settings
    method : {"decoupled", "paper", "reference"}
    renderer : str or None
        Import path of your own renderer (:mod:`enfilade.scene.opener`); Mitsuba by default.
    """

    scene: Path
    path: CameraPath
    settings: Settings
    method: str
    renderer: str | None = None

    @property
    def viewing(self) -> Viewing:
        """Who looks at the video, and on what."""
        of = self.settings.viewing
        return Viewing(
            width_px=self.path.width,
            height_px=self.path.height,
            diagonal_m=of.diagonal_m,
            distance_m=of.distance_m,
            fps=self.path.fps,
            peak_cd_m2=of.peak_cd_m2,
            black_cd_m2=of.black_cd_m2,
            persistence=of.persistence,
        )

    def identity(self, renderer: Renderer | None = None) -> dict[str, Any]:
        """What makes the results what they are: a run folder holds one such identity.

        What a scene may ask for is left out, and the number of paths in flight, which changes rare paths
        alone: a run that lacks memory must be able to go on with fewer.

        Parameters
        ----------
        renderer
            Adds the number of shapes. Without it the scene is not loaded: its files are only hashed.

        Raises
        ------
        SceneError
            The scene is missing or malformed.
        SettingsError
            The view of an OpenColorIO configuration can't be opened.
        """
        scene = identify_scene(self.scene, self.renderer)
        shapes = {} if renderer is None else {"shapes": len(renderer.describe().shapes)}
        settings = self.settings.to_tables()
        del settings["trace"]["chunk"]
        del settings["limits"]
        view = view_identity(self.settings.video)
        ocio = {"opencolorio": view["opencolorio"]} if view else {}
        return {
            "method": self.method,
            "scene": {"fingerprint": scene.fingerprint, **shapes},
            "path": path_identity(self.path),
            "settings": settings,
            **({"view": {"processor": view["processor"]}} if view else {}),
            "versions": {
                **makers(),
                "renderer": scene.renderer,
                "variant": scene.variant,
                **({"denoiser": denoiser_name()} if self._denoises else {}),
                **ocio,
            },
        }

    @property
    def _denoises(self) -> bool:
        return self.method == "decoupled" and self.settings.light.denoiser != "none"

    def check_scene(self, *, is_tried: bool = False) -> None:
        """Refuse a scene that can't be rendered, or uses what it may not, before it is loaded.

        Parameters
        ----------
        is_tried
            Load it as well, in a preflight process if Mitsuba renders it.

        Raises
        ------
        SceneError
        SettingsError
            The method can't render the scene, or needs a library that is not installed.
        """
        if self._denoises and (why := why_no_denoiser()):
            raise SettingsError(why)
        settings = self.settings
        check_scene(self.scene, settings.limits, self.renderer)
        if is_tried and self.renderer is None:
            self.check_separable(preflight(self.scene, settings.trace, settings.limits, active().variant))
        elif is_tried and self.method == "decoupled":
            self.check_separable(why_inseparable(self.open_renderer()))

    def open_renderer(self) -> Renderer:
        """Load the scene.

        Raises
        ------
        SceneError
            The scene is missing or malformed.
        DeviceError
            No usable LLVM or CUDA.
        """
        return open_renderer(self.scene, self.settings.trace, self.renderer)

    def check_video(self) -> None:
        """Refuse a video that can't be encoded here, before a night of rendering.

        Raises
        ------
        SettingsError
        """
        check_encodable(
            self.settings.video,
            width=self.path.width,
            height=self.path.height,
            exposure_ev=self.settings.viewing.exposure_ev,
        )

    def check_separable(self, why_inseparable: str) -> None:
        """Refuse a scene whose lobes can't be estimated apart, if the method requires it.

        Parameters
        ----------
        why_inseparable
            See :attr:`enfilade.renderer.LobeRenderer.why_inseparable`.

        Raises
        ------
        SettingsError
        """
        if self.method == "decoupled" and why_inseparable:
            raise SettingsError(
                f"--method decoupled can't render {self.scene}: {why_inseparable}; "
                "take --method paper or --method reference"
            )

    def to_json(self) -> dict[str, Any]:
        """All of it, fit for JSON, for workers elsewhere; :meth:`from_json` reads back the very same."""
        path = self.path
        return {
            "scene": str(self.scene.resolve()),
            "method": self.method,
            "renderer": self.renderer,
            "settings": self.settings.to_tables(),
            "path": {
                "size": [path.width, path.height],
                "fps": path.fps,
                "numbers": list(path.numbers),
                "cuts": sorted(path.cuts),
                "poses": [camera.world_from_camera.ravel().tolist() for camera in path.cameras],
                "fov_deg": [camera.fov_deg for camera in path.cameras],
            },
        }

    @staticmethod
    def from_json(table: dict[str, Any]) -> Job:
        """Read back from :meth:`to_json`.

        Raises
        ------
        KeyError, TypeError, ValueError
            It is something else.
        """
        path = table["path"]
        poses = np.array(path["poses"], np.float64).reshape(-1, 4, 4)
        cameras = tuple(
            Camera(pose, float(fov), *path["size"]) for pose, fov in zip(poses, path["fov_deg"], strict=True)
        )
        numbers = tuple(int(number) for number in path["numbers"])
        return Job(
            scene=Path(table["scene"]),
            path=CameraPath(cameras, numbers, float(path["fps"]), frozenset(path["cuts"])),
            settings=Settings.from_tables(table["settings"]),
            method=str(table["method"]),
            renderer=table["renderer"],
        )


def read_job(folder: Path) -> Job:
    """The job of a run folder, for its workers.

    Raises
    ------
    RunFolderError
        It has none, or it is damaged.
    """
    if not (folder / JOB_FILE).exists():
        what = f"it has no {JOB_FILE}" if folder.is_dir() else "there is no such folder"
        raise RunFolderError(
            f"{folder} holds no run to work on: {what}; begin one with "
            f"`enfilade render ... --out {folder} --prepare`"
        )
    try:
        return Job.from_json(read_json(folder / JOB_FILE))
    except (KeyError, TypeError, ValueError, SettingsError, CameraPathError) as error:
        if isinstance(error, RunFolderError):
            raise
        raise RunFolderError(
            f"{folder / JOB_FILE} is damaged ({error}); run the command that made the run again"
        ) from error


def check_identity(job: Job, run: Run) -> None:
    """Refuse to work on a run with another scene, or on a host that would render otherwise.

    Raises
    ------
    RunFolderError
    """
    if job.identity() != run.identity:
        raise RunFolderError(
            f"{run.folder}: on {socket.gethostname()}, the scene, the device, the view, or the version of "
            "enfilade or of a library is not the one with which the run began; `enfilade render` says what "
            "differs"
        )


def path_identity(path: CameraPath) -> dict[str, Any]:
    """What tells one camera path from another: plain values for JSON."""
    return {
        "size": [path.width, path.height],
        "fps": path.fps,
        "frames": list(path.numbers),
        "cuts": sorted(path.numbers[i] for i in path.cuts),
        "poses": _digest(path),
    }


def _digest(path: CameraPath) -> str:
    digest = hashlib.sha256()
    for camera in path.cameras:
        digest.update(camera.world_from_camera.tobytes())
        digest.update(repr(camera.fov_deg).encode())
    return digest.hexdigest()
