"""Splits of the scenes: those that may be used for tuning, and those that may not."""

from __future__ import annotations

import tomllib
from pathlib import Path

FILE = Path(__file__).resolve().parent / "scenes.toml"
UNLISTED = "not listed"


def split_of(scene: str) -> str:
    """The split of a scene by its name: ``tuning``, ``held-out`` or ``not listed``."""
    for split, scenes in splits().items():
        if scene in scenes:
            return split
    return UNLISTED


def splits() -> dict[str, dict[str, str]]:
    """Descriptions of the scenes by split and name."""
    with FILE.open("rb") as stream:
        return tomllib.load(stream)
