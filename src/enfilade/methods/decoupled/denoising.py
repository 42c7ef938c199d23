"""Open Image Denoise on light alone, without texture: irradiance images and specular AOVs."""

from __future__ import annotations

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, image, lanes
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.decoupled.irradiance_cache import guide_of
from enfilade.methods.decoupled.wavelet import ALL, smooth
from enfilade.methods.denoise import denoise
from enfilade.records import F32, Geometry, Mask, Shading

OUTLIER = 64.0  # times the denoised value: what is brighter counts as that bright in the correction
LEVELS = 5  # of the wavelet that smooths the correction: 32 pixels to each side


def denoise_light(geometry: Geometry, color: F32, where: Mask, quality: str) -> F32:
    """Denoise light with normals as guides.

    Parameters
    ----------
    geometry
        G-buffer: of the surfaces themselves, or of those seen in them.
    color : (H, W, 3) float32
        Light without albedo.
    where : (H, W) bool
        Pixels that were sampled.
    quality
        Of the denoiser.

    Returns
    -------
    (H, W, 3) float32
    """
    white = np.repeat(where[..., None], 3, axis=2).astype(np.float32)
    normal = np.where(where[..., None], geometry.normal, np.float32(0))
    return denoise(color, white, normal, quality=quality)


def denoise_irradiance(geometry: Geometry, light: Shading, where: Mask, quality: str) -> F32:
    """Denoise irradiance, and keep its mean along surfaces; see :func:`denoise_light`.

    The denoiser loses up to 2 % of the light, most where samples are skewed. The difference from its input,
    smoothed along surfaces over a range that leaves little noise, is added to its result, as far as it
    exceeds its own standard error. Outliers are limited, so that no single path tints a surface.

    Parameters
    ----------
    geometry, where, quality
    light
        Estimates of shape (H, W), with the variance of their mean luminance.

    Returns
    -------
    (H, W, 3) float32
    """
    clean = denoise_light(geometry, light.color, where, quality)

    # Smooth the difference.
    limited = np.minimum(light.color, np.float32(OUTLIER) * clean)
    guide = guide_of(geometry, np.where(where, geometry.shape_index, np.uint32(0)))
    difference, variance = smooth(
        lanes(limited - clean), lanes(light.variance), guide, levels=LEVELS, deviations=ALL
    )

    # Add it as far as it is significant.
    squared = dr.square(dr.dot(difference, Array3f(*REC709_LUMINANCE)))
    correction = difference * squared / dr.maximum(squared + variance, 1e-20)
    corrected: F32 = clean + np.where(where[..., None], image(correction, *where.shape), np.float32(0))
    return np.maximum(corrected, np.float32(0))
