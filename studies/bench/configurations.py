"""Configurations of a bench: the rivals at several spp, and our methods at several settings."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from enfilade.errors import SettingsError
from enfilade.runs.job import Job
from enfilade.settings import OutputSettings, ReferenceSettings, SampleFilter, SamplingSettings, Settings
from studies.bench.rivals import QUALITIES, DenoiserSettings

FAMILIES = {  # in the order of tables: title
    "traced": "path tracing",
    "denoised": "path tracing, denoised",
    "interpolated": "minterpolate",
    "paper": "paper",
    "decoupled": "decoupled",
}
RIVALS = {
    "traced": "reference",
    "denoised": "studies.bench.rivals:Denoised",
    "interpolated": "studies.bench.rivals:Interpolated",
}
PRESETS: dict[str, tuple[str, dict[str, dict[str, Any]]]] = {  # of our methods: tables that differ
    **{f"paper-{spp}": ("paper", {"sampling": {"spp": spp}}) for spp in (16, 64)},
    **{
        f"decoupled-{quality:g}": ("decoupled", {"decoupled": {"quality": quality}})
        for quality in (60.0, 30.0, 15.0, 8.0, 4.0)
    },
}


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
    def spp(self) -> int:
        """Paths traced for a pixel, where the method traces whole pixels."""
        return self.job.settings[SamplingSettings].spp

    @property
    def pixel_filter(self) -> SampleFilter:
        """That of its reference."""
        return SampleFilter.BOX if self.family == "denoised" else SampleFilter.GAUSSIAN


def lineup(job: Job, *, traced: Iterable[int], denoised: Iterable[int]) -> list[Configuration]:
    """All configurations: rivals at the given spp, and our presets, which differ from the job's settings.

    Interpolated keyframes have the largest spp of `traced`.
    """
    spps = sorted(set(traced))
    found = [_rival("traced", f"traced-{n}", job, n) for n in spps]
    for n in sorted(set(denoised)):
        for quality in QUALITIES:
            name = f"denoised-{n}" if quality == QUALITIES[0] else f"denoised-{n}-{quality}"
            found.append(_rival("denoised", name, job, n, quality))
    if spps:
        found.append(_rival("interpolated", f"minterpolate-{spps[-1]}", job, spps[-1]))
    for name, (method, tables) in PRESETS.items():
        ours = replace(job, method=method, settings=_overridden(job.settings, tables))
        found.append(Configuration(name, method, ours))
    return found


def chosen(configurations: Sequence[Configuration], patterns: Sequence[str]) -> list[Configuration]:
    """Those whose names match a pattern, such as ``decoupled-*``; all without patterns."""
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(c.name, pattern) for c in configurations):
            names = ", ".join(c.name for c in configurations)
            raise SettingsError(f"no configuration is called {pattern!r}; there are: {names}")
    return [
        c for c in configurations if not patterns or any(fnmatch.fnmatchcase(c.name, p) for p in patterns)
    ]


def _rival(family: str, name: str, job: Job, spp: int, quality: str = "") -> Configuration:
    settings = job.settings.replace(SamplingSettings, spp=spp).replace(OutputSettings, layers="none")
    if family == "denoised":
        settings = settings.replace(ReferenceSettings, pixel_filter=SampleFilter.BOX)
        settings = settings.replace(DenoiserSettings, quality=quality)
    return Configuration(name, family, replace(job, method=RIVALS[family], settings=settings), quality)


def _overridden(settings: Settings, tables: Mapping[str, Mapping[str, Any]]) -> Settings:
    whole: dict[str, Any] = settings.to_tables()
    return Settings.from_tables(whole | {name: whole[name] | dict(table) for name, table in tables.items()})
