"""What all judges share: frames in order go in, one number a frame and one for all come out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from enfilade.comparison.measures.shown import Shown

__all__ = ["Judge", "Scale"]


@dataclass(frozen=True)
class Scale:
    """The scale on which a judge gives its numbers.

    Attributes
    ----------
    name : str
        Short, for files and programs.
    title : str
        For people.
    unit : str
    is_more_better : bool
    error_of : callable
        From a score to an error, 0 or more, 0 for identical sequences: what is compared and
        interpolated on a logarithmic axis, whichever way the score goes.
    is_of_changes : bool
        Whether only a frame with one before it in its shot has a number: without any such frame the
        score was measured by nobody.
    """

    name: str
    title: str
    unit: str
    is_more_better: bool = False
    error_of: Callable[[float], float] = float
    is_of_changes: bool = False


class Judge(Protocol):
    """Judges the frames of a sequence in order; made anew for each sequence."""

    def judge(self, pair: Shown) -> float | None:
        """Judge the next frame; None where there is nothing to say of it alone (a first frame)."""
        ...

    def pooled(self, values: Sequence[float | None]) -> float:
        """One number for a sequence from what :meth:`judge` said of its frames."""
        ...
