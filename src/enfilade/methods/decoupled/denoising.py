"""Open Image Denoise on light alone, without texture: irradiance images and specular AOVs."""

from __future__ import annotations

import drjit as dr
import numpy as np
import scipy.ndimage

from enfilade.arrays import Array3f, image, lanes
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.decoupled.irradiance_cache import guide_of
from enfilade.methods.decoupled.wavelet import smooth
from enfilade.methods.denoise import denoise
from enfilade.records import F32, Geometry, Mask, Shading

MARGIN = 8  # pixels around those with light, which are denoised with them
LEVELS = 5  # of the wavelet that smooths the correction: 32 pixels to each side


def denoise_light(geometry: Geometry, light: Shading, where: Mask, *, quality: str, outlier: float) -> F32:
    """Denoise light with normals as guides, and keep its mean along surfaces.

    The denoiser loses some percent of the light where samples are skewed, and adds a third to regions two
    pixels wide. The difference from its input, smoothed along surfaces over a range that leaves little noise,
    is added to its result, as far as it exceeds its own standard error. Outliers are limited, so that no
    single path tints a surface. The denoiser takes no negative light: specular lobes that are a difference
    have it, and it is denoised apart.

    Parameters
    ----------
    geometry
        G-buffer: of the surfaces themselves, or of those seen in them.
    light
        Estimates of shape (H, W) without albedo, with the variance of their mean luminance.
    where : (H, W) bool
        Pixels that were sampled.
    quality
        Of the denoiser.
    outlier
        Limit of the input of the correction, in units of the denoised value.

    Returns
    -------
    (H, W, 3) float32
    """
    # Denoise the part of the image that has light.
    white = np.repeat(where[..., None], 3, axis=2).astype(np.float32)
    normal = np.where(where[..., None], geometry.normal, np.float32(0))
    above, below = np.zeros_like(light.color), np.zeros_like(light.color)
    for sign, clean in ((1, above), (-1, below)):
        signed = np.maximum(sign * light.color, np.float32(0))
        for part in _bounding_box(np.any(signed, axis=2)):
            clean[part] = denoise(signed[part], white[part], normal[part], quality=quality)

    # Smooth the difference.
    clean, lowest = above - below, -np.float32(outlier) * below
    limited = np.clip(light.color, lowest, np.float32(outlier) * above)
    guide = guide_of(geometry, np.where(where, geometry.shape_index, np.uint32(0)))
    difference, variance = smooth(
        lanes(limited - clean), lanes(light.variance), guide, levels=LEVELS, deviations=None
    )

    # Add it as far as it is significant.
    squared = dr.square(dr.dot(difference, Array3f(*REC709_LUMINANCE)))
    correction = difference * squared / dr.maximum(squared + variance, 1e-20)
    corrected = clean + np.where(where[..., None], image(correction, *where.shape), np.float32(0))
    bounded: F32 = np.maximum(corrected, lowest)
    return bounded


def _bounding_box(mask: Mask) -> list[tuple[slice, slice]]:
    """The smallest rectangle around a mask and its margin; none if it is empty."""
    return [
        (
            slice(max(rows.start - MARGIN, 0), rows.stop + MARGIN),
            slice(max(columns.start - MARGIN, 0), columns.stop + MARGIN),
        )
        for rows, columns in scipy.ndimage.find_objects(mask.astype(np.int8))
    ]
