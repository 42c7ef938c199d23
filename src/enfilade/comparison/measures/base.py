"""The protocol of measures: from frames in order to a number for each, and one for the sequence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from enfilade.comparison.measures.displayed import DisplayedPair


@dataclass(frozen=True)
class Scale:
    """The scale of a measure.

    Attributes
    ----------
    name : str
        Short, for files and programs.
    title : str
        For tables and charts.
    unit : str
    is_more_better : bool
    error_of : callable
        Maps a score to an error, 0 or more, 0 for identical sequences, which is interpolated on a
        logarithmic axis.
    """

    name: str
    title: str
    unit: str
    is_more_better: bool = False
    error_of: Callable[[float], float] = float


class Measure(Protocol):
    """Measures the difference of two sequences; a new instance for each pair of sequences."""

    @property
    def name(self) -> str:
        """Short name, of the result."""
        ...

    def measure(self, pair: DisplayedPair) -> float | None:
        """Measure the next frame; None where it has no value of its own."""
        ...

    def pool(self, values: Sequence[float | None]) -> float:
        """The result for the sequence, from the values of its frames."""
        ...
