"""The protocol of measures: from frames in order to a number for each, and one for the sequence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from enfilade.comparison.measures.displayed import DisplayedPair


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
