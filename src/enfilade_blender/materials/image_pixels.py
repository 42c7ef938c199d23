# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear pixels of Blender's images, as Cycles has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from enfilade_blender.image_files import F32

RAW_SPACES = ("Non-Color", "Raw", "Linear Rec.709", "Linear")
FRAMES = ("SEQUENCE", "MOVIE")  # sources whose pixels Blender has for a node alone, which chooses the frame
ASSOCIATED = ("WEBP", "JPEG2000")  # kinds of files whose alpha Cycles takes as multiplied into colours
OPAQUE_DEPTHS = (8, 24)  # bits of a pixel without alpha


def is_missing(image: Any, user: Any = None) -> bool:
    """Whether an image has no pixels: there is none, or no file of it, or of the frame that a node shows.

    Parameters
    ----------
    image
    user
        The node's image user, which chooses the frame of a sequence.
    """
    if image is not None and image.source in FRAMES and image.filepath:
        import bpy  # tests import this module without it

        if image.source == "SEQUENCE" and user is not None:
            user.frame_current = _number(user, bpy.context.scene.frame_current)
            return not Path(image.filepath_from_user(image_user=user)).is_file()
        return not Path(bpy.path.abspath(image.filepath, library=image.library)).is_file()
    return image is None or not (image.has_data or (image.size[0] > 0 and len(image.pixels) > 0))  # loads it


def fault(image: Any) -> str:
    """Why an image has no pixels."""
    is_layered = image is not None and image.type == "MULTILAYER"
    return "has several layers, none of which is read" if is_layered else "is missing"


def _number(user: Any, frame: int) -> int:
    """Number of the file that an image user shows of a sequence, as Blender finds it."""
    place = frame - user.frame_start + 1
    if user.use_cyclic:
        place = (place - 1) % max(user.frame_duration, 1) + 1
    return min(max(place, 0), user.frame_duration) + int(user.frame_offset)


def image_colours(node: Any) -> F32:
    """Linear RGB of an image node (H, W, 3), the first row on top, as Cycles has it.

    Colours are multiplied by alpha, before they are decoded, unless the node's output Alpha is used. Blender
    keeps images of bytes without that product, and those of floats with it. Cycles takes the colours of WebP
    and JPEG 2000 files for multiplied, whatever they are.
    """
    image = node.image
    rgba = _stored_pixels(image)
    colours, alpha = rgba[..., :3], rgba[..., 3:]
    if _has_alpha(image):
        is_alone = not node.outputs["Alpha"].is_linked
        is_associated = image.is_float or _is_file_associated(image)
        if is_alone and not is_associated:
            colours = colours * alpha
        elif is_associated and not is_alone:
            colours = colours / np.where(alpha > 0.0, alpha, 1.0).astype(np.float32)
    return np.ascontiguousarray(_decoded(colours, image))


def _has_alpha(image: Any) -> bool:
    """Whether Cycles takes an image's fourth channel as alpha, and it may be below 1."""
    is_channel = image.alpha_mode in ("CHANNEL_PACKED", "NONE") or image.colorspace_settings.is_data
    return not is_channel and image.depth not in OPAQUE_DEPTHS


def _is_file_associated(image: Any) -> bool:
    """Whether Cycles takes alpha as multiplied into the colours of an image's file, for the kind of file."""
    is_file = image.source in ("FILE", "TILED") and not image.packed_files
    return is_file and image.file_format in ASSOCIATED


def is_as_stored(node: Any) -> bool:
    """Whether an image node's colours are those of the image's file."""
    image = node.image
    is_associated = image.alpha_mode == "PREMUL" or _is_file_associated(image)
    if not _has_alpha(image) or is_associated != node.outputs["Alpha"].is_linked:
        return True
    return bool(_stored_pixels(image)[..., 3].min() >= 1.0)


def linear_pixels(image: Any) -> F32:
    """Linear RGBA of a Blender image (H, W, 4), the first row on top."""
    rgba = _stored_pixels(image)
    return np.ascontiguousarray(np.concatenate([_decoded(rgba[..., :3], image), rgba[..., 3:]], axis=-1))


def _stored_pixels(image: Any) -> F32:
    """Numbers of a Blender image (H, W, 4), the first row on top."""
    width, height = image.size
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    pixels = values.reshape(height, width, image.channels)[::-1]
    if image.channels < 4:
        alpha = np.ones((height, width, 1), np.float32)
        colour = pixels if image.channels == 3 else np.repeat(pixels[..., :1], 3, axis=-1)
        pixels = np.concatenate([colour, alpha], axis=-1)
    return pixels


def _decoded(colours: F32, image: Any) -> F32:
    """Linear colours of an image's numbers."""
    is_linear = image.is_float or image.colorspace_settings.name in RAW_SPACES
    return colours if is_linear else linear_from_srgb(colours)


def linear_from_srgb(encoded: F32) -> F32:
    """IEC 61966-2-1, inverse."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(
        np.float32
    )
