"""The temporal error, pixel by pixel."""

from __future__ import annotations

import math

import numpy as np


def temporal_error(
    error: np.ndarray, before: np.ndarray, backward: np.ndarray, visible_before: np.ndarray
) -> float:
    """RMS of error(x) - before(x + backward(x)) over seen pixels and channels, by explicit taps."""
    height, width, channels = error.shape
    total, count = 0.0, 0
    for row in range(height):
        for column in range(width):
            if not visible_before[row, column]:
                continue
            x = min(max(column + float(backward[row, column, 0]), 0.0), width - 1.0)
            y = min(max(row + float(backward[row, column, 1]), 0.0), height - 1.0)
            left, top = math.floor(x), math.floor(y)
            right, below = min(left + 1, width - 1), min(top + 1, height - 1)
            u, v = x - left, y - top
            for c in range(channels):
                upper = before[top, left, c] * (1 - u) + before[top, right, c] * u
                lower = before[below, left, c] * (1 - u) + before[below, right, c] * u
                total += (error[row, column, c] - upper * (1 - v) - lower * v) ** 2
                count += 1
    return math.sqrt(total / count)
