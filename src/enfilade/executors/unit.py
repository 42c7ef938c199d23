"""A unit of work: what is finished, recorded, lost and done again as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, eq=False)
class Unit:
    """A piece of a run.

    Attributes
    ----------
    name : str
        As the ledger knows it, the same in every run of the same work.
    kind : str
        What is to be done.
    facts : mapping
        What who does it needs to know, fit for JSON.
    needs : tuple of str
        Names of units that must be finished before.
    order : tuple of int
        Units that are ready are begun in this order; the first number is the stage.
    group : str
        Units of one group are best done by one worker: they share what is in memory.
    stage : str
        Under which it is counted while a run is watched; empty: it says itself how far it is.
    is_gate : bool
        Nothing is to be done: finished when all that it needs is.
    """

    name: str
    kind: str
    facts: Mapping[str, Any] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    order: tuple[int, ...] = ()
    group: str = ""
    stage: str = ""
    is_gate: bool = False
