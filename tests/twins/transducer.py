"""Twin of `enfilade.metric`'s modern decision: one place at a time, in float64, nothing shared.

Takes the contrasts of a band's channels in units of their thresholds; gathers energy under the
aperture by its definition, pixel by pixel; compares the images orientation by orientation.
"""

import math

import numpy as np

SEMI_SATURATION = 1.3
NEIGHBOUR_SHARE = 0.5
INHIBITION = 0.8
APERTURE_DEG = 0.3


def gathered(energy, row, column, pixels_per_degree):
    """Mean of a map under the Gaussian around one pixel; nothing lies beyond the borders."""
    sigma = APERTURE_DEG * pixels_per_degree
    total = 0.0
    for y in range(energy.shape[0]):
        for x in range(energy.shape[1]):
            away = (y - row) ** 2 + (x - column) ** 2
            total += energy[y, x] * math.exp(-away / (2 * sigma**2))
    return total / (2 * math.pi * sigma**2)


def gain(energies, orientation, beside):
    neighbours = {orientation}
    if len(energies) > 1:
        neighbours |= {(orientation + 1) % len(energies), (orientation - 1) % len(energies)}
    inhibition = sum(energies[neighbour] for neighbour in neighbours)
    inhibition += NEIGHBOUR_SHARE * beside[orientation]
    return (1 + SEMI_SATURATION) / (SEMI_SATURATION + inhibition**INHIBITION)


def energies_at(reference, test, row, column, pixels_per_degree):
    """Gathered energies of both images and of what differs, by orientation."""
    maps = []
    for c, t in zip(reference.astype(float), test.astype(float), strict=True):
        both = c * c, t * t, np.abs(t * np.abs(t) - c * np.abs(c))
        maps.append([gathered(energy, row, column, pixels_per_degree) for energy in both])
    return list(zip(*maps, strict=True))


def band_jnd(band, neighbours, row, column, pixels_per_degree):
    """J of a band at one pixel, from (n, H, W) contrasts of both images, and from those of its neighbours."""
    before, after, changed = energies_at(*band, row, column, pixels_per_degree)
    beside = [energies_at(*other, row, column, pixels_per_degree) for other in neighbours]
    beside_before, beside_after = (
        [sum(other[kind][orientation] for other in beside) for orientation in range(len(before))]
        for kind in (0, 1)
    )
    jnd = 0.0
    for orientation in range(len(before)):
        e_before, e_after, d = before[orientation], after[orientation], changed[orientation]
        gain_before = gain(before, orientation, beside_before)
        gain_after = gain(after, orientation, beside_after)
        jnd += abs(e_after * gain_after - e_before * gain_before)
        jnd += max(d - abs(e_after - e_before), 0.0) * (gain_before + gain_after) / 2
    return jnd
