"""Camps of scenes: those that may choose constants of the methods, and those that may not."""

from __future__ import annotations

import tomllib
from pathlib import Path

FILE = Path(__file__).resolve().parent / "scenes.toml"
UNLISTED = "not listed"


def camp_of(scene: str) -> str:
    """The camp of a scene by its name: ``tuning``, ``held-out`` or ``not listed``."""
    for camp, scenes in camps().items():
        if scene in scenes:
            return camp
    return UNLISTED


def camps() -> dict[str, dict[str, str]]:
    """Descriptions of the scenes by camp and name."""
    with FILE.open("rb") as stream:
        return tomllib.load(stream)
