"""The resolutions of cached light: it is smooth, and does not need all pixels of a large frame."""

from __future__ import annotations

import math
from dataclasses import replace

from enfilade.camera.pinhole import Camera

IRRADIANCE_PIXELS = 1280 * 720  # of an irradiance image; frames of fewer than 2.25 times as many have one as large
HASH_GRID_PIXELS = 640 * 360  # from which paths fill the hash grid; the prepass has a quarter


def irradiance_camera(camera: Camera) -> Camera:
    """The camera of irradiance images: the same view at a whole fraction of its size, or itself."""
    return reduced(camera, irradiance_reduction(camera.width * camera.height))


def hash_grid_camera(camera: Camera) -> Camera:
    """The camera of paths that fill the hash grid, likewise. Its pixels give entries their width."""
    return reduced(camera, hash_grid_reduction(camera.width * camera.height))


def irradiance_reduction(pixels: int) -> int:
    """Width and height of a frame of so many pixels over those of its irradiance images."""
    return max(round(math.sqrt(pixels / IRRADIANCE_PIXELS)), 1)


def hash_grid_reduction(pixels: int) -> int:
    """The same, over those of the hash grid's camera."""
    return max(round(math.sqrt(pixels / HASH_GRID_PIXELS)), 1)


def reduced(camera: Camera, factor: int) -> Camera:
    """A camera with width and height divided by a factor and rounded down; itself where that is 1."""
    if factor == 1:
        return camera
    return replace(camera, width=max(camera.width // factor, 1), height=max(camera.height // factor, 1))
