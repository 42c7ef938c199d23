"""The bench: references, contestants, judges, in one folder that can be gone on with.

::

    run.json  ledger.jsonl       what is compared; what is finished
    references/reference-gaussian/  reference-box/   run folders, with layers
    contestants/NAME/            a run folder each
    spent/NAME/0000.json         what each session of a contestant has spent
    bench.json  bench.png  crops.png
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from enfilade.comparison.measures import JUDGES, SCALES, why_missing
from enfilade.device import Choice
from enfilade.errors import RunFolderError, SceneError, SettingsError
from enfilade.methods.denoise import why_no_denoiser
from enfilade.monitor import Monitor
from enfilade.pipeline.job import ANALYTIC_SUFFIX, Job, path_identity
from enfilade.renderer import PixelFilter
from enfilade.scene.scenefile import fingerprint
from enfilade.settings import Settings
from enfilade.store import Run
from studies.bench.contestants import FAMILIES, Contestant
from studies.bench.interpolate import why_no_interpolation
from studies.bench.judging import judge, without_silent
from studies.bench.machine import machine, versions
from studies.bench.race import race
from studies.bench.verdict import verdict

__all__ = ["Terms", "bench", "forecast_s"]

FORMAT = 1  # of bench.json
PATHS_PER_CPU_S = (
    1.0e6  # a path of a furnished room on one core of 2026; for a rough forecast and nothing else
)


@dataclass(frozen=True)
class Terms:
    """How the bench is held.

    Attributes
    ----------
    reference_spp : int
        Paths a pixel of the references. Their own noise is a floor under every error.
    judges : tuple of str
        Names; empty: all that can be had here.
    redo : tuple of str
        Names of contestants to begin anew.
    reference_device
        For the kernels of references, whose cost is nobody's concern. Contestants run on the CPU.
    """

    reference_spp: int
    judges: tuple[str, ...] = ()
    redo: tuple[str, ...] = ()
    reference_device: Choice = "auto"


def bench(
    job: Job, contestants: Sequence[Contestant], terms: Terms, folder: Path, monitor: Monitor
) -> dict[str, Any]:
    """Hold the bench, or go on with it.

    Finished contestants and finished verdicts are not done again; an unfinished contestant goes on at its
    first missing frame. One process works at a time, so that the times are those of a machine that does
    nothing else.

    Parameters
    ----------
    job
        Scene, path and settings; its method is not looked at.
    contestants
    terms
    folder
        Made if it is not there.
    monitor

    Returns
    -------
    dict
        What ``bench.json`` holds too; `docs/bench.md` describes it.

    Raises
    ------
    InputError
        The scene, the settings, or a folder that holds another bench.
    SettingsError
        A judge that was asked for by name can't be had here; none has anything to say of these frames; no
        contestant can render the scene.
    """
    judges, left_out = _judges(terms.judges)
    first = {c.family: c for c in reversed(contestants)}
    reasons = {family: why for family in FAMILIES if family in first and (why := _why_unable(first[family]))}
    left_out += [f"{FAMILIES[family]} does not take part: {why}" for family, why in reasons.items()]
    able = [c for c in contestants if c.family not in reasons]
    for text in left_out:
        monitor.say(text)
    if not able:
        raise SettingsError(f"nobody can take part: {'; '.join(left_out)}")
    with Run.open(folder, _identity(job, terms)) as run:
        for note in run.notes:
            monitor.say(note)
        race_of = _Race(job, terms, run, monitor)
        for name in terms.redo:
            race_of.forget(name)
        references = {
            f.name.lower(): race_of.reference(f)
            for f in PixelFilter
            if any(c.pixel_filter is f for c in able)
        }
        rows, judges, silent = without_silent([race_of.contestant(c, judges) for c in able], judges)
        for text in silent:
            monitor.say(text)
        if not judges:
            raise SettingsError(f"nobody can judge: {'; '.join(silent)}, or let others judge")
        floor = race_of.floor(able, judges)
        found = {
            "format": FORMAT,
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "machine": machine(),
            "versions": versions(),
            "scene": f"{job.scene.resolve().parent.name}/{job.scene.name}",
            "size": [job.path.width, job.path.height],
            "fps": job.path.fps,
            "frames": list(job.path.numbers),
            "pixels_per_degree": job.viewing.pixels_per_degree,
            "exposure_ev": job.settings.viewing.exposure_ev,
            "reference": {"spp": terms.reference_spp, "filters": references, "floor": floor},
            "judges": {
                j: {
                    "title": SCALES[j].title,
                    "unit": SCALES[j].unit,
                    "is_more_better": SCALES[j].is_more_better,
                }
                for j in judges
            },
            "left_out": left_out + silent,
            "contestants": rows,
            "verdict": verdict(rows, judges),
        }
        run.write_json("bench.json", found)
    return found


def forecast_s(job: Job, contestants: Sequence[Contestant], terms: Terms, cores: int) -> float:
    """Roughly how long a bench takes that begins anew on CPUs, wall seconds: by its paths alone."""
    pixels = job.path.width * job.path.height * len(job.path)
    filters = len({c.pixel_filter for c in contestants})
    spp = terms.reference_spp * filters + sum(
        c.job.settings.trace.spp for c in contestants if c.family in ("traced", "denoised")
    )
    return pixels * spp / PATHS_PER_CPU_S / max(cores, 1)


class _Race:
    """References and contestants, each rendered and judged once."""

    def __init__(self, job: Job, terms: Terms, run: Run, monitor: Monitor) -> None:
        self._job, self._terms, self._run, self._monitor = job, terms, run, monitor

    def reference(self, pixel_filter: PixelFilter) -> dict[str, Any]:
        """Render a reference: its cost, and Mitsuba's name of what it ran on.

        Its random numbers are not those of any contestant.
        """
        from studies.bench.tasks import EveryFrame

        trace = self._job.settings.trace
        seed = (trace.seed + 1) % 2**32
        settings = replace(self._job.settings, trace=replace(trace, spp=self._terms.reference_spp, seed=seed))
        job = replace(self._job, method="reference", settings=settings)
        task = EveryFrame(job, pixel_filter, has_layers=True)
        folder = self._reference_folder(pixel_filter)
        cost = self._rendered(folder.name, task, folder, {}, self._terms.reference_device)
        return cost | {"variant": Run.existing(folder).identity["versions"]["variant"]}

    def _reference_folder(self, pixel_filter: PixelFilter) -> Path:
        return self._run.folder / "references" / f"reference-{pixel_filter.name.lower()}"

    def contestant(self, one: Contestant, judges: Sequence[str]) -> dict[str, Any]:
        """Render and judge a contestant: its row of the result."""
        folder = self._run.folder / "contestants" / one.name
        unit = f"contestant {one.name}"
        line = self._finished(unit, folder) or {}
        if changed := _changed(line.get("setting", {}), one.setting()):
            raise RunFolderError(
                f"{folder} was made with other settings ({', '.join(changed)}): begin it anew with "
                f"--redo {one.name}, or give the preset another name"
            )
        cost = self._rendered(unit, one.task(), folder, one.setting(), "cpu")
        verdicts = self._judged(one, folder, judges)
        return {
            "name": one.name,
            "family": one.family,
            "spp": one.job.settings.trace.spp,
            "variant": one.variant,
            "pixel_filter": one.pixel_filter.name.lower(),
            "cost": cost,
            "scores": {name: verdicts[name]["score"] for name in judges},
            "per_frame": {name: verdicts[name]["per_frame"] for name in judges},
        }

    def floor(self, contestants: Sequence[Contestant], judges: Sequence[str]) -> dict[str, float | None]:
        """What the judges would say of a perfect contestant: all of it the noise of the reference.

        A path traced contestant of N paths and the reference of R differ by noise whose variance is
        1/N + 1/R of a path's; a perfect contestant differs from the reference by 1/R of it.
        """
        traced = [c for c in contestants if c.family == "traced"]
        if not traced:
            return {}
        one = max(traced, key=lambda c: c.job.settings.trace.spp)
        ratio = self._terms.reference_spp / one.job.settings.trace.spp
        unit = f"floor by {one.name}"
        made = _ledger_digest(self._run.folder / "contestants" / one.name)
        line = self._run.done(unit)
        found = dict(line["scores"]) if line is not None and line["made"] == made else {}
        missing = [name for name in judges if name not in found]
        if missing:
            self._monitor.stage("noise of the reference: judges", len(self._job.path))
            test = self._run.folder / "contestants" / one.name
            reference = self._reference_folder(one.pixel_filter)
            share = (1.0 + ratio) ** -0.5
            said = judge(test, reference, self._job, missing, self._monitor, share=share)
            found |= {name: of["score"] for name, of in said.items()}
            self._run.finish(unit, files=[], facts={"scores": found, "made": made})
        return {name: found[name] for name in judges}

    def forget(self, name: str) -> None:
        """Begin a contestant anew: its frames, its costs and what was said of it go."""
        folder = self._run.folder / "contestants" / name
        if folder.exists() and not (folder / "run.json").is_file():
            raise RunFolderError(f"{folder} is no run folder; it is not removed")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.rmtree(self._run.folder / "spent" / name, ignore_errors=True)

    def _rendered(
        self, unit: str, task: Any, folder: Path, setting: dict[str, Any], device: Choice
    ) -> dict[str, Any]:
        if line := self._finished(unit, folder):
            cost: dict[str, Any] = line["cost"]
            return cost
        notes = self._run.folder / "spent" / folder.name
        try:
            spent = race(task, folder, notes, _Named(self._monitor, folder.name), device=device)
        except RunFolderError as error:
            remedy = f"\nOr begin it anew: --redo {folder.name}" if setting else ""
            raise RunFolderError(f"{error}{remedy}") from error
        made = _ledger_digest(folder)
        self._run.finish(unit, files=[], facts={"cost": spent.to_dict(), "setting": setting, "made": made})
        return spent.to_dict()

    def _finished(self, unit: str, folder: Path) -> dict[str, Any] | None:
        """The line of a contestant whose frames stand there still; it may have been begun anew since."""
        line, made = self._run.done(unit), _ledger_digest(folder)
        return line if line is not None and made and line.get("made") == made else None

    def _judged(self, one: Contestant, folder: Path, judges: Sequence[str]) -> dict[str, Any]:
        made = _ledger_digest(folder)
        lines = {name: self._run.done(f"verdict {one.name} {name}") for name in judges}
        found = {n: line["verdict"] for n, line in lines.items() if line is not None and line["made"] == made}
        missing = [name for name in judges if name not in found]
        if missing:
            self._monitor.stage(f"{one.name}: judges", len(self._job.path))
            reference = self._reference_folder(one.pixel_filter)
            for name, said in judge(folder, reference, self._job, missing, self._monitor).items():
                self._run.finish(
                    f"verdict {one.name} {name}", files=[], facts={"verdict": said, "made": made}
                )
                found[name] = said
        return found


class _Named:
    """A monitor that puts the contestant's name before its stages."""

    def __init__(self, monitor: Monitor, name: str) -> None:
        self._monitor, self._name = monitor, name

    def stage(self, name: str, total: int) -> None:
        """Pass it on."""
        self._monitor.stage(f"{self._name}: {name}", total)

    def advance(self, count: int = 1) -> None:
        """Pass it on."""
        self._monitor.advance(count)

    def extend(self, count: int) -> None:
        """Pass it on."""
        self._monitor.extend(count)

    def say(self, text: str) -> None:
        """Pass it on."""
        self._monitor.say(f"{self._name}: {text}")


