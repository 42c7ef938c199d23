"""What lies beyond the borders and in undefined pixels, so that neither rings over the image."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.fft

__all__ = ["MirrorBorder", "fill_undefined"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


class MirrorBorder:
    """Continues images by their mirror image, to a size that is quick to transform.

    Parameters
    ----------
    height_px, width_px : int
        Size of the images, of any parity, from 1 up.
    margin_px : int
        Least width of the border, a multiple of `multiple_px`; the reach of the lowest filter.
    multiple_px : int
        Both padded lengths are multiples of this.
    """

    def __init__(self, height_px: int, width_px: int, *, margin_px: int, multiple_px: int) -> None:
        self.margin_px = margin_px
        self._rows = self._mirrored(height_px, margin_px, multiple_px)
        self._columns = self._mirrored(width_px, margin_px, multiple_px)

    @staticmethod
    def _mirrored(length: int, margin: int, multiple: int) -> npt.NDArray[np.intp]:
        units = -(-(length + 2 * margin) // multiple)
        padded = multiple * scipy.fft.next_fast_len(units, real=True)
        period = 2 * length
        phase = (np.arange(padded) - margin) % period
        return np.minimum(phase, period - 1 - phase)

    @property
    def padded_shape(self) -> tuple[int, int]:
        """Height and width after padding."""
        return len(self._rows), len(self._columns)

    def pad(self, image: Float32Array) -> Float32Array:
        """Continue an image, (height, width) -> `padded_shape`."""
        return image.take(self._rows, axis=0).take(self._columns, axis=1)

    def crop(self, channels: Float32Array, reduction: int, shape: tuple[int, int]) -> Float32Array:
        """Cut the border off channels at reduced size (a view).

        Parameters
        ----------
        channels : (..., padded height / reduction, padded width / reduction) float32
            Channels of a padded image.
        reduction : int
            A power of two that divides the margin.
        shape : tuple of int
            Height and width to keep.

        Returns
        -------
        (..., *shape) float32
            Samples from the image's first pixel on.
        """
        start = self.margin_px // reduction
        return channels[..., start : start + shape[0], start : start + shape[1]]


def fill_undefined(
    test: Float32Array, reference: Float32Array, valid: BoolArray | None
) -> tuple[Float32Array, Float32Array]:
    """Give pixels that are not judged a harmless value: that of the other image.

    Parameters
    ----------
    test, reference : (H, W) float32
        Luminance; may be NaN or infinite where not valid.
    valid : (H, W) bool or None
        Pixels to judge; None for all.

    Returns
    -------
    test, reference : (H, W) float32
        Equal to one another where not valid: the reference if that is finite, else the test, else
        the mean of the reference's valid pixels.
    """
    if valid is None or valid.all():
        return test, reference
    judged = reference[valid]
    mean = judged.mean(dtype=np.float64) if judged.size else 0.0
    known = np.where(np.isfinite(test), test, np.float32(mean))
    filler = np.maximum(np.where(np.isfinite(reference), reference, known), np.float32(0.0))
    return np.where(valid, test, filler), np.where(valid, reference, filler)
