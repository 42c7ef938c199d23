"""Twin of `enfilade.methods.paper.spatial_filter`: one pixel and one tap at a time, float64."""

import math

import numpy as np


def blurred_rows(image, support):
    """Convolve along x with a Gaussian of each pixel's own full width; an image (H, W, C)."""
    height, width = support.shape
    out = np.zeros(image.shape)
    for y in range(height):
        for x in range(width):
            sigma = float(support[y, x]) / 6.0
            radius = math.floor(float(support[y, x]) / 2.0)
            total = weights = 0.0
            for other in range(max(x - radius, 0), min(x + radius, width - 1) + 1):
                w = math.exp(-((other - x) ** 2) / (2.0 * sigma**2))
                total = total + w * image[y, other].astype(float)
                weights += w
            out[y, x] = total / weights
    return out


def blurred(image, support):
    """Along x, then along y."""
    across = blurred_rows(image, support)
    return blurred_rows(across.swapaxes(0, 1), support.T).swapaxes(0, 1)