def _judges(asked: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """Who judges, and what is said of those who can't."""
    for name in asked:
        if name not in JUDGES:
            raise SettingsError(f"there is no judge {name!r}; known are: {', '.join(JUDGES)}")
        if why := why_missing(name):
            raise SettingsError(why)
    missing = {name: why_missing(name) for name in JUDGES}
    judges = list(dict.fromkeys(asked)) or [name for name in JUDGES if not missing[name]]
    return judges, [] if asked else [why for why in missing.values() if why]


def _why_unable(one: Contestant) -> str:
    match one.family:
        case "denoised":
            return why_no_denoiser()
        case "interpolated":
            return why_no_interpolation()
        case "decoupled":
            try:
                one.job.check_scene(is_tried=True)
            except SettingsError as error:
                return str(error)
    return ""


def _identity(job: Job, terms: Terms) -> dict[str, Any]:
    settings: Settings = job.settings
    trace = settings.trace
    viewing = settings.to_tables()["viewing"]
    return {
        "method": "bench",
        "scene": _scene_digest(job.scene),
        "path": path_identity(job.path),
        "reference_spp": terms.reference_spp,
        "seed": trace.seed,
        "max_depth": trace.max_depth,
        "viewing": viewing,
        "metering": settings.metric.metering.value,
    }


def _scene_digest(scene: Path) -> str:
    if not scene.is_file():
        raise SceneError(f"there is no scene file {scene}")
    if scene.name.endswith(ANALYTIC_SUFFIX):
        return hashlib.sha256(scene.read_bytes()).hexdigest()
    return fingerprint(scene)


def _changed(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Settings that differ; those that one side does not know are new to the program."""
    found = []
    for key in before.keys() & now.keys():
        if isinstance(before[key], dict) and isinstance(now[key], dict):
            found += [f"{key}.{name}" for name in _changed(before[key], now[key])]
        elif before[key] != now[key]:
            found.append(key)
    return sorted(found)


def _ledger_digest(folder: Path) -> str:
    """What a run folder's frames are: they change with their ledger."""
    file = folder / "ledger.jsonl"
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
