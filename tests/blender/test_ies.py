"""Mean intensity of IES profiles."""

import math

import pytest

from enfilade_blender.ies import LUMENS_PER_WATT, mean_factor

HEAD = "IESNA:LM-63-2002\n[TEST] none\nTILT=NONE\n"
CANDELA = LUMENS_PER_WATT / (4.0 * math.pi)  # of a factor of 1
CONE = math.radians(60.0)


def profile(polar, azimuths, rows, *, factors=(1.0, 1.0, 1.0), kind=1, head=HEAD):
    multiplier, ballast, photometric = factors
    numbers = [1, -1, multiplier, len(polar), len(azimuths), kind, 2, 0, 0, 0, ballast, photometric, 50]
    lines = [numbers, polar, azimuths, *rows]
    return head + "\n".join(" ".join(map(str, line)) for line in lines) + "\n"


@pytest.mark.parametrize(
    ("text", "mean"),
    [
        (profile([0, 90, 180], [0], [[100, 100, 100]]), 100.0),
        (profile([0, 45, 90], [0], [[100, 100, 100]]), 50.0),  # dark above
        (profile([0, 60], [0], [[8, 8]]), 8.0 * (1.0 - math.cos(math.radians(60.0))) / 2.0),
        (profile([0, 180], [0], [[8, 8]], factors=(2.0, 0.5, 0.75)), 6.0),
        (profile([0, 180], [0, 90], [[10, 10], [30, 30]]), 20.0),
        (profile([0, 180], [0, 10, 90], [[0, 0], [0, 0], [80, 80]]), 80.0 * 0.5 * 80.0 / 90.0),
        (profile([0, 180], [0], [[5, 5]], head="TILT=INCLUDE\n1\n2\n0 90\n1.0 1.0\n"), 5.0),
    ],
)
def test_a_point_has_the_mean_over_the_sphere(text, mean):
    assert mean_factor(text, "POINT") == pytest.approx(mean / CANDELA, rel=2e-3)


def test_other_lamps_have_the_mean_over_what_they_light():
    half = profile([0, 90], [0], [[100, 100]])
    assert mean_factor(half, "AREA") == pytest.approx(100.0 / CANDELA, rel=2e-3)
    assert mean_factor(half, "SPOT", CONE) == pytest.approx(100.0 / CANDELA, rel=2e-3)
    narrow = profile([0, 30, 30.001, 90], [0], [[100, 100, 0, 0]])
    assert mean_factor(narrow, "SPOT", CONE) == pytest.approx(100.0 / CANDELA, rel=2e-3)
    assert mean_factor(narrow, "AREA") == pytest.approx(0.25 * 100.0 / CANDELA, rel=5e-3)  # sin(30)^2


@pytest.mark.parametrize(
    "text",
    [
        "", "no profile", HEAD, HEAD + "1 -1 1 3 1", HEAD + "one two", HEAD + "1 -1 1 1e999" + 10 * " 1",
        profile([], [0], []), profile([0, 180], [0, 0], [[1, 1], [1, 1]]),
        profile([0, 180], [0], [["nan", 1]]), profile([-90, 90], [0], [[1, 1]], kind=2),
    ],
)  # fmt: skip
def test_a_malformed_profile_has_none(text):
    assert mean_factor(text, "POINT") is None
