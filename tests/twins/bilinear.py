"""Twin of `enfilade.kernels.bilinear`: one position at a time, float64."""

import math

STEPS = 256


def interpolated(image, x, y):
    """Value of an image (H, W) or (H, W, C) at image coordinates, borders repeated."""
    height, width = image.shape[:2]
    u = round((x - 0.5) * STEPS) / STEPS
    v = round((y - 0.5) * STEPS) / STEPS
    left, top = math.floor(u), math.floor(v)
    total = 0.0
    for row in (top, top + 1):
        for column in (left, left + 1):
            weight = (1 - abs(u - column)) * (1 - abs(v - row))
            i, j = min(max(column, 0), width - 1), min(max(row, 0), height - 1)
            total = total + weight * image[j, i].astype(float)
    return total
