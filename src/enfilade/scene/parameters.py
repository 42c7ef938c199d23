"""Parameters of a Mitsuba scene, ``<default>`` and ``$name``, filled in as Mitsuba's parser does it."""

from __future__ import annotations

import re
from bisect import insort
from dataclasses import dataclass, field

__all__ = ["Parameters"]

UNESCAPED = re.compile(r"(?<!\\)\$")
MOST = 1000  # parameters of a scene
LONGEST = 1_000_000  # characters of a value that is filled in: values within values grow without bound


@dataclass(eq=False)
class Parameters:
    r"""Values of a scene's parameters, so far as it has been read.

    A name is whatever ``<default>`` says, other characters than letters included. In a text the longest
    name is filled in first, wherever it stands and whatever follows it; in what that gives, the next one,
    and so on. ``\$`` is a dollar sign, for one that is being filled in as well. This is what
    ``substitute_parameters`` of Mitsuba 3.9 (src/core/parser.cpp) does: a scene in which we saw another
    name than Mitsuba does would be judged by files that Mitsuba doesn't open.
    """

    values: dict[str, str] = field(default_factory=dict)
    _names: list[str] = field(default_factory=list)  # the longest first, then in the order of the file

    def define(self, name: str, value: str) -> None:
        """Give a parameter its value, if it has none; the first ``<default>`` counts.

        Raises
        ------
        ValueError
            The name is empty, or there are too many.
        """
        if not name:
            raise ValueError("a <default> without a name")
        if name in self.values:
            return
        if len(self.values) == MOST:
            raise ValueError(f"more than {MOST} parameters")
        self.values[name] = value
        insort(self._names, name, key=lambda known: -len(known.encode()))  # Mitsuba counts bytes

    def filled(self, text: str) -> str:
        """Text with the values of its parameters.

        Raises
        ------
        ValueError
            A parameter has no value yet, or the text becomes too long.
        """
        if "$" not in text:
            return text
        filled = text
        for name in self._names:
            if f"${name}" in filled:
                filled = _replaced(filled, f"${name}", self.values[name])
        if UNESCAPED.search(filled):
            raise ValueError(f"a parameter of {text!r} has no <default> before it")
        return filled.replace(r"\$", "$")


def _replaced(text: str, key: str, value: str) -> str:
    first, *others = text.split(key)
    if len(text) + len(others) * len(value) > LONGEST:
        raise ValueError(f"a value of more than {LONGEST} characters when its parameters are filled in")
    pieces, last = [first], first[-1:]
    for other in others:
        for piece in (key if last == "\\" else value, other):
            pieces.append(piece)
            last = piece[-1:] or last
    return "".join(pieces)
