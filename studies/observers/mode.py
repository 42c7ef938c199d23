"""A mode of the metric under validation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enfilade.metric import Aqm
from enfilade.viewing import Viewing


@dataclass(frozen=True)
class Mode:
    """A mode of the metric.

    Attributes
    ----------
    name : str
        For tables.
    aqm : callable
        Constructor of the metric for a viewing condition.
    """

    name: str
    aqm: Callable[[Viewing], Aqm]


PAPER = Mode("paper", Aqm.paper)
MODERN = Mode("modern", Aqm.modern)
