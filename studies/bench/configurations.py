"""Configurations of a bench: baselines at several spp, and enfilade's methods at several settings."""

from __future__ import annotations

import re
from collections.abc import Mapping
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

BASELINES = {
    "traced": "reference",
    "denoised": "studies.bench.baselines:Denoised",
}
SMALL = (
    *(f"denoised-{name}" for name in ("8", "16", "32", "32-followed", "64", "128", "8-accumulated-after")),
    "decoupled-60", "decoupled-10",
)  # fmt: skip
LARGE = ("denoised-8", "denoised-32", "decoupled-60", "decoupled-10")
LARGE_PX = 500_000  # from this size on, few configurations
NAME = re.compile(r"(traced|denoised|paper|decoupled)-(\d+(?:\.\d+)?)(?:-(.+))?")
SEGMENTS = re.compile(r"unsplit|uniform-(\d+)")  # of paper: without refinement
FORMS = (
    "traced-N, denoised-N, {variants}, paper-N, paper-N-unsplit, paper-N-uniform-S and decoupled-Q, "
    "with N paths a pixel, keyframes every S frames, and --quality Q"
)
EXPECTED_SPP = {"paper": 16, "decoupled": 32}  # in CPU time, for forecasts


@dataclass(frozen=True, eq=False)
class Configuration:
    """A method with its settings.

    Attributes
    ----------
    name : str
        Name, also of the run folder.
    family : str
        ``traced``, ``denoised``, ``paper`` or ``decoupled``; its configurations form one curve.
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
        """Number of paths a pixel that cost about as much, for forecasts."""
        return EXPECTED_SPP.get(self.family, self.spp)

    @property
    def pixel_filter(self) -> SampleFilter:
        """Pixel filter of its reference."""
        return SampleFilter.BOX if self.family == "denoised" else SampleFilter.GAUSSIAN


def default_names(pixels: int) -> tuple[str, ...]:
    """Names of the usual configurations for images of a number of pixels."""
    return LARGE if pixels >= LARGE_PX else SMALL


def configuration(name: str, job: Job, walkthrough: CameraPath | None = None) -> Configuration:
    """The configuration of a name.

    Parameters
    ----------
    name
        See :data:`FORMS`.
    job
        Of the measured frames.
    walkthrough
        Frames of a configuration that shares data between frames, the measured ones among them; by default
        these alone.

    Raises
    ------
    SettingsError
        There is none of that name, or the job's settings and its own contradict.
    """
    matched = NAME.fullmatch(name)
    family, number, variant = matched.groups("") if matched else ("", "", "")
    is_paths = number.isdigit() and int(number) > 0
    whole = replace(job, path=walkthrough or job.path)
    match family:
        case "traced" if is_paths and not variant:
            return _baseline(name, family, job, int(number))
        case "denoised" if is_paths and variant in VARIANTS:
            frames = whole if "accumulated" in variant else job
            return _baseline(name, family, frames, int(number), variant)
        case "paper" if is_paths and (not variant or SEGMENTS.fullmatch(variant)):
            return _method(name, family, whole, {"sampling": {"spp": int(number)}, **_segments(variant)})
        case "decoupled" if not variant:
            return _method(name, family, whole, {"decoupled": {"quality": float(number)}})
    variants = ", ".join(f"denoised-N-{of}" for of in VARIANTS if of)
    raise SettingsError(f"no configuration is called {name!r}; there are {FORMS.format(variants=variants)}")


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


def _baseline(name: str, family: str, job: Job, spp: int, variant: str = "") -> Configuration:
    settings = job.settings.replace(SamplingSettings, spp=spp).replace(OutputSettings, layers="none")
    if family == "denoised":
        settings = settings.replace(ReferenceSettings, pixel_filter=SampleFilter.BOX)
        settings = settings.replace(DenoiserSettings, **VARIANTS[variant])
    return Configuration(name, family, replace(job, method=BASELINES[family], settings=settings), variant)


def _method(name: str, family: str, job: Job, tables: Mapping[str, Mapping[str, Any]]) -> Configuration:
    """One of enfilade's methods, with settings that differ from the job's."""
    whole: dict[str, Any] = job.settings.to_tables()
    settings = Settings.from_tables(whole | {of: whole[of] | dict(table) for of, table in tables.items()})
    return Configuration(name, family, replace(job, method=family, settings=settings))


def _segments(variant: str) -> dict[str, dict[str, Any]]:
    """Settings of the paper's keyframes: without refinement, by Eq. 6 or uniform."""
    if not variant:
        return {}
    _, _, spacing = variant.partition("uniform-")
    uniform = {"keyframes": {"placement": "uniform", "spacing": int(spacing)}} if spacing else {}
    return {"masks": {"split_percent": 100.0}, **uniform}
