"""Frame selections such as ``1-250``, ``1,5,9`` and ``1-250:2``.

The notation is that of Blender's command line and of Open Job Description's range expressions: both
ends belong to a range, a step follows a colon, commas combine, and numbers may be negative
(``-5--1``). Other than there, numbers must rise from left to right: a walkthrough has one direction.
"""

from __future__ import annotations

import re
from itertools import pairwise

from enfilade.errors import CameraPathError

MOST_FRAMES = 1_000_000  # nine hours at 30 fps; beyond it a typing error is likelier

_ELEMENT = re.compile(r"\s*(-?[0-9]{1,18})(?:\s*-\s*(-?[0-9]{1,18})(?:\s*:\s*([0-9]{1,18}))?)?\s*")
_EXAMPLES = "write it like 1-250, 1,5,9 or 1-250:2"


def parse_frames(text: str) -> tuple[int, ...]:
    """Numbers of the selected frames, rising.

    Parameters
    ----------
    text
        Numbers and ranges ``first-last`` or ``first-last:step``, separated by commas; the last number
        belongs to its range where the step meets it.

    Raises
    ------
    CameraPathError
        The text is empty or malformed, a range or the list descends, or a frame is named twice.
    """
    if not text.strip():
        raise CameraPathError(f"the selection of frames is empty; {_EXAMPLES}")
    numbers: list[int] = []
    for element in text.split(","):
        numbers.extend(_element(element, text))
        if len(numbers) > MOST_FRAMES:
            raise CameraPathError(f"the frames {text!r} are more than {MOST_FRAMES}")
    for a, b in pairwise(numbers):
        if b == a:
            raise CameraPathError(f"the frames {text!r} name frame {a} twice")
        if b < a:
            raise CameraPathError(
                f"the frames {text!r} must rise: {b} follows {a}; name each frame once, in order"
            )
    return tuple(numbers)


def _element(element: str, text: str) -> range:
    match = _ELEMENT.fullmatch(element)
    if match is None:
        raise CameraPathError(f"can't read {element.strip()!r} in the frames {text!r}; {_EXAMPLES}")
    first = int(match[1])
    last = first if match[2] is None else int(match[2])
    step = 1 if match[3] is None else int(match[3])
    if step == 0:
        raise CameraPathError(f"the step in {element.strip()!r} is 0; it must be 1 or more")
    if last < first:
        raise CameraPathError(
            f"the range {element.strip()!r} descends; write the smaller number first: {last}-{first}"
        )
    if (last - first) // step >= MOST_FRAMES:
        raise CameraPathError(f"the frames {text!r} are more than {MOST_FRAMES}")
    return range(first, last + 1, step)
