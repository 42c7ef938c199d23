"""One look at every frame before anything is traced: how it moves, and what it shows (§4.2)."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from enfilade.camera.path import CameraPath, Segment
from enfilade.methods.keyframes import place_keyframes
from enfilade.methods.paper.masks import slow_pixels
from enfilade.monitor import Monitor
from enfilade.pipeline.views import Views
from enfilade.settings import Settings


@dataclass(frozen=True)
class Survey:
    """Figures of each frame of a path.

    Attributes
    ----------
    speed_px : tuple of float
        Mean flow magnitude, pixels per frame.
    speed_deg_s : tuple of float
        The same in degrees per second.
    slow_percent, specular_percent : tuple of float
        Pixels below v_t, and pixels on glossy, mirroring or transparent surfaces.
    """

    speed_px: tuple[float, ...]
    speed_deg_s: tuple[float, ...]
    slow_percent: tuple[float, ...]
    specular_percent: tuple[float, ...]

    def to_dict(self) -> dict[str, Any]:
        """As plain lists, fit for JSON."""
        return {key: list(values) for key, values in asdict(self).items()}

    @staticmethod
    def from_dict(table: dict[str, Any]) -> Survey:
        """Read back from :meth:`to_dict`."""
        return Survey(**{key: tuple(values) for key, values in table.items()})


def survey_path(views: Views, path: CameraPath, settings: Settings, monitor: Monitor) -> Survey:
    """Look at every frame."""
    monitor.stage("plan", len(path))
    diagonal = float(np.hypot(path.width, path.height))
    fastest = views.viewing.velocity_deg_s(diagonal)
    rows = []
    for frame in range(len(path)):
        view = views[frame]
        # What comes too near to the eye moves by any number of pixels: it leaves the image, no more.
        speed = np.minimum(view.flow.speed, diagonal)
        rows.append(
            (
                float(speed.mean()),
                float(np.minimum(view.speed_deg_s, fastest).mean()),
                100.0 * float(slow_pixels(view.speed_deg_s, settings.masks).mean()),
                100.0 * float(view.geometry.is_specular.mean()),
            )
        )
        monitor.advance()
    return Survey(*zip(*rows, strict=True))


def initial_segments(path: CameraPath, survey: Survey, settings: Settings) -> list[list[Segment]]:
    """Segments between the initial keyframes of each shot (§4.2).

    A frame that repeats the view of the one before is no keyframe: it is a copy.

    Returns
    -------
    list of list of Segment
        One list a shot; a shot of one view has a single segment from that frame to itself.
    """
    shots = []
    for shot in path.shots():
        speed = np.array([survey.speed_px[frame] for frame in shot])
        chosen = place_keyframes(speed, settings.keyframes)
        keyframes = sorted({path.static_frame(shot.start + k) for k in chosen})
        pairs = itertools.pairwise(keyframes)
        shots.append([Segment(a, b) for a, b in pairs] or [Segment(keyframes[0], keyframes[0])])
    return shots
