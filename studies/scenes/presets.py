"""Presets of the generated scenes: frames, pixels, and detail of shapes and textures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Preset:
    """Size and detail of a scene.

    Attributes
    ----------
    name
        `full` or `small`.
    size
        Width and height of the frames, pixels.
    segments
        Sides of a round object of the size of a chair leg; larger objects have a multiple.
    texture
        Side of the large textures, pixels.
    """

    name: str
    size: tuple[int, int]
    segments: int
    texture: int

    @property
    def is_small(self) -> bool:
        """Whether the walk is the short one."""
        return self.name == "small"


PRESETS = {
    "full": Preset("full", (640, 480), segments=20, texture=1024),
    "small": Preset("small", (320, 240), segments=8, texture=256),
}
