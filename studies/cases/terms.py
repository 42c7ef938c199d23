"""Extent of the case studies: frames, pixels, paths."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

__all__ = ["PIXEL_M", "TERMS", "Terms"]

PIXEL_M = 0.25 / 800.0  # pitch of the paper's screen, 640x480 on 25 cm: 28 pixels a degree from half a metre


@dataclass(frozen=True)
class Terms:
    """Extent of the case studies, the same for both scenes.

    Attributes
    ----------
    preset : str
        Of the scenes: length of their walks and fineness of their shapes.
    size : (int, int)
        Width and height of whole walkthroughs, pixels.
    spp : int
        Of whole walkthroughs.
    sweep_step : int
        Disocclusions of placements other than the paper's two are counted in every so many-th frame.
    window_size : (int, int)
        Size of the path-traced short sequences that are filtered in many ways.
    window_spp, window_reference_spp : int
        Of these sequences, and of their references.
    windows, traced_windows : int
        Number of such sequences of a scene without noise, and path traced.
    reference_spp : int
        Of the references of whole walkthroughs.
    crop : (int, int)
        Part in the middle of a frame in which the quality of whole walkthroughs is measured.
    crops : int
        Number of such frames.
    most_spp : int
        Largest spp that is tried for ART; a quarter of `reference_spp` at most.
    """

    preset: str
    size: tuple[int, int]
    spp: int
    sweep_step: int
    window_size: tuple[int, int]
    window_spp: int
    window_reference_spp: int
    windows: int
    traced_windows: int
    reference_spp: int
    crop: tuple[int, int]
    crops: int
    most_spp: int

    def to_dict(self) -> dict[str, Any]:
        """As a plain table, fit for JSON."""
        return {key: list(v) if isinstance(v, tuple) else v for key, v in asdict(self).items()}


TERMS = {
    "small": Terms(
        preset="small", size=(160, 120), spp=16, sweep_step=2,
        window_size=(160, 120), window_spp=32, window_reference_spp=512, windows=3, traced_windows=2,
        reference_spp=512, crop=(160, 120), crops=2, most_spp=128,
    ),
    "full": Terms(
        preset="full", size=(640, 480), spp=8, sweep_step=4,
        window_size=(240, 180), window_spp=24, window_reference_spp=384, windows=4, traced_windows=4,
        reference_spp=1024, crop=(256, 192), crops=4, most_spp=256,
    ),
}  # fmt: skip
