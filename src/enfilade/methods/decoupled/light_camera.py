"""The resolutions of cached light: it is smooth, and does not need all pixels of a large frame."""

from __future__ import annotations

import math
from dataclasses import replace

from enfilade.camera.pinhole import Camera

LIGHT_PIXELS = 640 * 360  # target number of pixels; frames of up to 2.25 times as many are not reduced
IRRADIANCE_SCALE = 2  # width and height of irradiance images over those of the light camera


def light_camera(camera: Camera) -> Camera:
    """The camera of the prepass: the same view at a whole fraction of its size, or itself.

    The height is rounded down; the width is rounded up, by the aspect: the outermost columns are in view.
    """
    factor = light_reduction(camera.width * camera.height)
    if factor == 1:
        return camera
    height = max(camera.height // factor, 1)
    return replace(camera, width=-(-camera.width * height // camera.height), height=height)


def irradiance_camera(camera: Camera) -> Camera:
    """The camera of irradiance images: contact shadows are narrower than its pixels."""
    light = light_camera(camera)
    width, height = IRRADIANCE_SCALE * light.width, IRRADIANCE_SCALE * light.height
    if (width, height) == (camera.width, camera.height):
        return camera
    return replace(camera, width=width, height=height)


def virtual_camera(camera: Camera) -> Camera:
    """The camera of virtual images, whose pixels give the hash grid's entries their width.

    Mirrors show fine details. Where the light camera has the size of the frame it is that one, else that of
    irradiance images.
    """
    light = light_camera(camera)
    return light if light is camera else irradiance_camera(camera)


def virtual_scale(camera: Camera) -> int:
    """Width of virtual images over that of the light camera: 1 or :data:`IRRADIANCE_SCALE`."""
    return virtual_camera(camera).width // light_camera(camera).width


def light_reduction(pixels: int) -> int:
    """Width and height of a frame of so many pixels over those of its light camera."""
    return max(round(math.sqrt(pixels / LIGHT_PIXELS)), 1)
