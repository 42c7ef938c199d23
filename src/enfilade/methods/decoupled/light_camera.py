"""The resolution of cached light: it is smooth, and does not need all pixels of a large frame."""

from __future__ import annotations

import math
from dataclasses import replace

from enfilade.camera.pinhole import Camera

LIGHT_PIXELS = 640 * 360  # of an irradiance image; frames of up to 2.25 times as many have one as large


def light_camera(camera: Camera) -> Camera:
    """The camera of irradiance images: the same view at a whole fraction of its size, or itself."""
    return reduced(camera, light_reduction(camera.width * camera.height))


def light_reduction(pixels: int) -> int:
    """Width and height of a frame of so many pixels over those of its irradiance images."""
    return max(round(math.sqrt(pixels / LIGHT_PIXELS)), 1)


def reduced(camera: Camera, factor: int) -> Camera:
    """A camera with width and height divided by a factor and rounded down; itself where that is 1."""
    if factor == 1:
        return camera
    return replace(camera, width=max(camera.width // factor, 1), height=max(camera.height // factor, 1))
