"""Frame selections such as ``1-250``, ``1,5,9`` and ``1-250:2``.

The notation of Blender's command line and of Open Job Description's range expressions: both ends belong to a
range, a step follows a colon, commas combine, numbers may be negative (``-5--1``). Unlike there, numbers
must rise from left to right: a walkthrough has one direction.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from enfilade.errors import CameraPathError

MOST_FRAMES = 1_000_000  # nine hours at 30 fps; a larger number is probably a typing error

_RANGE = re.compile(r"\s*(-?\d{1,18})(?:\s*-\s*(-?\d{1,18})(?:\s*:\s*(\d{1,18}))?)?\s*", re.ASCII)


def parse_frames(text: str) -> tuple[int, ...]:
    """Numbers of the selected frames, rising.

    Parameters
    ----------
    text
        Numbers and ranges ``first-last`` or ``first-last:step``, separated by commas.

    Raises
    ------
    CameraPathError
        The text is empty or malformed, a range or the list descends, or a frame is named twice.
    """
    numbers: list[int] = []
    for part in text.split(","):
        match = _RANGE.fullmatch(part)
        if match is None:
            raise CameraPathError(
                f"can't read {part.strip()!r} in the frames {text!r}; write them like 1-250, 1,5,9 or 1-250:2"
            )
        first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if step == 0 or last < first:
            raise CameraPathError(f"the range {part.strip()!r} descends, or its step is 0")
        if len(numbers) + (last - first) // step >= MOST_FRAMES:
            raise CameraPathError(f"the frames {text!r} are more than {MOST_FRAMES}")
        numbers.extend(range(first, last + 1, step))
    for a, b in pairwise(numbers):
        if b <= a:
            raise CameraPathError(f"the frames {text!r} must rise, each named once; {b} follows {a}")
    return tuple(numbers)


def ranges(numbers: Sequence[int]) -> str:
    """Rising numbers of frames in the notation of :func:`parse_frames`: ``1-250,300``."""
    firsts = [n for k, n in enumerate(numbers) if k == 0 or numbers[k - 1] != n - 1]
    lasts = [n for k, n in enumerate(numbers) if k + 1 == len(numbers) or numbers[k + 1] != n + 1]
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in zip(firsts, lasts, strict=True))
