"""Crops of images for figures."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Crop = tuple[slice, slice]  # rows, columns


def crop_around(weights: npt.NDArray[Any], side: int) -> Crop:
    """Square crop with the largest sum of weights, (H, W), clipped to the size of the image."""
    height, width = weights.shape
    y, x = min(side, height), min(side, width)
    sums = np.pad(weights.astype(np.float64).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    inside = sums[y:, x:] - sums[:-y, x:] - sums[y:, :-x] + sums[:-y, :-x]
    top, left = np.unravel_index(int(np.argmax(inside)), inside.shape)
    return slice(int(top), int(top) + y), slice(int(left), int(left) + x)
