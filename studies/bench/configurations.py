"""Configurations of a bench: baselines at several spp, and enfilade's methods at several settings."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from enfilade.camera import CameraPath
from enfilade.errors import SettingsError
from enfilade.runs.job import Job
from enfilade.settings import (
    OutputSettings,
    ReferenceSettings,
    SampleFilter,
    SamplingSettings,
    Settings,
    TraceSettings,
)
from studies.bench.baselines import VARIANTS, DenoiserSettings

FAMILIES = {  # in the order of tables: title
    "traced": "path tracing",
    "denoised": "path tracing, denoised",
    "paper": "paper",
    "decoupled": "decoupled",
}
BASELINES = {
    "traced": "reference",
    "denoised": "studies.bench.baselines:Denoised",
}
NO_SPLITS = {"split_percent": 100.0}
PRESETS: dict[str, tuple[str, dict[str, dict[str, Any]]]] = {  # of enfilade's methods: settings that differ
    "paper-16": ("paper", {"sampling": {"spp": 16}}),
    "paper-16-unsplit": ("paper", {"sampling": {"spp": 16}, "masks": NO_SPLITS}),
    **{
        f"paper-16-uniform-{spacing}": (
            "paper",
            {
                "sampling": {"spp": 16},
                "keyframes": {"placement": "uniform", "spacing": spacing},
                "masks": NO_SPLITS,
            },
        )
        for spacing in (25, 12, 6)
    },
    **{
        f"decoupled-{quality:g}": ("decoupled", {"decoupled": {"quality": quality}})
        for quality in (60.0, 15.0, 10.0, 8.0)
    },
}
EXPECTED_SPP = 8


@dataclass(frozen=True, eq=False)
class Configuration:
    """A method with its settings.

    Attributes
    ----------
    name : str
        Name, also of the run folder.
    family : str
        One of :data:`FAMILIES`; its configurations form one curve.
    job : Job
    variant : str
        Of the denoised baseline: a name in :data:`VARIANTS`; empty for others.
    """

    name: str
    family: str
    job: Job
    variant: str = ""

    @property
    def is_baseline(self) -> bool:
        """Whether it is a baseline, instead of one of enfilade's methods."""
        return self.family in BASELINES

    @property
    def spp(self) -> int:
        """Paths a pixel, for methods that trace whole pixels."""
        return self.job.settings[SamplingSettings].spp

    @property
    def seed(self) -> int:
        """Seed of its random numbers."""
        return self.job.settings[TraceSettings].seed

    @property
    def expected_spp(self) -> int:
        """Rough number of paths a pixel, for forecasts: methods that reuse light trace about eight."""
        return self.spp if self.family in ("traced", "denoised") else EXPECTED_SPP

    @property
    def pixel_filter(self) -> SampleFilter:
        """Pixel filter of its reference."""
        return SampleFilter.BOX if self.family == "denoised" else SampleFilter.GAUSSIAN


def all_configurations(
    job: Job, *, traced: Iterable[int], denoised: Iterable[int], walkthrough: CameraPath | None = None
) -> list[Configuration]:
    """All configurations: baselines at the given spp, and the presets applied to the job's settings.

    Parameters
    ----------
    job
        Of the measured frames.
    traced, denoised
        Paths a pixel.
    walkthrough
        Frames of the configurations that share data between frames, the measured ones among them; by default
        these alone.
    """
    whole = replace(job, path=walkthrough or job.path)
    found = [_baseline("traced", f"traced-{n}", job, n) for n in sorted(set(traced))]
    for n in sorted(set(denoised)):
        for variant in VARIANTS:
            name = f"denoised-{n}-{variant}".removesuffix("-")
            frames = whole if "accumulated" in variant else job
            found.append(_baseline("denoised", name, frames, n, variant))
    for name, (method, tables) in PRESETS.items():
        preset = replace(whole, method=method, settings=_overridden(job.settings, tables))
        found.append(Configuration(name, method, preset))
    return found


def with_seeds(one: Configuration, count: int) -> list[Configuration]:
    """A configuration, and copies with the next seeds, whose names end with ``-seed-SEED``."""
    others = range(one.seed + 1, one.seed + count)
    return [
        one,
        *(
            replace(
                one,
                name=f"{one.name}-seed-{seed}",
                job=replace(one.job, settings=one.job.settings.replace(TraceSettings, seed=seed)),
            )
            for seed in others
        ),
    ]


def selected(configurations: Sequence[Configuration], patterns: Sequence[str]) -> list[Configuration]:
    """Configurations whose names match a pattern, such as ``decoupled-*``; all without patterns."""
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(c.name, pattern) for c in configurations):
            names = ", ".join(c.name for c in configurations)
            raise SettingsError(f"no configuration is called {pattern!r}; there are: {names}")
    return [
        c for c in configurations if not patterns or any(fnmatch.fnmatchcase(c.name, p) for p in patterns)
    ]


def _baseline(family: str, name: str, job: Job, spp: int, variant: str = "") -> Configuration:
    settings = job.settings.replace(SamplingSettings, spp=spp).replace(OutputSettings, layers="none")
    if family == "denoised":
        settings = settings.replace(ReferenceSettings, pixel_filter=SampleFilter.BOX)
        settings = settings.replace(DenoiserSettings, **VARIANTS[variant])
    return Configuration(name, family, replace(job, method=BASELINES[family], settings=settings), variant)


def _overridden(settings: Settings, tables: Mapping[str, Mapping[str, Any]]) -> Settings:
    whole: dict[str, Any] = settings.to_tables()
    return Settings.from_tables(whole | {name: whole[name] | dict(table) for name, table in tables.items()})
