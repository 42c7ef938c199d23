"""How large the case studies are: frames, pixels, paths."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

__all__ = ["PIXEL_M", "TERMS", "Terms"]

PIXEL_M = 0.25 / 800.0  # pitch of the paper's screen, 640x480 on 25 cm: 28 pixels a degree from half a metre


@dataclass(frozen=True)
class Terms:
    """What is rendered for the case studies, the same for both scenes.

    Attributes
    ----------
    preset : str
        Of the scenes: how long their walks are, and how fine their shapes.
    size : (int, int)
        Width and height of whole walkthroughs, pixels.
    spp : int
        Paths of a pixel of whole walkthroughs.
    sweep_step : int
        Holes of placements other than the paper's two are counted in every so many-th frame.
    window_size : (int, int)
        Size of the short sequences that are filtered in many ways.
    window_spp : int
        Their paths a pixel.
    window_reference_spp : int
        Paths a pixel of what is taken for the truth of them.
    windows, traced_windows : int
        How many such sequences a scene has without noise, and path traced.
    reference_spp : int
        Paths a pixel of what is taken for the truth of whole walkthroughs.
    crop : (int, int)
        Part of a frame, in its middle, in which the quality of whole walkthroughs is judged.
    crops : int
        In how many frames.
    most_spp : int
        Paths a pixel up to which ART is sought; a quarter of those of the reference at most.
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
        preset="small",
        size=(160, 120),
        spp=16,
        sweep_step=2,
        window_size=(160, 120),
        window_spp=32,
        window_reference_spp=512,
        windows=3,
        traced_windows=2,
        reference_spp=512,
        crop=(160, 120),
        crops=2,
        most_spp=128,
    ),
    "full": Terms(
        preset="full",
        size=(640, 480),
        spp=8,
        sweep_step=4,
        window_size=(240, 180),
        window_spp=24,
        window_reference_spp=384,
        windows=4,
        traced_windows=4,
        reference_spp=1024,
        crop=(256, 192),
        crops=4,
        most_spp=256,
    ),
}
