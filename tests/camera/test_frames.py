import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.camera import parse_frames, ranges
from enfilade.errors import CameraPathError


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("7", (7,)),
        ("1-10:3", (1, 4, 7, 10)),
        ("1-9:3", (1, 4, 7)),
        ("1-3, 7 ,10-14:2", (1, 2, 3, 7, 10, 12, 14)),
        ("-5--1:2", (-5, -3, -1)),
        ("-1-1", (-1, 0, 1)),
        ("4-4", (4,)),
        (" 1 - 3 : 2 ", (1, 3)),
    ],
)
def test_notation_of_blender_and_open_job_description(text, numbers):
    assert parse_frames(text) == numbers


@pytest.mark.parametrize("text", ["", "  ", "1,,2", "1-", "a", "1.5", "1:2", "1-5:-1", "٣"])
def test_malformed_selections(text):
    with pytest.raises(CameraPathError, match=r"can't read .* write them like 1-250"):
        parse_frames(text)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1-5:0", "'1-5:0' descends, or its step is 0"),
        ("5-1", "'5-1' descends"),
        ("1,1", "each named once; 1 follows 1"),
        ("1-5,3", "must rise, each named once; 3 follows 5"),
        ("1-99999999999", "more than 1000000"),
        ("1-900000,900001-1800000", "more than 1000000"),
    ],
)
def test_contradictory_selections(text, problem):
    with pytest.raises(CameraPathError, match=problem):
        parse_frames(text)


@given(st.text("0123456789-,: x", max_size=12))
def test_any_text_gives_rising_numbers_or_an_error(text):
    try:
        numbers = parse_frames(text)
    except CameraPathError:
        return
    assert numbers == tuple(sorted(set(numbers)))


@pytest.mark.parametrize("text", ["7", "1-250", "1-3,5,9-10"])
def test_ranges_are_read_back(text):
    assert ranges(parse_frames(text)) == text
