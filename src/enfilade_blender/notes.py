# SPDX-License-Identifier: GPL-3.0-or-later
"""Notes on what was baked, approximated and not carried over, by object and node."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass, field
from typing import Literal

Kind = Literal["baked", "approximated", "not-carried"]


@dataclass(frozen=True)
class Note:
    """One deviation from the Blender file.

    Attributes
    ----------
    kind
    object : str
        Name of the object, material, light or world.
    node : str
        Node, socket or setting.
    what : str
        What was done.
    effect : str
        What that means in the picture.
    """

    kind: Kind
    object: str
    node: str
    what: str
    effect: str


@dataclass
class Notes:
    """Notes in the order in which they were made, each once."""

    _notes: dict[Note, None] = field(default_factory=dict)

    def add(self, kind: Kind, owner: str, node: str, what: str, effect: str) -> None:
        """Add a note, unless the same was made before."""
        self._notes[Note(kind, owner, node, what, effect)] = None

    def to_list(self) -> list[dict[str, str]]:
        """Entries of ``import.json``."""
        return [asdict(note) for note in self._notes]


def report_progress(share: float, stage: str) -> None:
    """Write a line of progress: a share from 0 to 1, and the stage that begins."""
    sys.stdout.write(f"progress: {share:.2f} {stage}\n")
    sys.stdout.flush()
