"""Initial keyframes (§4.2, Eq. 6)."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.methods.keyframes import place_keyframes, segment_length
from enfilade.settings import KeyframeSettings, Placement

speeds = st.lists(st.floats(0, 100), min_size=1, max_size=400).map(np.array)
spacings = st.integers(2, 60)
adaptations = st.floats(0, 0.9)
placements = st.sampled_from(list(Placement))


def place(speed, placement=Placement.ADAPTED, spacing=25, adaptation=0.5, **more):
    settings = KeyframeSettings(placement=placement, spacing=spacing, adaptation=adaptation)
    return place_keyframes(np.asarray(speed, float), settings, **more)


@pytest.mark.parametrize(
    ("flow", "mean_flow", "expected"),
    [
        (100.0, 100.0, 25),  # alpha = 0
        (80.0, 100.0, 30),  # alpha = (100 - 80) / 100 = 0.2: 1.2 x 25
        (120.0, 100.0, 20),  # alpha = -0.2
        (50.0, 100.0, 38),  # alpha = 0.5: 37.5, to the even
        (0.0, 100.0, 38),  # alpha = 1, limited to A = 0.5
        (150.0, 100.0, 12),  # alpha = -0.5: 12.5, to the even
        (1e6, 100.0, 12),  # limited to -A
        (0.0, 0.0, 25),  # nothing moves
    ],
)
def test_equation_6_by_hand(flow, mean_flow, expected):
    assert segment_length(flow, mean_flow, 25, 0.5) == expected


def test_without_adaptation_it_is_uniform():
    assert segment_length(1.0, 100.0, 25, 0.0) == 25
    assert segment_length(1e9, 100.0, 25, 0.0) == 25


def test_a_segment_has_at_least_one_frame():
    assert segment_length(1e9, 1.0, 2, 0.9) == 1


def test_two_speeds_by_hand():
    # 50 frames at 1 px, then 51 at 3: q of the four uniform segments 25, 25, 75, 75, their mean 50.
    # From 0: alpha 0.5, 38 frames. From 38: 12 x 1 + 13 x 3 = 51, alpha -0.02, 24.5 -> 24. From 62: 75,
    # alpha -0.5, 12 frames at a time: 74, 86. From 86 on 15 frames are left, as fast: 98; 110 is beyond.
    assert place([1.0] * 50 + [3.0] * 51) == [0, 38, 62, 74, 86, 98, 100]


@given(st.integers(1, 400), spacings, adaptations, st.floats(0.001, 50))
def test_constant_flow_is_uniform(count, spacing, adaptation, speed):
    uniform = place([speed] * count, Placement.UNIFORM, spacing)
    assert place([speed] * count, Placement.ADAPTED, spacing, adaptation) == uniform
    assert place([0.0] * count, Placement.ADAPTED, spacing, adaptation) == uniform


def test_uniform_spacing():
    assert place([1.0] * 61, Placement.UNIFORM) == [0, 25, 50, 60]
    assert place([1.0] * 51, Placement.UNIFORM) == [0, 25, 50]
    assert place([1.0] * 52, Placement.UNIFORM) == [0, 25, 50, 51]


@pytest.mark.parametrize("placement", [Placement.UNIFORM, Placement.ADAPTED])
@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (10, [0, 9]),
        (12, [0, 11]),
        (13, [0, 8, 12]),  # half a segment is left
        (17, [0, 8, 16]),
        (18, [0, 8, 17]),  # not [0, 8, 16, 17]
        (27, [0, 9, 17, 26]),
    ],
)
def test_short_rests_are_spread_over_the_other_segments(placement, count, expected):
    assert place([1.0] * count, placement, 8, spreads_rest=True) == expected


@given(speeds, placements, spacings, adaptations)
def test_with_spread_rests_only_whole_shots_are_shorter_than_half_a_segment(
    speed, placement, spacing, adaptation
):
    plain, spread = (
        place(speed, placement, spacing, adaptation, spreads_rest=rule) for rule in (False, True)
    )
    assert spread[0] == 0
    assert spread[-1] == len(speed) - 1
    assert all(a < b for a, b in itertools.pairwise(spread))
    assert len(plain) - len(spread) in (0, 1)
    if placement is not Placement.EQUAL_FLOW and len(spread) > 2:
        assert 2 * (spread[-1] - spread[-2]) >= round((1.0 - adaptation) * spacing) - 2


def test_equal_flow_by_hand():
    # 40 steps in all: 20 of 1 px, 20 of 3 px; two segments of 40 px each. 20 frames make 20 px, 20 / 3
    # more frames the other 20: the first frame with at least 40 px behind it is 27.
    assert place([1.0] * 20 + [3.0] * 21, Placement.EQUAL_FLOW, spacing=20) == [0, 27, 40]


def test_equal_flow_without_any_flow():
    assert place([0.0] * 100, Placement.EQUAL_FLOW) == [0, 99]


@given(speeds, placements, spacings, adaptations)
def test_they_rise_from_the_first_to_the_last_frame(speed, placement, spacing, adaptation):
    keyframes = place(speed, placement, spacing, adaptation)
    assert keyframes[0] == 0
    assert keyframes[-1] == len(speed) - 1
    assert all(a < b for a, b in itertools.pairwise(keyframes))
    assert all(isinstance(k, int) for k in keyframes)


@given(speeds, spacings, adaptations)
def test_spacing_stays_within_its_limits(speed, spacing, adaptation):
    keyframes = place(speed, Placement.ADAPTED, spacing, adaptation)
    gaps = np.diff(keyframes)
    half = 0.5 + 1e-9  # rounding to whole frames
    assert (gaps <= (1 + adaptation) * spacing + half).all()
    assert (gaps[:-1] >= min((1 - adaptation) * spacing - half, 1)).all()
    assert (gaps[:-1] >= (1 - adaptation) * spacing - half).all()


@given(speeds, spacings, adaptations, st.floats(0.01, 1000))
def test_the_unit_of_flow_does_not_matter(speed, spacing, adaptation, unit):
    speed = np.round(speed, 3) + 0.001
    first = place(speed, Placement.ADAPTED, spacing, adaptation)
    other = place(speed * 2.0 ** round(np.log2(unit)), Placement.ADAPTED, spacing, adaptation)
    assert first == other


@pytest.mark.parametrize("placement", list(Placement))
@pytest.mark.parametrize("count", [1, 2, 3])
def test_short_shots(placement, count):
    keyframes = place([2.0] * count, placement)
    assert keyframes == sorted({0, count - 1})


def test_faster_passages_have_more_keyframes():
    speed = np.concatenate([np.full(100, 0.5), np.full(100, 4.0)])
    keyframes = np.array(place(speed))
    assert (keyframes < 100).sum() < (keyframes >= 100).sum()
