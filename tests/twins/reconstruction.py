"""Twin of `enfilade.methods.decoupled.reconstruction`: one pixel and one sample at a time, float64."""

import functools
import math

SIGMA, RADIUS = 0.5, 1.5


def reconstructed(shape, samples, background=None):
    """An image (H, W) from samples by pixel: ``samples[row, column]`` is a list of (x, y, value)."""
    height, width = shape
    return [
        [_pixel(row, column, shape, samples, background) for column in range(width)] for row in range(height)
    ]


def _pixel(row, column, shape, samples, background):
    total = norm = 0.0
    for y in range(max(row - 1, 0), min(row + 2, shape[0])):
        for x in range(max(column - 1, 0), min(column + 2, shape[1])):
            share = _integral(x - column) * _integral(y - row)
            inside = samples.get((y, x), [])
            if inside:
                weights = [_filter(u - column - 0.5) * _filter(v - row - 0.5) for u, v, _ in inside]
                mean = sum(w * s[2] for w, s in zip(weights, inside, strict=True)) / sum(weights)
            elif background is not None:
                mean = background[y, x]
            else:
                continue
            total += share * mean
            norm += share
    return total / norm if norm else 0.0


def _filter(offset):
    return math.exp(-0.5 * (offset / SIGMA) ** 2)


@functools.cache
def _integral(offset):
    """Of the normalized filter over a pixel, by the midpoint rule."""
    steps = 2000
    inside = sum(_filter(offset - 0.5 + (k + 0.5) / steps) for k in range(steps))
    whole = sum(_filter((2.0 * RADIUS) * ((k + 0.5) / steps - 0.5)) for k in range(steps)) * 2.0 * RADIUS
    return inside / whole
