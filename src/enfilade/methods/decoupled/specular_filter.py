"""The spatial filter of specular AOVs: denoised, or smoothed along the surfaces that are seen in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
import scipy.ndimage

from enfilade.arrays import Array3f, Array3f16, Float, image, lanes
from enfilade.methods.decoupled.denoising import denoise_light
from enfilade.methods.decoupled.edges import dilated
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.surface_image import UploadedImage, upload_layers
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE
from enfilade.methods.decoupled.wavelet import firefly_weights, smooth_along
from enfilade.records import Geometry, Mask, Shading

DENOISER = "fast"  # quality: what it leaves is averaged over frames
NOISE_SHARE = 0.5  # of the samples' variance: low-discrepancy samples have less noise than it tells
OUTLIER = 8.0  # times the denoised value: brighter estimates are limited where the mean is kept
DENOISED_SHARE = 0.25  # of the samples' deviation that the denoiser leaves
DENOISED_SUPPORT = 5  # pixels, over which that deviation is averaged


def filter_spatially(
    virtual: Sequence[Geometry], aovs: Sequence[Shading], where: Mask, *, is_denoised: bool, unit: float
) -> list[SpecularAov]:
    """Denoise specular AOVs, or smooth them along the surfaces that are seen in them by the wavelet filter.

    Parameters
    ----------
    virtual
        G-buffers of the frame with the virtual images of each AOV.
    aovs
        Of shape (H, W).
    where : (H, W) bool
        Pixels that were sampled; others do not contribute.
    is_denoised
        Whether to use the denoiser.
    unit
        Radiance that is stored as 1.

    Returns
    -------
    list of SpecularAov
    """
    # Ignore the depths of virtual images: their normals are not those of the planes that they appear to form.
    surfaces = [
        replace(g, depth=np.where(g.shape_index < IN_VIRTUAL_IMAGE, g.depth, np.float32(0))) for g in virtual
    ]
    if is_denoised:
        # Pixels beside specular surfaces are sampled, too, and so are those beside panes, which alone have
        # the second AOV: the denoiser would see dark lines.
        is_specular = virtual[0].is_specular
        in_panes = [g.shape_index >= IN_VIRTUAL_IMAGE for g in virtual[1:]]
        shown = [is_specular | ~dilated(is_specular), *in_panes]
        return [
            _denoised(g, aov, where & is_shown, unit)
            for g, aov, is_shown in zip(surfaces, aovs, shown, strict=True)
        ]
    height, width = where.shape
    # Find fireflies in the sum: where few rays sample an AOV, each of its samples would be one.
    total = sum((lanes(aov.color) for aov in aovs), Array3f(0))
    weights = firefly_weights(total, width=width, height=height)
    return [_filtered(g, aov, where, weights, unit) for g, aov in zip(surfaces, aovs, strict=True)]


def with_edges(aov: SpecularAov, edges: Shading, where: Mask, *, unit: float) -> SpecularAov:
    """An AOV with other values at its edges, without deviation: other frames that differ count little there.

    Parameters
    ----------
    aov
    edges
        Of shape (H, W).
    where : (H, W) bool
    unit
        Radiance that is stored as 1.
    """
    certain = SpecularAov.of(edges.color, np.zeros_like(edges.variance), unit)
    color = np.where(where[..., None], certain.color, aov.color)
    return SpecularAov(color, np.where(where, certain.deviation, aov.deviation))


def upload_aovs(geometry: Geometry, aovs: Sequence[SpecularAov], count: int, where: Mask) -> UploadedImage:
    """Upload filtered AOVs for lookups at the surfaces that have them, not at their virtual images.

    Parameters
    ----------
    geometry
        G-buffer of the frame.
    aovs
    count
        Number of layers; those beyond the AOVs are black, so that one kernel serves all frames.
    where : (H, W) bool
        Pixels that are looked up.
    """
    layers = [(lanes(aov.color), Float(0)) for aov in aovs]
    black = (dr.zeros(Array3f16, where.size), Float(0))
    return upload_layers(geometry, lanes(where), [*layers, *[black] * (count - len(layers))])


def _denoised(geometry: Geometry, aov: Shading, is_shown: Mask, unit: float) -> SpecularAov:
    """Denoise an AOV, guided by the surfaces that are seen in it; other pixels keep their samples."""
    color = denoise_light(geometry, aov, is_shown, quality=DENOISER, outlier=OUTLIER, is_mirrored=False)
    # Average the deviation over the denoised pixels.
    sampled = np.sqrt(aov.variance)
    deviation, share = (
        scipy.ndimage.uniform_filter(of, DENOISED_SUPPORT)
        for of in (sampled * is_shown, is_shown.astype(np.float32))
    )
    deviation *= DENOISED_SHARE / np.maximum(share, 1.0 / DENOISED_SUPPORT**2)
    return SpecularAov.of(
        np.where(is_shown[..., None], color, aov.color), np.where(is_shown, deviation, sampled), unit
    )


def _filtered(geometry: Geometry, aov: Shading, where: Mask, weights: Any, unit: float) -> SpecularAov:
    """Clamp the fireflies of an AOV by their weights, and smooth it along surfaces."""
    noise = NOISE_SHARE * lanes(aov.variance)
    color, variance = smooth_along(geometry, where, weights * lanes(aov.color), noise)
    deviation = np.sqrt(image(variance, *where.shape))
    return SpecularAov.of(image(color, *where.shape), deviation, unit)
