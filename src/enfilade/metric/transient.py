"""Errors that flicker: the change of the error from frame to frame, along the image's motion.

The published metric compares each frame alone, so that an error that comes and goes counts as one that
sticks to the surface. The transient channel of vision (castleCSF) gets the change of the error instead.

Limits: the error of the frame itself counts as steady besides, as if the film were stopped there, so that
an error that comes and goes is never scored below one that stays. The eye is taken to follow the surface,
and nothing masks the change. The last error is fetched bilinearly, which blurs it, so that a steady fine
error on a surface that moves by fractions of a pixel counts a little as change. Backward vectors of
disoccluded surfaces lead to what covered them; only with the last frame's forward vectors these are found.
"""

from __future__ import annotations

import itertools

import numpy as np

from enfilade.metric.aperture import REFERENCE_AREA_DEG2
from enfilade.metric.castlecsf import transient_sensitivity
from enfilade.metric.cortex import Band
from enfilade.records import F32, F64, Mask
from enfilade.viewing import Viewing

FREQUENCIES = 64  # samples of temporal frequency; the integrand is smooth
AGREEMENT_PX = 1.0  # our choice: forward and backward vectors of a surface differ by less
LUMINANCE_KNOTS = np.geomspace(1e-3, 1e4, 64)  # cd/m2, interpolated between on logarithmic axes


def moved(image: F32, flow_px: F32) -> tuple[F32, Mask]:
    """Fetch an image along motion vectors, bilinearly.

    Parameters
    ----------
    image : (H, W) float32
        The last frame.
    flow_px : (H, W, 2) float32
        From each pixel to its place in the last frame, pixels, x to the right and y down.

    Returns
    -------
    moved : (H, W) float32
        0 where the vectors leave the image.
    is_inside : (H, W) bool
        Where they do not.
    """
    height, width = image.shape
    across = flow_px[..., 0] + np.arange(width, dtype=np.float32)
    down = flow_px[..., 1] + np.arange(height, dtype=np.float32)[:, None]
    is_inside = (across >= 0) & (across <= width - 1) & (down >= 0) & (down <= height - 1)
    across = np.where(is_inside, across, np.float32(0.0))
    down = np.where(is_inside, down, np.float32(0.0))
    left, top = across.astype(np.intp), down.astype(np.intp)
    across -= left
    down -= top
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    upper, lower = image[top, left], image[below, left]
    upper += across * (image[top, right] - upper)
    lower += across * (image[below, right] - lower)
    upper += down * (lower - upper)
    return np.where(is_inside, upper, np.float32(0.0)), is_inside


def was_visible(forward_flow_px: F32, backward_flow_px: F32) -> Mask:
    """Whether each surface was visible in the last frame, (H, W) bool.

    One of the four pixels around its place in the last frame must have moved as it did. (Their mean would
    fail at the outlines of what moves.)

    Parameters
    ----------
    forward_flow_px : (H, W, 2) float32
        Of the last frame: from each pixel to its place in this one, pixels.
    backward_flow_px : (H, W, 2) float32
        Of this frame: from each pixel to its place in the last one.
    """
    height, width = backward_flow_px.shape[:2]
    across = np.clip(backward_flow_px[..., 0] + np.arange(width), 0, width - 1)
    down = np.clip(backward_flow_px[..., 1] + np.arange(height)[:, None], 0, height - 1)
    found = np.zeros((height, width), np.bool_)
    for to_row, to_column in itertools.product((np.floor, np.ceil), repeat=2):
        forward = forward_flow_px[to_row(down).astype(np.intp), to_column(across).astype(np.intp)]
        found |= np.abs(forward + backward_flow_px).max(axis=-1) < AGREEMENT_PX
    return found


def error_change(
    error: F32, before: F32, backward_flow_px: F32 | None, forward_flow_px: F32 | None = None
) -> F32:
    """Error of a frame less that of the last frame at the same surface.

    Parameters
    ----------
    error, before : (H, W) float32
        test - reference of this frame and of the last, cd/m2.
    backward_flow_px : (H, W, 2) float32 or None
        From each surface to its place in the last frame, pixels; None: nothing moved.
    forward_flow_px : (H, W, 2) float32 or None
        Of the last frame; finds surfaces that it did not show. None: it showed all.

    Returns
    -------
    (H, W) float32
        cd/m2; 0 where the surface was outside or covered.
    """
    if backward_flow_px is None:
        return error - before
    last, is_known = moved(before, backward_flow_px)
    if forward_flow_px is not None:
        is_known &= was_visible(forward_flow_px, backward_flow_px)
    return np.where(is_known, error - last, np.float32(0.0))


def flicker_sensitivity(frequency_cpd: float, fps: float, luminance_cd_m2: F64) -> F64:
    """Sensitivity to an error that differs from frame to frame, by half its change.

    Half of the change between two frames is a filter over time with the gain sin(pi w / fps). An
    error that takes a new value in each frame has all frequencies w up to fps / 2 alike; the response of
    the transient channel of castleCSF to it, over the power that the filter passes, is the root of

        mean over w of S(w)^2 sin^2(pi w / fps) / mean over w of sin^2(pi w / fps).

    Returns
    -------
    (n,) float64
        1 / (threshold of half the change between frames, as contrast), for each of n adapting luminances.
    """
    hertz = (np.arange(FREQUENCIES) + 0.5) * (0.5 * fps / FREQUENCIES)
    gain = np.sin(np.pi * hertz / fps) ** 2
    seen = transient_sensitivity(frequency_cpd, hertz[:, None], luminance_cd_m2, REFERENCE_AREA_DEG2)
    result: F64 = np.sqrt((seen**2 * gain[:, None]).sum(axis=0) / gain.sum())
    return result


class FlickerWeight:
    """Weights that convert the change of the error, cd/m2, to units of its threshold, by band and luminance.

    Parameters
    ----------
    bands : tuple of Band
    viewing : Viewing
    gain : float
        Factor on sensitivities (`aperture.patch_gain`).
    """

    def __init__(self, bands: tuple[Band, ...], viewing: Viewing, gain: float) -> None:
        self._log_weights = []
        for band in bands:
            frequency = band.centre_cpp * viewing.pixels_per_degree
            sensitivity = flicker_sensitivity(frequency, viewing.fps, LUMINANCE_KNOTS)
            self._log_weights.append(np.log(0.5 * gain * sensitivity / LUMINANCE_KNOTS))

    def at(self, band: Band, luminance_cd_m2: F32) -> F32:
        """Weight of a band at luminances above 0."""
        log_weight = self._log_weights[band.level - 1]
        weight = np.exp(np.interp(np.log(luminance_cd_m2), np.log(LUMINANCE_KNOTS), log_weight))
        return np.asarray(weight, dtype=np.float32)
