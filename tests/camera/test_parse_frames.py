import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.camera import parse_frames
from enfilade.errors import CameraPathError


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("7", (7,)),
        ("1-5", (1, 2, 3, 4, 5)),
        ("1,5,9", (1, 5, 9)),
        ("1-10:3", (1, 4, 7, 10)),
        ("1-9:3", (1, 4, 7)),
        ("1-3, 7 ,10-14:2", (1, 2, 3, 7, 10, 12, 14)),
        ("-5--1:2", (-5, -3, -1)),
        ("-1-1", (-1, 0, 1)),
        ("4-4", (4,)),
        (" 1 - 3 : 2 ", (1, 3)),
    ],
)
def test_reads_the_notation_of_blender_and_open_job_description(text, numbers):
    assert parse_frames(text) == numbers


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "empty"),
        ("  ", "empty"),
        ("1,,2", "can't read ''"),
        ("1-", "can't read '1-'"),
        ("a", "can't read 'a'"),
        ("1.5", "can't read '1.5'"),
        ("1:2", "can't read '1:2'"),
        ("1-5:-1", "can't read"),
        ("٣", "can't read"),
        ("1-5:0", "step"),
        ("5-1", "1-5"),
        ("1,1", "frame 1 twice"),
        ("1-5,5-9", "frame 5 twice"),
        ("1-5,3", "must rise"),
        ("1-99999999999", "more than 1000000"),
        ("1-900000,900001-1800000", "more than 1000000"),
    ],
)
def test_says_what_is_wrong(text, problem):
    with pytest.raises(CameraPathError, match=problem):
        parse_frames(text)


@given(st.lists(st.integers(-500, 500), min_size=1, unique=True))
def test_a_list_of_numbers_comes_back(numbers):
    rising = sorted(numbers)
    assert parse_frames(",".join(map(str, rising))) == tuple(rising)


@given(st.integers(-500, 500), st.integers(0, 500), st.integers(1, 60))
def test_a_range_is_inclusive(first, length, step):
    assert parse_frames(f"{first}-{first + length}:{step}") == tuple(range(first, first + length + 1, step))


@given(st.text("0123456789-,: x", max_size=12))
def test_any_text_is_read_or_refused(text):
    try:
        numbers = parse_frames(text)
    except CameraPathError:
        return
    assert numbers == tuple(sorted(set(numbers)))
