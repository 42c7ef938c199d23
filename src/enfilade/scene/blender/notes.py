"""Parts of a file that are not as they were: baked, approximated, or not carried over."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from enfilade.scene.blender.process import printable

LISTED = 4  # objects of a group


class NoteKind(Enum):
    """How a part of the file was carried over; one that is as it was has no note."""

    BAKED = "baked"
    APPROXIMATED = "approximated"
    NOT_CARRIED = "not-carried"


@dataclass(frozen=True)
class Note:
    """A part of the file, and how it was carried over.

    Attributes
    ----------
    kind : NoteKind
    object, node : str
        Names in the file; a node's is empty where it is none.
    what : str
    effect : str
        What it means in the picture.
    """

    kind: NoteKind
    object: str
    node: str
    what: str
    effect: str

    @staticmethod
    def from_json(table: Mapping[str, Any]) -> Note:
        """Read back from the importer's table; ValueError, LookupError or TypeError if it is none."""
        texts = [printable(str(table[key] or "")) for key in ("object", "node", "what", "effect")]
        return Note(NoteKind(table["kind"]), *texts)

    def to_json(self) -> dict[str, str]:
        """As the importer writes it."""
        values = {"object": self.object, "node": self.node, "what": self.what, "effect": self.effect}
        return {"kind": self.kind.value, **values}

    @property
    def place(self) -> str:
        """The object, and the node if there is one."""
        return " / ".join(filter(None, (self.object, self.node)))


TITLES = {
    NoteKind.NOT_CARRIED: "not carried over",
    NoteKind.APPROXIMATED: "approximated",
    NoteKind.BAKED: "baked",
}


@dataclass(frozen=True)
class NoteGroup:
    """Notes that say the same of several objects.

    Attributes
    ----------
    kind : NoteKind
    places : tuple of str
        Object and node of each.
    what, effect : str
    """

    kind: NoteKind
    places: tuple[str, ...]
    what: str
    effect: str

    @property
    def listed(self) -> str:
        """The places; of many, the first ones."""
        more = len(self.places) - LISTED
        return ", ".join(self.places[:LISTED]) + (f" and {more} more" if more > 0 else "")


def grouped(notes: Iterable[Note]) -> list[NoteGroup]:
    """Notes by kind, that which matters most first, and by what they say."""
    groups: dict[tuple[NoteKind, str, str], list[str]] = {}
    for note in notes:
        groups.setdefault((note.kind, note.what, note.effect), []).append(note.place)
    made = [
        NoteGroup(kind, tuple(dict.fromkeys(places)), what, effect)
        for (kind, what, effect), places in groups.items()
    ]
    order = list(TITLES)
    return sorted(made, key=lambda group: order.index(group.kind))
