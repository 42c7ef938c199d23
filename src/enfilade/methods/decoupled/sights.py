"""What lobes scatter, smoothed along what is seen and averaged over time along its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, image, lanes, opaque, vector3
from enfilade.kernels.estimate import GAUSSIAN_SIGMA_PX, LUMINANCE
from enfilade.kernels.lookup import Page, lookup
from enfilade.kernels.wavelet import share_without_speckles, with_soft_edges
from enfilade.methods.decoupled.page import KNOWN, PLANE_TOLERANCE, page_of, points_of, smooth_along
from enfilade.methods.decoupled.virtual import BEHIND
from enfilade.records import F32, Geometry, Mask, Shading

__all__ = ["open_scattered", "over_time", "smoothed"]

EVEN = 0.5  # of the spread of rays that share out their directions evenly counts as noise
SPECKLE = 2.0  # times the brightest of its neighbours that a pixel may be
APART = 3.0  # deviations by which frames may differ that are averaged


def smoothed(shown: Sequence[Geometry], scattered: Sequence[Shading], where: Mask) -> list[Shading]:
    """Smooth what surfaces scatter, along what is seen, as far as the noise asks for.

    Parameters
    ----------
    shown
        The frame, with the virtual images of each layer (``VirtualImages``).
    scattered
        Layers, (H, W).
    where : (H, W) bool
        Pixels that were asked. Others of the same shapes have nothing to tell them.

    Returns
    -------
    list of Shading
        Layers, with the noise that is left.
    """
    height, width = where.shape
    # Of all layers together: one alone may be hit by so few rays that each of them would pass for a speckle.
    whole = sum((lanes(layer.color) for layer in scattered), Array3f(0))
    share = share_without_speckles(whole, width=width, height=height, times=SPECKLE)
    return [_smoothed(g, layer, where, share) for g, layer in zip(shown, scattered, strict=True)]


def _smoothed(geometry: Geometry, shading: Shading, where: Mask, share: Any) -> Shading:
    # Virtual images: their normals are not those of the planes in which they seem to lie.
    geometry = replace(geometry, depth=np.where(geometry.shape_index < BEHIND, geometry.depth, np.float32(0)))
    noise = EVEN * lanes(shading.variance)
    groups = np.where(where, geometry.shape_index, np.uint32(0))
    light, variance = smooth_along(geometry, groups, share * lanes(shading.color), noise)
    size = shading.variance.shape
    light = with_soft_edges(
        light, lanes(geometry.shape_index), width=size[1], height=size[0], sigma=GAUSSIAN_SIGMA_PX
    )
    return Shading(image(light, *size), image(variance, *size), shading.dropped)


def open_scattered(geometry: Geometry, scattered: Shading, where: Mask) -> Page:
    """Make a layer of what lobes scatter ready for :func:`over_time`.

    Parameters
    ----------
    geometry
        Of the frame, with the layer's virtual images.
    scattered
        Smoothed, with the noise that is left, (H, W).
    where : (H, W) bool
        Pixels that have it.
    """
    layers = [(lanes(scattered.color), lanes(scattered.variance))]
    return page_of(geometry, lanes(where), layers, has_normals=False)


def over_time(geometry: Geometry, here: Page, others: Sequence[tuple[Page, float]]) -> F32:
    """Average what surfaces scatter with what frames around saw of it, each along its own motion.

    A virtual image is looked up where it seemed to be. What differs from the frame's own value by more than
    its noise counts less: highlights and reflections in rough surfaces stay where they are.

    Parameters
    ----------
    geometry
        Of the frame itself, of which the camera and the normals are taken.
    here
        A layer of the frame.
    others
        The same layer of frames around it, and how much each counts; the frame itself counts one.

    Returns
    -------
    (H, W, 3) float32
        0 where the frame has none.
    """
    (color,), (variance,) = here.values, here.variances
    position = points_of(geometry, here.depths)
    # Virtual images face the eye.
    normal = dr.select(
        here.shape_indices < BEHIND, lanes(geometry.normal), vector3(geometry.camera.eye) - position
    )
    total, weight = Array3f(color), dr.ones(Float, dr.width(color))
    luminance = dr.dot(color, Array3f(*LUMINANCE))
    dr.eval(position, normal, total, weight, luminance)
    for other, share in others:
        found = lookup(position, normal, here.shape_indices, other, plane_tolerance=PLANE_TOLERANCE)
        scale = dr.rcp(dr.maximum(found.weight, 1e-6))
        value, noise = found.totals[0] * scale, found.variances[0] * scale
        apart = dr.abs(dr.dot(value, Array3f(*LUMINANCE)) - luminance)
        counts = dr.exp(-apart * dr.rcp(APART * dr.sqrt(noise + variance) + 1e-8))
        counts = dr.select(found.weight > KNOWN, opaque(share) * counts, 0.0)
        total += counts * value
        weight += counts
        dr.eval(total, weight)  # so that one kernel serves any number of frames
    return image(total / weight, here.height, here.width)
