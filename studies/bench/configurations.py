"""Configurations of a bench: the rivals at several spp, and our methods at several settings."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from enfilade.errors import SettingsError
from enfilade.runs.job import Job
from enfilade.settings import (
    SECTIONS,
    OutputSettings,
    ReferenceSettings,
    SampleFilter,
    SamplingSettings,
    Settings,
    read_tables,
)
from studies.bench.rivals import QUALITIES, DenoiserSettings

__all__ = ["FAMILIES", "PRESETS", "Configuration", "Preset", "chosen", "lineup", "read_presets"]

FAMILIES = {  # in the order of tables: title
    "traced": "path tracing",
    "denoised": "path tracing, denoised",
    "interpolated": "minterpolate",
    "paper": "paper",
    "decoupled": "decoupled",
}
METHODS = ("paper", "decoupled")
RIVALS = {
    "traced": "reference",
    "denoised": "studies.bench.rivals:Denoised",
    "interpolated": "studies.bench.rivals:Interpolated",
}


@dataclass(frozen=True)
class Preset:
    """One of our methods at one setting.

    Attributes
    ----------
    name : str
    method : {"paper", "decoupled"}
    settings : mapping
        Tables, as in a TOML file, that differ from the bench's settings.
    """

    name: str
    method: str
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


PRESETS = (
    Preset("paper-16", "paper", {"sampling": {"spp": 16}}),
    Preset("paper-64", "paper", {"sampling": {"spp": 64}}),
    *(
        Preset(f"decoupled-{quality:g}", "decoupled", {"decoupled": {"quality": quality}})
        for quality in (60.0, 30.0, 15.0, 8.0, 4.0)
    ),
)


@dataclass(frozen=True, eq=False)
class Configuration:
    """A method with its settings.

    Attributes
    ----------
    name : str
        Also of its run folder.
    family : str
        One of :data:`FAMILIES`: its configurations make one curve.
    job : Job
    variant : str
        Distinguishes it from another of its family with as many spp: the denoiser's quality.
    """

    name: str
    family: str
    job: Job
    variant: str = ""

    @property
    def is_rival(self) -> bool:
        """Whether it is not one of our methods."""
        return self.family in RIVALS

    @property
    def pixel_filter(self) -> SampleFilter:
        """That of its reference."""
        return SampleFilter.BOX if self.family == "denoised" else SampleFilter.GAUSSIAN


def lineup(
    job: Job, *, traced: Iterable[int], denoised: Iterable[int], presets: Sequence[Preset]
) -> list[Configuration]:
    """All configurations.

    Parameters
    ----------
    job
        Scene, path, and the settings from which the presets differ.
    traced, denoised
        The spp of path tracing every frame. Interpolated keyframes have the largest of `traced`.
    presets

    Raises
    ------
    SettingsError
        A preset has a setting that does not exist, or is out of range.
    """
    spps = sorted(set(traced))
    found = [_rival("traced", f"traced-{n}", job, n) for n in spps]
    for n in sorted(set(denoised)):
        for quality in QUALITIES:
            name = f"denoised-{n}" if quality == QUALITIES[0] else f"denoised-{n}-{quality}"
            found.append(_rival("denoised", name, job, n, quality))
    if spps:
        found.append(_rival("interpolated", f"minterpolate-{spps[-1]}", job, spps[-1]))
    for preset in presets:
        settings = _overridden(job.settings, preset.settings)
        ours = replace(job, method=preset.method, settings=settings)
        found.append(Configuration(preset.name, preset.method, ours))
    return found


def chosen(configurations: Sequence[Configuration], patterns: Sequence[str]) -> list[Configuration]:
    """Those whose names match a pattern, such as ``decoupled-*``; all without patterns.

    Raises
    ------
    SettingsError
        A pattern matches none.
    """
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(c.name, pattern) for c in configurations):
            names = ", ".join(c.name for c in configurations)
            raise SettingsError(f"no configuration is called {pattern!r}; there are: {names}")
    return [
        c for c in configurations if not patterns or any(fnmatch.fnmatchcase(c.name, p) for p in patterns)
    ]


def read_presets(file: Path) -> tuple[Preset, ...]:
    """Presets of a TOML file: a table for each, with ``method`` and tables of settings.

    Raises
    ------
    SettingsError
        It can't be read, or holds something else.
    """
    found = []
    for name, table in read_tables(file).items():
        if not isinstance(table, dict) or table.get("method") not in METHODS:
            raise SettingsError(f"{file}: [{name}] needs method = one of {', '.join(METHODS)}")
        if not name.replace("-", "").replace("_", "").isalnum():
            raise SettingsError(f"{file}: {name!r} can't name a folder; take letters, digits, - and _")
        found.append(Preset(name, table.pop("method"), table))
    if not found:
        raise SettingsError(f"{file} holds no preset")
    return tuple(found)


def _rival(family: str, name: str, job: Job, spp: int, quality: str = "") -> Configuration:
    settings = job.settings.replace(SamplingSettings, spp=spp).replace(OutputSettings, layers="none")
    if family == "denoised":
        settings = settings.replace(ReferenceSettings, pixel_filter=SampleFilter.BOX)
        settings = settings.replace(DenoiserSettings, quality=quality)
    return Configuration(name, family, replace(job, method=RIVALS[family], settings=settings), quality)


def _overridden(settings: Settings, tables: Mapping[str, Mapping[str, Any]]) -> Settings:
    whole: dict[str, Any] = settings.to_tables(SECTIONS)
    return Settings.from_tables(whole | {name: whole.get(name, {}) | table for name, table in tables.items()})
