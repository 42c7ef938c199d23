"""The spatial part of the filter: a Gaussian whose width depends on the velocity (§5.2)."""

from __future__ import annotations

from typing import Any

import drjit as dr

from enfilade.arrays import Array3f, Float, Int, UInt, image, lanes, opaque, pixel_grid
from enfilade.records import F32

SIGMAS = 6.0  # support in standard deviations: three pixels for a standard deviation of one half


def reconstruct(color: F32, support_px: F32) -> F32:
    """Filter an image with a Gaussian of each pixel's own support.

    Parameters
    ----------
    color : (H, W, 3) float32
    support_px : (H, W) float32
        Full width; see :func:`~enfilade.methods.paper.support.spatial_support_px`.

    Returns
    -------
    (H, W, 3) float32
    """
    height, width = support_px.shape
    values, support = lanes(color), lanes(support_px)
    for axis in (0, 1):
        values = blur_axis(values, support, width=width, height=height, axis=axis)
    return image(values, height, width)


def blur_axis(values: Any, support: Any, *, width: int, height: int, axis: int) -> Any:
    """Convolve an image along one axis with a Gaussian of each pixel's own support; Array3f.

    Both axes one after the other are the two-dimensional Gaussian, exactly where the support is constant.
    At the border the weights are normalized over the pixels inside.

    Parameters
    ----------
    values : Array3f
        Image, width * height lanes.
    support : Float
        Full width of the filter, pixels; :data:`SIGMAS` standard deviations.
    width, height
    axis
        0 along x, 1 along y.
    """
    # Address the taps: lane + offset * stride.
    lane, column, row = pixel_grid(height, width)
    at, size, stride = (column, width, 1) if axis == 0 else (row, height, width)
    at, last = Int(at), opaque(size - 1, Int)

    # Prepare each pixel's Gaussian.
    sigma = support / SIGMAS
    falloff = -0.5 / (sigma * sigma)
    radius = Int(dr.floor(0.5 * support))

    def step(offset: Any, total: Any, weight: Any) -> tuple[Any, Any, Any]:
        where = at + offset
        is_inside = (where >= 0) & (where <= last)
        w = dr.select(is_inside, dr.exp(falloff * Float(offset * offset)), 0.0)
        tap = UInt(Int(lane) + offset * stride)
        total = total + w * dr.gather(Array3f, values, tap, is_inside)
        return offset + 1, total, weight + w

    # Sum up the taps of the support, and normalize.
    _, total, weight = dr.while_loop(
        state=(Int(-radius), Array3f(0), Float(0)),
        cond=lambda offset, *_: offset <= radius,
        body=step,
        labels=("offset", "total", "weight"),
        label="blur",
    )
    return total / weight
