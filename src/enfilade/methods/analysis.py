"""Statistics of every frame before anything is traced: velocities and surfaces (§4.2)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from enfilade.camera.frames import ranges
from enfilade.camera.path import CameraPath, Segment
from enfilade.methods.keyframes import place_keyframes
from enfilade.methods.walkthrough import Walkthrough
from enfilade.settings import KeyframeSettings, MaskSettings, Settings

SPACING = 25  # Delta, frames (§4.2)


@dataclass(frozen=True)
class FrameStatistics:
    """Statistics of one frame.

    Attributes
    ----------
    speed_px : float
        Mean length of the motion vectors, pixels per frame.
    speed_deg_s : float
        The same in degrees per second, under the viewing conditions that the method reads; the paper's by
        default.
    slow_percent : float
        Pixels slower than v_t (``[masks] slow_deg_s``).
    specular_percent : float
        Pixels that show glossy, mirroring or transparent surfaces.
    is_empty : bool
        Whether no pixel shows a surface, and the scene has no background: the frame is black.
    """

    speed_px: float
    speed_deg_s: float
    slow_percent: float
    specular_percent: float
    is_empty: bool = False


def analyze(walk: Walkthrough, frame: int) -> FrameStatistics:
    """Statistics of a frame, from its G-buffer and motion vectors."""
    view = walk.view(frame)
    # Limit motion to the diagonal: points close to the eye may move by any number of pixels.
    diagonal = float(np.hypot(walk.path.width, walk.path.height))
    fastest = walk.viewing.velocity_deg_s(diagonal)
    slow_deg_s = walk.settings[MaskSettings].slow_deg_s
    return FrameStatistics(
        speed_px=float(np.minimum(view.flow.speed, diagonal).mean()),
        speed_deg_s=float(np.minimum(view.speed_deg_s, fastest).mean()),
        slow_percent=100.0 * float((view.speed_deg_s < slow_deg_s).mean()),
        specular_percent=100.0 * float(view.geometry.is_specular.mean()),
        is_empty=not (view.geometry.is_hit.any() or walk.renderer.describe().has_background),
    )


@dataclass(frozen=True, eq=False)
class Analysis:
    """Statistics of all frames of a path.

    Attributes
    ----------
    path : CameraPath
    settings : Settings
    frames : tuple of FrameStatistics
    """

    path: CameraPath
    settings: Settings
    frames: tuple[FrameStatistics, ...]
    _segments: dict[tuple[int, bool], list[list[Segment]]] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def from_tables(cls, path: CameraPath, settings: Settings, tables: Iterable[Mapping[str, Any]]) -> Self:
        """Build from the statistics of every frame as tables, as the ledger has them."""
        return cls(path, settings, tuple(FrameStatistics(**table) for table in tables))

    @property
    def warning(self) -> str:
        """A message on frames that show nothing; empty where there are none."""
        numbers = [n for n, of in zip(self.path.numbers, self.frames, strict=True) if of.is_empty]
        if not numbers:
            return ""
        return (
            f"frames {ranges(numbers)} show no surface, and the scene has no environment emitter: they are "
            "black; check the camera path against the scene: units, axes, the side to which the camera looks"
        )

    def segments(self, spacing: int = SPACING, *, spreads_rest: bool = False) -> list[list[Segment]]:
        """Segments between the initial keyframes of each shot (§4.2).

        A repeated pose is never a keyframe.

        Parameters
        ----------
        spacing
            Of the method, where ``[keyframes] spacing`` is 0; by default the paper's.
        spreads_rest
            As of :func:`place_keyframes`.

        Returns
        -------
        list of list of Segment
            One list a shot; a shot of one pose has a single segment from that frame to itself.
        """
        key = spacing, spreads_rest
        if key not in self._segments:
            self._segments[key] = self._placed(spacing, spreads_rest=spreads_rest)
        return self._segments[key]

    def _placed(self, spacing: int, *, spreads_rest: bool) -> list[list[Segment]]:
        settings = self.settings[KeyframeSettings]
        settings = replace(settings, spacing=settings.spacing or spacing)
        shots = []
        for shot in self.path.shots():
            speed = np.array([self.frames[frame].speed_px for frame in shot])
            chosen = place_keyframes(speed, settings, spreads_rest=spreads_rest)
            keyframes = sorted({self.path.static_frame(shot.start + k) for k in chosen})
            pairs = itertools.pairwise(keyframes)
            shots.append([Segment(a, b) for a, b in pairs] or [Segment(keyframes[0], keyframes[0])])
        return shots


def keyframes_of(segments: Sequence[Segment]) -> list[int]:
    """Keyframes at the ends of segments, in order."""
    return sorted({s.first for s in segments} | {s.last for s in segments})
