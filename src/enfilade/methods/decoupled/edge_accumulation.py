"""Temporal accumulation of refined pixels, as they are displayed.

Refined pixels show several surfaces, often one a hundred times brighter than another: an average of radiance
would be that of the brightest. On the display all that is white has the same value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import drjit as dr
import numpy as np

from enfilade.arrays import image, lanes, to_float, to_half
from enfilade.kernels.tone import luminance
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.specular import accumulate_temporally, upload_aov
from enfilade.methods.decoupled.surface_image import UploadedImage
from enfilade.records import F32, Geometry, Mask, SurfaceClass

# Of the samples' deviation: rays are stratified, and textures have less noise than their contrast tells. With
# the whole deviation pictures on a wall are blurred; half of it keeps nine tenths of the gain at metal edges.
NOISE_SHARE = 0.5


def upload_displayed(
    virtual: Sequence[Geometry], color: F32, deviation: F32, *, exposure_ev: float
) -> UploadedImage:
    """Upload a frame as it is displayed, at the virtual images that its mirrors and panes show.

    Parameters
    ----------
    virtual
        G-buffers of the frame with the virtual images of reflection, and of transmission.
    color : (H, W, 3) float32
        Linear radiance.
    deviation : (H, W) float32
        Standard deviation of the luminance.
    exposure_ev
        In stops.
    """
    reflected, transmitted = virtual
    is_pane = reflected.surface == SurfaceClass.TRANSPARENT
    shown = replace(
        reflected,
        depth=np.where(is_pane, transmitted.depth, reflected.depth),
        shape_index=np.where(is_pane, transmitted.shape_index, reflected.shape_index),
    )
    displayed = _displayed(color, deviation, exposure_ev)
    return upload_aov(shown, displayed, np.ones(deviation.shape, np.bool_))


def redisplayed(
    image: UploadedImage, color: F32, deviation: F32, where: Mask, *, exposure_ev: float
) -> UploadedImage:
    """An image of :func:`upload_displayed` with other colours, in some pixels only, (H, W)."""
    shown = _displayed(color, deviation, exposure_ev)
    depths = dr.select(lanes(where), image.depths, 0.0)
    value, variance = lanes(shown.color), lanes(np.square(to_float(shown.deviation)))
    dr.eval(depths, value, variance)
    return replace(image, depths=depths, values=(value,), variances=(variance,))


def _displayed(color: F32, deviation: F32, exposure_ev: float) -> SpecularAov:
    """Colours after exposure, 0..1, and their deviation.

    Above white there is no noise: bright pixels beside a dark line are not averaged with it.
    """
    scale = np.float32(2.0**exposure_ev)
    mean, error = luminance(color) * scale, deviation * scale
    low, high = (np.clip(value, 0.0, 1.0) for value in (mean - error, mean + error))
    noise = np.float32(0.5 * NOISE_SHARE) * (high - low)
    return SpecularAov(to_half(np.clip(color * scale, 0.0, 1.0)), to_half(noise))


def accumulate_refined(
    geometry: Geometry,
    color: F32,
    here: UploadedImage,
    others: Sequence[tuple[UploadedImage, float]],
    *,
    exposure_ev: float,
) -> F32:
    """Average the refined pixels of a frame with neighbouring frames.

    Radiance above white stays: the sum of the frames' light is kept.

    Parameters
    ----------
    geometry
        G-buffer of the frame.
    color : (H, W, 3) float32
        Linear radiance of the frame.
    here, others
        Of :func:`upload_displayed`: the refined pixels of the frame, and whole frames with weights relative
        to its own.
    exposure_ev
        In stops.

    Returns
    -------
    (H, W, 3) float32
        Linear radiance; pixels that are not refined stay.
    """
    change: F32 = accumulate_temporally(geometry, here, others) - image(here.values[0], *color.shape[:2])
    return color + change * np.float32(2.0**-exposure_ev)
