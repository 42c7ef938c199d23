"""Who takes part: the rivals at several numbers of paths, and our methods at several settings."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from enfilade.errors import SettingsError
from enfilade.pipeline.job import Job
from enfilade.renderer import PixelFilter
from enfilade.settings import Settings, read_tables

__all__ = [
    "DENOISED_SPP",
    "FAMILIES",
    "PRESETS",
    "TRACED_SPP",
    "Contestant",
    "Preset",
    "lineup",
    "read_presets",
]

TRACED_SPP = (4, 16, 64, 256)
DENOISED_SPP = (1, 2, 4, 8, 16, 32)
DENOISER_QUALITIES = ("high", "fast")  # its best, and five times cheaper, which pays at few paths
FAMILIES = {  # in the order in which they are shown: name, for people
    "traced": "path tracing",
    "denoised": "path tracing, denoised",
    "interpolated": "minterpolate",
    "paper": "paper",
    "decoupled": "decoupled",
}
METHODS = ("paper", "decoupled")


@dataclass(frozen=True)
class Preset:
    """One of our methods at one setting.

    Attributes
    ----------
    name : str
    method : {"paper", "decoupled"}
    settings : mapping
        What differs from the bench's settings: tables as in a TOML file.
    """

    name: str
    method: str
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


QUALITIES = (60.0, 30.0, 15.0, 8.0, 4.0)
PRESETS = (
    Preset("paper-16", "paper", {"trace": {"spp": 16}}),
    Preset("paper-64", "paper", {"trace": {"spp": 64}}),
    *(
        Preset(f"decoupled-{quality:g}", "decoupled", {"light": {"quality": quality}})
        for quality in QUALITIES
    ),
)


@dataclass(frozen=True, eq=False)
class Contestant:
    """Who renders the walkthrough, and how.

    Attributes
    ----------
    name : str
        Also that of its folder.
    family : str
        One of :data:`FAMILIES`: its contestants make one curve.
    job : Job
    pixel_filter : PixelFilter
        That of its reference.
    variant : str
        What sets it apart from another of its family with as many paths: the denoiser's quality.
    """

    name: str
    family: str
    job: Job
    pixel_filter: PixelFilter = PixelFilter.GAUSSIAN
    variant: str = ""

    def setting(self) -> dict[str, Any]:
        """What its frames depend on, beside scene and path: plain values for JSON."""
        tables = self.job.settings.to_tables()
        if self.family in METHODS:
            return {"method": self.job.method, **tables}
        kept = {"trace": tables["trace"], "variant": self.variant}
        return {**kept, "keyframes": tables["keyframes"]} if self.family == "interpolated" else kept

    def task(self) -> Any:
        """What it does: a `tasks.Task`."""
        from studies.bench.tasks import EveryFrame, Interpolated, Own

        match self.family:
            case "traced":
                return EveryFrame(self.job, self.pixel_filter)
            case "denoised":
                return EveryFrame(self.job, self.pixel_filter, self.variant)
            case "interpolated":
                return Interpolated(self.job)
            case _:
                return Own(self.job)


def lineup(
    job: Job, *, traced: Iterable[int], denoised: Iterable[int], presets: Sequence[Preset]
) -> list[Contestant]:
    """Everybody who may take part.

    Parameters
    ----------
    job
        Scene, path, and the settings from which the presets differ.
    traced, denoised
        Paths a pixel, of path tracing every frame. What FFmpeg interpolates has the most of `traced`.
    presets

    Raises
    ------
    SettingsError
        A preset asks for what there is not.
    """
    spps = sorted(set(traced))
    found = [Contestant(f"traced-{n}", "traced", _with_spp(job, n)) for n in spps]
    for n in sorted(set(denoised)):
        for quality in DENOISER_QUALITIES:
            name = f"denoised-{n}" if quality == DENOISER_QUALITIES[0] else f"denoised-{n}-{quality}"
            found.append(Contestant(name, "denoised", _with_spp(job, n), PixelFilter.BOX, quality))
    if spps:
        found.append(Contestant(f"minterpolate-{spps[-1]}", "interpolated", _with_spp(job, spps[-1])))
    return found + [Contestant(p.name, p.method, _preset_job(job, p)) for p in presets]


def chosen(contestants: Sequence[Contestant], patterns: Sequence[str]) -> list[Contestant]:
    """Those whose names match a pattern, such as ``decoupled-*``; all where there is none.

    Raises
    ------
    SettingsError
        A pattern matches nobody.
    """
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(c.name, pattern) for c in contestants):
            names = ", ".join(c.name for c in contestants)
            raise SettingsError(f"no contestant is called {pattern!r}; there are: {names}")
    return [c for c in contestants if not patterns or any(fnmatch.fnmatchcase(c.name, p) for p in patterns)]


def read_presets(file: Path) -> tuple[Preset, ...]:
    """Presets of a TOML file: a table for each, ``method`` and the tables of settings in it.

    Raises
    ------
    SettingsError
        It can't be read, or holds something else.
    """
    found = []
    for name, table in read_tables(file).items():
        if not isinstance(table, dict) or table.get("method") not in METHODS:
            raise SettingsError(f"{file}: [{name}] needs method = one of {', '.join(METHODS)}")
        if not name or not all(letter.isalnum() or letter in "-_." for letter in name) or name[0] == ".":
            raise SettingsError(f"{file}: {name!r} is no name for a folder; take letters, digits, - and _")
        rest = {key: value for key, value in table.items() if key != "method"}
        found.append(Preset(name, table["method"], rest))
    if not found:
        raise SettingsError(f"{file} holds no preset")
    return tuple(found)


def _with_spp(job: Job, spp: int) -> Job:
    return replace(job, method="reference", settings=_overridden(job.settings, {"trace": {"spp": spp}}))


def _preset_job(job: Job, preset: Preset) -> Job:
    return replace(job, method=preset.method, settings=_overridden(job.settings, preset.settings))


def _overridden(settings: Settings, tables: Mapping[str, Any]) -> Settings:
    whole: dict[str, Any] = settings.to_tables()
    for section, table in tables.items():
        whole[section] = {**whole.get(section, {}), **table} if isinstance(table, Mapping) else table
    return Settings.from_tables(whole)
