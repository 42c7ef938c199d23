"""What is to be rendered, and by whom."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from enfilade import __version__
from enfilade.records import CameraPath
from enfilade.renderer import Renderer
from enfilade.settings import Settings, TraceSettings
from enfilade.viewing import Viewing

ANALYTIC_SUFFIX = ".analytic.json"


@dataclass(frozen=True, eq=False)
class Job:
    """A walkthrough to render.

    Attributes
    ----------
    scene : Path
        A Mitsuba scene, or planes and spheres in closed form (``.analytic.json``).
    path : CameraPath
    settings : Settings
    method : {"reference", "paper"}
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

    def identity(self, renderer: Renderer) -> dict[str, Any]:
        """What makes the results what they are: a run folder holds one such identity.

        The number of paths in flight is left out: it changes no result.
        """
        facts = renderer.describe()
        settings = self.settings.to_tables()
        del settings["trace"]["chunk"]
        return {
            "method": self.method,
            "scene": {"fingerprint": facts.fingerprint, "items": len(facts.items)},
            "path": {
                "size": [self.path.width, self.path.height],
                "fps": self.path.fps,
                "frames": list(self.path.numbers),
                "cuts": sorted(self.path.numbers[i] for i in self.path.cuts),
                "poses": _digest(self.path),
            },
            "settings": settings,
            "versions": {
                "enfilade": __version__,
                "renderer": facts.renderer,
                "variant": facts.variant,
            },
        }


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
        from enfilade.backends.analytic import load

        return load(scene, chunk=settings.chunk)
    from enfilade.backends.mitsuba3 import MitsubaRenderer

    return MitsubaRenderer(scene, settings)


def _digest(path: CameraPath) -> str:
    digest = hashlib.sha256()
    for camera in path.cameras:
        digest.update(camera.world_from_camera.tobytes())
        digest.update(repr(camera.fov_deg).encode())
    return digest.hexdigest()
