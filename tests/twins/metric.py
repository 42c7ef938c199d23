"""Twin of `enfilade.metric`: full-size complex FFTs, loops, float64, nothing shared."""

import cmath
import math

import numpy as np

LEAST_SENSITIVITY = 1e-3


def mirrored(image, margin, padded_shape):
    """Continue by mirroring, one index at a time."""

    def source(index, length):
        while not 0 <= index < length:
            index = -1 - index if index < 0 else 2 * length - 1 - index
        return index

    rows = [source(y - margin, image.shape[0]) for y in range(padded_shape[0])]
    columns = [source(x - margin, image.shape[1]) for x in range(padded_shape[1])]
    return np.array([[image[y, x] for x in columns] for y in rows], dtype=np.float64)


def mesa(rho, k):
    if k == 0:
        return 1.0
    radius, width = 0.5**k, (2 / 3) * 0.5**k
    if rho <= radius - width / 2:
        return 1.0
    if rho >= radius + width / 2:
        return 0.0
    return 0.5 * (1 + math.cos(math.pi * (rho - radius + width / 2) / width))


def base_window(rho, levels):
    radius = 0.5 ** (levels - 1)
    cutoff = radius + radius / 3
    return math.exp(-(rho**2) / (2 * (cutoff / 3) ** 2)) if rho < cutoff else 0.0


def ring_window(rho, k, levels):
    if k == levels:
        return base_window(rho, levels)
    return mesa(rho, k - 1) - (base_window(rho, levels) if k == levels - 1 else mesa(rho, k))


def fan_window(theta_deg, orientation):
    away = abs(theta_deg - (30 * orientation - 90)) % 180
    away = min(away, 180 - away)
    return 0.5 * (1 + math.cos(math.pi * away / 30)) if away < 30 else 0.0


def channel_filter(shape, k, orientation, levels):
    """One filter over the whole frequency plane; orientation None for the base."""
    height, width = shape
    plane = np.zeros(shape)
    for row, fy in enumerate(np.fft.fftfreq(height)):
        for column, fx in enumerate(np.fft.fftfreq(width)):
            ring = ring_window(math.hypot(fx, fy), k, levels)
            theta = math.degrees(cmath.phase(complex(fx, fy)))
            fan = 1.0 if orientation is None else fan_window(theta, orientation)
            plane[row, column] = math.sin(math.pi / 2 * ring) * math.sin(math.pi / 2 * fan)
    return plane


def sensitivity(rho, v):
    first = 6.1 + 7.3 * abs(math.log10(1.7 * v / 3)) ** 3
    wave = (2 * math.pi * 0.67 * rho) ** 2
    fall = math.exp(-4 * math.pi * 0.67 * rho * (1.7 * v + 2) / 45.9)
    return max(1.14 * first * 1.7 * v * wave * fall, LEAST_SENSITIVITY)


def eye_speed(vx, vy, theta_deg, *, pursues):
    speed = math.hypot(vx, vy)
    retinal = max(abs(speed - min(0.82 * speed + 0.15, 80)), 0.15) if pursues else speed
    if theta_deg is None:
        return max(retinal, 0.15)
    away = math.atan2(vy, vx) - math.radians(theta_deg)
    return max(retinal * abs(math.cos(away)), 0.15)


def elevation(masker, slope):
    k1, k2 = 6 ** (1 - 1 / 0.3), 6 ** (1 / 0.3)
    return (1 + (k1 * (k2 * masker) ** slope) ** 4) ** 0.25


def respond(luminance):
    return 100 * luminance / (luminance + 12.6 * luminance**0.63)


def jnd_map(test, reference, *, centres_cpd, margin, padded_shape, velocity=None, slope=0.7):
    """The whole chain; eye pursues or not, whichever sees more. Returns (H, W) JND."""
    height, width = reference.shape
    levels = len(centres_cpd)
    r_test, r_reference = respond(test.astype(float)), respond(reference.astype(float))
    mean, adapted = r_reference.mean(), reference.mean(dtype=float)
    g = 0.37 * 12.6 * adapted**0.63 / (adapted + 12.6 * adapted**0.63)
    planes = [
        np.fft.fft2(mirrored((r - mean) / mean / g, margin, padded_shape)) for r in (r_test, r_reference)
    ]
    total = np.zeros((height, width))
    channels = [(k, o) for k in range(1, levels) for o in range(6)] + [(levels, None)]
    for k, orientation in channels:
        window = channel_filter(padded_shape, k, orientation, levels)
        c_test, c_reference = (
            np.fft.ifft2(plane * window).real[margin : margin + height, margin : margin + width]
            for plane in planes
        )
        theta = None if orientation is None else 30 * orientation - 90
        uniform = 0.0 if orientation is not None else float(np.median(c_test - c_reference))
        for y in range(height):
            for x in range(width):
                vx, vy = (0.0, 0.0) if velocity is None else map(float, velocity[y, x])
                s = max(
                    sensitivity(centres_cpd[k - 1], eye_speed(vx, vy, theta, pursues=pursues))
                    for pursues in (True, False)
                )
                masker = min(abs(c_test[y, x]), abs(c_reference[y, x])) * s
                seen = abs(c_test[y, x] - c_reference[y, x] - uniform) * s
                seen += abs(uniform) * sensitivity(centres_cpd[-1], 0.15)
                j = seen / elevation(masker, slope)
                total[y, x] += j**3.5
    return total ** (1 / 3.5)
