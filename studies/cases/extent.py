"""Extent of the case studies: frames, pixels, paths."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

PIXEL_M = 0.25 / 800.0  # pitch of the paper's screen, 640x480 on 25 cm: 28 pixels per degree at 0.5 m


@dataclass(frozen=True)
class Extent:
    """Extent of the case studies, the same for both scenes. Sizes are width and height in pixels."""

    preset: str  # of the scenes: length of their walks and fineness of their shapes
    size: tuple[int, int]  # of whole walkthroughs
    spp: int  # of these
    sweep_step: int  # of frames for placements other than the paper's two
    window_size: tuple[int, int]  # of path-traced short sequences
    window_spp: int  # of these
    window_reference_spp: int  # of their references
    windows: int  # number of short sequences of a scene without noise
    traced_windows: int  # ... and path traced
    reference_spp: int  # of the references of whole walkthroughs
    crop: tuple[int, int]  # central part of a frame, in which quality is measured
    crops: int  # number of such frames
    most_spp: int  # largest spp of ART; at most a quarter of `reference_spp`

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {key: list(v) if isinstance(v, tuple) else v for key, v in asdict(self).items()}


EXTENTS = {
    "small": Extent(
        preset="small", size=(160, 120), spp=16, sweep_step=2,
        window_size=(160, 120), window_spp=32, window_reference_spp=512, windows=3, traced_windows=2,
        reference_spp=512, crop=(160, 120), crops=2, most_spp=128,
    ),
    "full": Extent(
        preset="full", size=(640, 480), spp=8, sweep_step=4,
        window_size=(240, 180), window_spp=24, window_reference_spp=384, windows=4, traced_windows=4,
        reference_spp=1024, crop=(256, 192), crops=4, most_spp=256,
    ),
}  # fmt: skip
