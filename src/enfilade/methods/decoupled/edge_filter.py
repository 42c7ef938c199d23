"""The edge filter: refined pixels are denoised as they are displayed, within the error of their estimates.

Refined pixels show several surfaces, often one a hundred times brighter than another. Filters of radiance
mix such pixels; on the display they differ by one step from black to white.
"""

from __future__ import annotations

import numpy as np
import scipy.ndimage

from enfilade.kernels.tone import luminance
from enfilade.methods.denoise import denoise_displayed
from enfilade.records import F32

DEVIATIONS = 2.0  # of an estimate, by which the filter changes it at most
MEAN_PX = 2.0  # standard deviation of the Gaussian over which the mean is kept


def filter_edges(color: F32, variance: F32, *, exposure_ev: float) -> F32:
    """Difference between a frame whose refined pixels are denoised and the frame.

    The frame is denoised after exposure and clipping at white. The mean over the refined pixels around is
    kept, and no pixel changes by more than two standard deviations of its estimate. Pixels above white
    stay as they are.

    Parameters
    ----------
    color : (H, W, 3) float32
        Linear radiance of the frame.
    variance : (H, W) float32
        Of the luminance of refined pixels; 0 elsewhere.
    exposure_ev
        In stops.

    Returns
    -------
    (H, W, 3) float32
        Linear radiance; 0 elsewhere.
    """
    if not variance.any():
        return np.zeros_like(color)
    scale = np.float32(2.0**exposure_ev)
    shown = np.clip(color * scale, np.float32(0), np.float32(1))
    error = np.sqrt(variance) * scale

    # Denoise, and keep the mean of what is displayed: the more uncertain a pixel, the more it is corrected.
    change = _limited(denoise_displayed(shown) - shown, error)
    share = np.square(error) / np.maximum(_blurred(np.square(error)), np.float32(1e-12))
    change -= share[..., None] * np.stack([_blurred(channel) for channel in np.moveaxis(change, 2, 0)], -1)

    is_open = luminance(color) * scale < 1.0
    found: F32 = np.where(is_open[..., None], _limited(change, error) / scale, np.float32(0))
    return found


def _limited(change: F32, error: F32) -> F32:
    """A change of colours whose luminance is limited to a multiple of an error, (H, W)."""
    most = np.float32(DEVIATIONS) * error
    factor = np.minimum(most / np.maximum(np.abs(luminance(change)), np.float32(1e-9)), np.float32(1))
    limited: F32 = change * factor[..., None]
    return limited


def _blurred(values: F32) -> F32:
    found: F32 = scipy.ndimage.gaussian_filter(values, MEAN_PX)
    return found
