"""The spatial part of the filter: a Gaussian whose width depends on the velocity (§5.2)."""

from __future__ import annotations

from enfilade.arrays import image, lanes
from enfilade.methods.paper.convolve import blur_axis
from enfilade.records import F32


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
