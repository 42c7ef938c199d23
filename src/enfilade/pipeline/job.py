"""What is to be rendered, and by whom."""

from __future__ import annotations

import hashlib
import importlib.metadata
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
from enfilade.renderer import Renderer
from enfilade.settings import Settings, TraceSettings
from enfilade.store import Run
from enfilade.viewing import Viewing

ANALYTIC_SUFFIX = ".analytic.json"
JOB_FILE = "job.json"  # in a run folder: what its workers read


@dataclass(frozen=True, eq=False)
class Job:
    """A walkthrough to render.

    Attributes
    ----------
    scene : Path
        A Mitsuba scene, or planes and spheres in closed form (``.analytic.json``).
    path : CameraPath
    settings : Settings
    method : {"decoupled", "paper", "reference"}
    """

    scene: Path
    path: CameraPath
    settings: Settings
    method: str

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
        name, fingerprint = _renderer_and_fingerprint(self.scene)
        shapes = {} if renderer is None else {"shapes": len(renderer.describe().shapes)}
        settings = self.settings.to_tables()
        del settings["trace"]["chunk"]
        del settings["limits"]
        view = view_identity(self.settings.video)
        ocio = {"opencolorio": view["opencolorio"]} if view else {}
        return {
            "method": self.method,
            "scene": {"fingerprint": fingerprint, **shapes},
            "path": path_identity(self.path),
            "settings": settings,
            **({"view": {"processor": view["processor"]}} if view else {}),
            "versions": {
                **makers(),
                "renderer": name,
                "variant": _variant(self.scene),
                **({"denoiser": denoiser_name()} if self._denoises else {}),
                **ocio,
            },
        }

    @property
    def _denoises(self) -> bool:
        return self.method == "decoupled" and self.settings.light.denoiser != "none"

    def check_scene(self, *, is_tried: bool = False) -> None:
        """Refuse a scene that reaches for what is not its own, or for too much, before it is loaded.

        Parameters
        ----------
        is_tried
            Let a process of its own load it, too.

        Raises
        ------
        SceneError
        SettingsError
            The method asks more of the scene than it has, or the settings more than is installed.
        """
        if self._denoises and (why := why_no_denoiser()):
            raise SettingsError(why)
        if self.scene.name.endswith(ANALYTIC_SUFFIX):
            if self.method == "decoupled":
                raise SettingsError(
                    f"{self.scene} has surfaces but no light to ask for: --method decoupled needs a "
                    "Mitsuba scene; add --method paper"
                )
            return  # its files are its own, and it has no plugins
        from enfilade.scene.scenecheck import check_scene
        from enfilade.scene.trial import try_scene

        check_scene(self.scene, self.settings.limits)
        if is_tried:
            self.check_light(
                try_scene(self.scene, self.settings.trace, self.settings.limits, active().variant)
            )

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

    def check_light(self, why_inseparable: str) -> None:
        """Refuse a scene that can't be asked for light, where the method asks for it.

        Parameters
        ----------
        why_inseparable
            What :meth:`enfilade.renderer.LobeRenderer.why_inseparable` says of the scene.

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


def open_renderer(scene: Path, settings: TraceSettings) -> Renderer:
    """Load a scene into the backend that its name asks for.

    Raises
    ------
    SceneError
        The scene is missing or malformed.
    DeviceError
        No usable LLVM or CUDA.
    """
    if scene.name.endswith(ANALYTIC_SUFFIX):
        from enfilade.scene.analytic import load

        return load(scene, chunk=settings.chunk)
    from enfilade.scene.mitsuba import MitsubaRenderer

    return MitsubaRenderer(scene, settings)


def _renderer_and_fingerprint(scene: Path) -> tuple[str, str]:
    """Name of the renderer, and what the scene's files hold, without loading either."""
    if scene.name.endswith(ANALYTIC_SUFFIX):
        from enfilade.scene.analytic_scene import NAME, read_scene, scene_text

        return NAME, hashlib.sha256(scene_text(read_scene(scene)).encode()).hexdigest()
    from enfilade.scene.scenefile import fingerprint

    return f"Mitsuba {importlib.metadata.version('mitsuba')}", fingerprint(scene)


def _variant(scene: Path) -> str:
    device = active()
    return device.backend if scene.name.endswith(ANALYTIC_SUFFIX) else device.variant


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
