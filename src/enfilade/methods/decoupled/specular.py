"""The specular filter: AOVs smoothed along visible surfaces, and accumulated over time along their own motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, halves, image, lanes, opaque, vector3, widened
from enfilade.kernels.estimate import GAUSSIAN_SIGMA_PX, LUMINANCE
from enfilade.methods.decoupled.irradiance_cache import (
    MIN_WEIGHT,
    PLANE_TOLERANCE,
    points_of,
    smooth_along,
    upload_layers,
)
from enfilade.methods.decoupled.lookup import UploadedImage, lookup
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE
from enfilade.methods.decoupled.wavelet import firefly_weights, soften_edges
from enfilade.records import F32, Geometry, Mask, Shading

NOISE_SHARE = 0.5  # of the spread of samples: low-discrepancy samples are less noisy than their spread
FIREFLY = 2.0  # times the brightest neighbour: brighter pixels are fireflies
MAX_DIFFERENCE = 3.0  # standard deviations, at which the weight of another frame falls to 1/e


def filter_spatially(virtual: Sequence[Geometry], aovs: Sequence[Shading], where: Mask) -> list[SpecularAov]:
    """Smooth specular AOVs along the surfaces that are seen in them, as far as their noise requires.

    Parameters
    ----------
    virtual
        G-buffers of the frame with the virtual images of each AOV.
    aovs
        Of shape (H, W).
    where : (H, W) bool
        Pixels that were sampled. Other pixels of the same shapes do not contribute.

    Returns
    -------
    list of SpecularAov
    """
    height, width = where.shape
    # Find fireflies in the sum: in a single AOV that few rays hit, each of them would be one.
    total = sum((lanes(aov.color) for aov in aovs), Array3f(0))
    weights = firefly_weights(total, width=width, height=height, times=FIREFLY)
    return [_filtered(g, aov, where, weights) for g, aov in zip(virtual, aovs, strict=True)]


def _filtered(geometry: Geometry, aov: Shading, where: Mask, weights: Any) -> SpecularAov:
    # The normals of virtual images are not those of the planes that they appear to lie in: ignore their
    # depths.
    is_real = geometry.shape_index < IN_VIRTUAL_IMAGE
    geometry = replace(geometry, depth=np.where(is_real, geometry.depth, np.float32(0)))
    noise = NOISE_SHARE * lanes(aov.variance)
    groups = np.where(where, geometry.shape_index, np.uint32(0))
    light, variance = smooth_along(geometry, groups, weights * lanes(aov.color), noise)
    height, width = aov.variance.shape
    light = soften_edges(
        light, lanes(geometry.shape_index), width=width, height=height, sigma=GAUSSIAN_SIGMA_PX
    )
    deviation = np.sqrt(image(variance, height, width))
    return SpecularAov(halves(image(light, height, width)), halves(deviation))


def upload_aov(geometry: Geometry, aov: SpecularAov, where: Mask) -> UploadedImage:
    """A filtered AOV on the device.

    Parameters
    ----------
    geometry
        G-buffer of the frame with the AOV's virtual images.
    aov
    where : (H, W) bool
        Pixels that have it.
    """
    layers = [(lanes(widened(aov.color)), lanes(np.square(widened(aov.deviation))))]
    return upload_layers(geometry, lanes(where), layers, has_normals=False)


def accumulate_temporally(
    geometry: Geometry, here: UploadedImage, others: Sequence[tuple[UploadedImage, float]]
) -> F32:
    """Average an AOV with that of neighbouring frames, reprojected along its own motion.

    Virtual images are reprojected where they appear to be. Values that differ from the frame's own by more
    than its noise weigh less, so that highlights and rough reflections stay where they are.

    Parameters
    ----------
    geometry
        G-buffer of the frame, for its camera and normals.
    here
        The AOV of the frame.
    others
        The same AOV of other frames with their weights; that of the frame is one.

    Returns
    -------
    (H, W, 3) float32
        0 where the frame has none.
    """
    (color,), (variance,) = here.values, here.variances
    position = points_of(geometry, here.depths)
    # Virtual images face the eye.
    is_real = here.shape_indices < IN_VIRTUAL_IMAGE
    normal = dr.select(is_real, lanes(geometry.normal), vector3(geometry.camera.eye) - position)
    total, weight = Array3f(color), dr.ones(Float, dr.width(color))
    luminance = dr.dot(color, Array3f(*LUMINANCE))
    dr.eval(position, normal, total, weight, luminance)
    for other, share in others:
        # Reproject.
        found = lookup(position, normal, here.shape_indices, other, plane_tolerance=PLANE_TOLERANCE)
        scale = dr.rcp(dr.maximum(found.weight, 1e-6))
        value, noise = found.totals[0] * scale, found.variances[0] * scale

        # Weight by the difference, in units of the noise.
        difference = dr.abs(dr.dot(value, Array3f(*LUMINANCE)) - luminance)
        counts = dr.exp(-difference * dr.rcp(MAX_DIFFERENCE * dr.sqrt(noise + variance) + 1e-8))
        counts = dr.select(found.weight > MIN_WEIGHT, opaque(share) * counts, 0.0)

        # Accumulate.
        total += counts * value
        weight += counts
        dr.eval(total, weight)  # so that one kernel serves any number of frames
    return image(total / weight, here.height, here.width)
