"""The edge-avoiding wavelet in loops."""

import numpy as np

SPLINE = np.array([1, 4, 6, 4, 1]) / 16.0
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def smooth(color, variance, depth, normal, shape_index, direction_from_pixel, *, levels, **limits):
    seen = depth, normal, shape_index, direction_from_pixel
    related = np.ones_like(variance)
    for level in range(levels):
        color, variance, share = _filter_level(color, variance, seen, step=1 << level, **limits)
        related *= share ** (_independent(level) - 1.0)
    return color, variance * related


def _independent(level):
    """Logarithm of the noise that a level leaves of a flat image, by that of independent pixels."""
    kernels = [np.ones(1)]
    for step in 2 ** np.arange(level + 1):
        taps = np.zeros(4 * step + 1)
        taps[::step] = SPLINE
        kernels.append(np.convolve(kernels[-1], taps))
    before, after = (np.sum(kernel**2) ** 2 for kernel in kernels[-2:])
    return np.log(after / before) / np.log(np.sum(SPLINE**2) ** 2)


def _filter_level(color, variance, seen, *, step, deviations, plane, exponent):
    depth, normal, shape_index, p = seen
    height, width = variance.shape
    blurred = np.zeros_like(variance)
    padded = np.pad(variance, 1, mode="edge")
    for j, wy in enumerate((0.25, 0.5, 0.25)):
        for i, wx in enumerate((0.25, 0.5, 0.25)):
            blurred += wy * wx * padded[j : j + height, i : i + width]
    luminance = color @ LUMINANCE
    out, out_variance, shares = np.zeros_like(color), np.zeros_like(variance), np.zeros_like(variance)
    for y in range(height):
        for x in range(width):
            here = depth[y, x] * (p @ (x + 0.5, y + 0.5, 1.0))
            total, total_variance, weight, squares = np.zeros(3), 0.0, 0.0, 0.0
            own = 0.0  # what differs too much in luminance keeps its own value in the place of the other's
            for j, wy in zip(range(-2, 3), SPLINE, strict=True):
                for i, wx in zip(range(-2, 3), SPLINE, strict=True):
                    v, u = y + j * step, x + i * step
                    if not (0 <= v < height and 0 <= u < width):
                        continue
                    surface = wy * wx
                    if not i and not j:
                        weight, own = weight + surface, own + surface
                        continue
                    if shape_index[v, u] != shape_index[y, x]:
                        continue
                    there = depth[v, u] * (p @ (u + 0.5, v + 0.5, 1.0))
                    away = abs(normal[y, x] @ (there - here)) / (plane * depth[y, x] + 1e-8)
                    cosine = np.clip(normal[y, x] @ normal[v, u], 0.0, 1.0)
                    surface *= np.exp(-away) * cosine**exponent
                    apart = abs(luminance[v, u] - luminance[y, x])
                    apart /= deviations * np.sqrt(blurred[v, u] + blurred[y, x]) + 1e-8
                    share = surface * np.exp(-apart)
                    total += share * color[v, u]
                    total_variance += share**2 * variance[v, u]
                    weight, own = weight + surface, own + surface - share
                    squares += share**2
            total, total_variance = total + own * color[y, x], total_variance + own**2 * variance[y, x]
            squares += own**2
            out[y, x], out_variance[y, x] = total / weight, total_variance / weight**2
            shares[y, x] = squares / weight**2
    return out, out_variance, shares
