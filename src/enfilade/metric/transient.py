"""Errors that flicker: how the error changes from frame to frame, seen along the image's motion.

The published metric judges each frame alone, so that an error that comes and goes counts as one
that sticks to the surface. The eye has a channel for what changes: it is fed here with the
difference between the error of this frame and that of the last, fetched from where the surface was.

What it does not do: the error of the frame itself counts as steady besides, as if the film were
stopped there, so that an error that comes and goes is never scored below one that stays. The eye is
taken to follow the surface, and nothing masks the change. Between pixels the last error is fetched
bilinearly, which blurs it, so that a steady fine error on a surface that moves by fractions of a pixel
counts a little as change.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.castle import transient_sensitivity

__all__ = ["ErrorChange", "flicker_sensitivity", "moved"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]
Float64Array: TypeAlias = npt.NDArray[np.float64]

WHOLE = 1.0 - 1e-3  # share of a bilinear sample that must be valid, but for rounding
FREQUENCIES = 64  # samples of temporal frequency; the integrand is smooth


def moved(image: Float32Array, flow_px: Float32Array) -> tuple[Float32Array, BoolArray]:
    """Fetch an image from where a flow points, bilinearly.

    Parameters
    ----------
    image : (H, W) float32
        The last frame.
    flow_px : (H, W, 2) float32
        From each pixel to its place in the last frame, pixels, x to the right and y down.

    Returns
    -------
    moved : (H, W) float32
        0 where the flow leaves the image.
    is_inside : (H, W) bool
        Where it does not.
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


class ErrorChange:
    """The error test - reference of one frame after another, and its change along the motion."""

    def __init__(self) -> None:
        self._last: tuple[Float32Array, BoolArray] | None = None

    def forget(self) -> None:
        """Start afresh: a cut."""
        self._last = None

    def next(
        self,
        test: Float32Array,
        reference: Float32Array,
        backward_flow_px: Float32Array | None,
        valid: BoolArray | None,
    ) -> Float32Array | None:
        """Take a frame.

        Parameters
        ----------
        test, reference : (H, W) float32
            Luminance, cd/m2; may be anything where not valid.
        backward_flow_px : (H, W, 2) float32 or None
            To where each surface was in the last frame, pixels; None: nothing moved.
        valid : (H, W) bool or None
            Pixels to judge.

        Returns
        -------
        (H, W) float32 or None
            Error of this frame less that of the last at the same surface, cd/m2; 0 where either is
            not valid or the surface was outside. None where there is no last frame.
        """
        is_judged = np.ones(test.shape, dtype=np.bool_) if valid is None else valid.copy()
        error = np.zeros_like(test)
        np.subtract(test, reference, out=error, where=is_judged)
        last, self._last = self._last, (error, is_judged)
        if last is None:
            return None
        error_before, judged_before = last
        if backward_flow_px is not None:
            flow = np.where(is_judged[..., None], backward_flow_px, np.float32(0.0))
            before = judged_before
            error_before, judged_before = moved(error_before, flow)
            if not before.all():
                share, _ = moved(before.astype(np.float32), flow)
                judged_before &= share > WHOLE
        change = np.zeros_like(error)
        np.subtract(error, error_before, out=change, where=is_judged & judged_before)
        return change


def flicker_sensitivity(
    frequency_cpd: float, fps: float, luminance_cd_m2: Float64Array, area_deg2: float
) -> Float64Array:
    """Sensitivity to an error that differs from frame to frame, of which half the change is known.

    Half of the change between two frames is a filter over time with the gain sin(pi w / fps). An
    error that takes a new value in each frame has all frequencies w up to fps / 2 alike; what the
    transient channel of castleCSF sees of it, over what the filter passes of it, is the root of

        mean over w of S(w)^2 sin^2(pi w / fps) / mean over w of sin^2(pi w / fps).

    Parameters
    ----------
    frequency_cpd : float
        Spatial frequency, cycles per degree.
    fps : float
        Frames per second.
    luminance_cd_m2 : (n,) float64
        Luminance that the eye is adapted to.
    area_deg2 : float
        Area of the pattern, square degrees.

    Returns
    -------
    (n,) float64
        1 / (threshold of half the change between frames, as contrast).
    """
    hertz = (np.arange(FREQUENCIES) + 0.5) * (0.5 * fps / FREQUENCIES)
    gain = np.sin(np.pi * hertz / fps) ** 2
    seen = transient_sensitivity(frequency_cpd, hertz[:, None], luminance_cd_m2[None, :], area_deg2)
    result: Float64Array = np.sqrt((seen**2 * gain[:, None]).sum(axis=0) / gain.sum())
    return result
