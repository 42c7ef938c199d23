"""Path guides: the density of a mixture is that of its samples."""

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, Float, lanes, opaque, rows
from enfilade.kernels.guiding import OCTANTS, REGIONS, GuidedLobe, PathGuide
from enfilade.kernels.random import one_sequence

COUNT = 1 << 16
NEAR, BELOW = (0.3, -0.2, 0.9, 0.4), (0.0, 0.0, -2.0, 0.3)  # centre and radius
AROUND, FAR = (0.1, 0.1, 0.1, 0.5), (30.0, 20.0, 25.0, 0.05)


def guide_of(*spheres, radiance=5.0, background=1.0):
    table = np.zeros((REGIONS, 5), np.float32)
    table[: len(spheres), :4], table[: len(spheres), 4] = spheres, radiance
    sides = np.repeat(table[:, 4], OCTANTS)
    return PathGuide(lanes(table[None, :, :3]), lanes(table[:, 3]), lanes(sides), opaque(background))


def cosine_directions(sampler):
    square = sampler.next_2d()
    radius, angle = dr.sqrt(square.x), dr.two_pi * square.y
    return Array3f(radius * dr.cos(angle), radius * dr.sin(angle), dr.sqrt(1.0 - square.x))


def sampled(guide):
    """Directions of the mixture with a cosine lobe along z, seen from the origin, and their density."""
    sampler = one_sequence(COUNT)
    lobe = GuidedLobe(guide, dr.zeros(Array3f, COUNT), Array3f(0, 0, 1) + dr.zeros(Array3f, COUNT))
    direction, is_guided = lobe.sample(sampler.next_1d(), sampler.next_2d())
    direction = dr.select(is_guided, direction, cosine_directions(sampler))
    own = dr.maximum(direction.z, 0.0) / dr.pi
    return direction, lobe.pdf(direction, Float(own)), np.array(is_guided)


@pytest.mark.parametrize("spheres", [(NEAR,), (NEAR, FAR, BELOW), (AROUND,)])
def test_weighted_means_are_those_of_the_lobe(spheres):
    direction, pdf, _ = sampled(guide_of(*spheres, radiance=1000.0 if FAR in spheres else 5.0))
    at, density = rows(direction).astype(float), np.array(pdf, float)
    cosine = np.maximum(at[:, 2], 0.0) / np.pi
    for value, expected in (
        (np.ones(COUNT), 1.0),
        (at[:, 2], 2.0 / 3.0),
        (at[:, 0] > 0.0, 0.5),
        (np.square(at[:, 1]), 0.25),
    ):
        weighted = value * cosine / density
        error = weighted.std() / np.sqrt(COUNT)
        assert weighted.mean() == pytest.approx(expected, abs=4.0 * error + 1e-6)


def test_a_region_is_sampled_as_often_as_it_contributes():
    _, _, is_guided = sampled(guide_of(NEAR, background=1e-6))
    assert is_guided.mean() == pytest.approx(0.25, abs=0.01)  # never more
    _, _, is_rare = sampled(guide_of(FAR, radiance=1.0))
    assert is_rare.mean() < 1e-4


def test_directions_lie_in_the_cone():
    direction, _, is_guided = sampled(guide_of(NEAR))
    to = np.array(NEAR[:3]) / np.linalg.norm(NEAR[:3])
    sine = NEAR[3] / np.linalg.norm(NEAR[:3])
    cosine = rows(direction)[is_guided] @ to
    assert cosine.min() >= np.sqrt(1.0 - sine**2) - 1e-5
    assert cosine.mean() == pytest.approx(0.5 + 0.5 * np.sqrt(1.0 - sine**2), abs=1e-3)


@pytest.mark.parametrize("sphere", [BELOW, AROUND])
def test_spheres_below_the_horizon_and_around_a_point_are_not_sampled(sphere):
    assert not sampled(guide_of(sphere))[2].any()
