"""Mean intensity of IES profiles."""

import math

import pytest

from enfilade_blender.ies import mean_intensity

HEAD = "IESNA:LM-63-2002\n[TEST] none\nTILT=NONE\n"


def profile(polar, azimuths, rows, *, multiplier=1.0, ballast=1.0, head=HEAD):
    numbers = [1, -1, multiplier, len(polar), len(azimuths), 1, 2, 0, 0, 0, ballast, 1, 50]
    lines = [numbers, polar, azimuths, *rows]
    return head + "\n".join(" ".join(map(str, line)) for line in lines) + "\n"


@pytest.mark.parametrize(
    ("text", "mean"),
    [
        (profile([0, 90, 180], [0], [[100, 100, 100]]), 100.0),
        (profile([0, 45, 90], [0], [[100, 100, 100]]), 50.0),  # dark above
        (
            profile([0, 60], [0], [[8, 8]], multiplier=2.0, ballast=0.5),
            8 * (1 - math.cos(math.radians(60))) / 2,
        ),
        (profile([0, 180], [0, 90], [[10, 10], [30, 30]]), 20.0),
        (profile([0, 180], [0, 10, 90], [[0, 0], [0, 0], [80, 80]]), 80 * 0.5 * 80 / 90),
        (profile([0, 180], [0], [[5, 5]], head="TILT=INCLUDE\n1\n2\n0 90\n1.0 1.0\n"), 5.0),
    ],
)
def test_the_mean_is_that_over_the_sphere(text, mean):
    assert mean_intensity(text) == pytest.approx(mean, rel=2e-3)


@pytest.mark.parametrize("text", ["", "no profile", HEAD, HEAD + "1 -1 1 3 1", HEAD + "one two"])
def test_a_malformed_profile_has_none(text):
    assert mean_intensity(text) is None
