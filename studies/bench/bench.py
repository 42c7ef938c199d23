"""A bench in one folder: configurations rendered, measured in windows, and compared at equal quality.

::

    windows.json                 where it measures; drawn before any configuration is rendered
    configurations/NAME/         run folders of the configurations; further seeds in NAME-seed-SEED
    costs/NAME.json  scores/NAME.json
    bench.json  bench.png  crops.png

References are in a folder of their own; see `studies/bench/references.py`.
"""

from __future__ import annotations

import hashlib
import json
import resource
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import enfilade.comparison.measures
import enfilade.metric
import studies.bench.measures
import studies.bench.measuring
from enfilade.cli.progress import watch
from enfilade.cli.render import PATHS_PER_CPU_S
from enfilade.device import Choice
from enfilade.errors import InputError
from enfilade.files import read_json, write_json
from enfilade.methods.walkthrough import Walkthrough
from enfilade.runs.delivery import ANALYSIS, CLIPS, VIDEO
from enfilade.runs.folder import RunFolder
from enfilade.runs.identity import RUN_FILE, digest_of
from enfilade.runs.job import Job
from enfilade.runs.render import render
from enfilade.runs.statistics import add_costs
from enfilade.settings import MetricSettings, SampleFilter, ViewingSettings
from studies.bench import colorvideovdp
from studies.bench.alone import alone
from studies.bench.configurations import Configuration, with_seeds
from studies.bench.measures import QUALITIES
from studies.bench.measuring import GAUSSIAN_OF_BOX, available, measure, windows_of_run
from studies.bench.ratios import ratios
from studies.bench.references import References
from studies.bench.windows import Window, draw_windows, windows_of
from studies.progress import Prefixed
from studies.versions import machine, origin, package_versions

KERNELS = Path.home() / ".drjit"  # Dr.Jit's cache of compiled kernels
UNCHARGED = (CLIPS.name, VIDEO.name)  # equal for all
BASELINES_UNCHARGED = (*UNCHARGED, ANALYSIS.name)  # nor statistics of the path
ATTEMPTS = 3  # at a run in which no kernel is compiled; then the tables say that some were
# What the values depend on, beside the images.
MEASURING = (
    *Path(enfilade.metric.__file__).parent.glob("*.py"),
    *Path(enfilade.comparison.measures.__file__).parent.glob("*.py"),
    Path(studies.bench.measures.__file__),
    Path(studies.bench.measuring.__file__),
)
DECIDED = 4.0 / 3.0  # times the error of the noise floor
GBUFFER = "gbuffer"  # not charged to baselines that do not accumulate over time


@dataclass(frozen=True)
class Place:
    """Folders of a bench.

    Attributes
    ----------
    folder : Path
        Of the results.
    store : Path
        Of references, shared with other benches.
    """

    folder: Path
    store: Path


def bench(
    job: Job,
    configurations: Sequence[Configuration],
    place: Place,
    *,
    reference_spp: int,
    frames: int | None = None,
    seeds: int = 1,
    measures: Sequence[str] = (),
    reference_device: Choice = "auto",
    quiet: bool = False,
) -> dict[str, Any]:
    """Render and measure all configurations, or continue.

    Finished frames and measures are kept. One process works at a time, so that runs do not slow each other
    down.

    Parameters
    ----------
    job
        Scene, measured frames, and settings.
    configurations
        Rendered on the CPU.
    place
        Folders; created if they do not exist.
    reference_spp
        Least number of paths a pixel of the references, half of them in each of two independent halves. A
        store that has more is used as it is.
    frames
        Of the walkthrough whose cost is stated; the measured frames are some of them. By default these alone.
        The cost of configurations that render the measured frames only is extrapolated.
    seeds
        How often each configuration of enfilade's methods is rendered: with the seed of the job and the next
        ones. Baselines are rendered once.
    measures
        Names; empty: all that are available.
    reference_device
        Device of the references, whose cost is not measured.
    quiet
        Whether to hide the progress.

    Returns
    -------
    dict
        The contents of ``bench.json``; `studies/bench/README.md` describes it.

    Raises
    ------
    InputError
        The scene, the settings, or a folder that holds another bench.
    SettingsError
        A requested measure is not available.
    """
    job.check()
    names, left_out = available(measures, job)
    started = time.monotonic()
    windows = alone(reference_device, _prepare, job, place, reference_spp, quiet=quiet)
    references = References(place.store, job, windows)
    prepared_s = time.monotonic() - started
    count = frames or len(job.path)
    runs = _Bench(job, count, place.folder, references, windows, names, quiet=quiet)
    floor = runs.floor()
    rows = [runs.row(one, 1 if one.is_baseline else seeds, floor) for one in configurations]
    found = {
        **origin(),
        "machine": machine(),
        "versions": {**package_versions(), "cvvdp": colorvideovdp.version()},
        "scene": job.scene.file.resolve().parent.name,
        "size": [job.path.width, job.path.height],
        "fps": job.path.fps,
        "frames": list(job.path.numbers),
        "walkthrough_frames": count,
        "pixels_per_degree": job.viewing.pixels_per_degree,
        "exposure_ev": job.settings[ViewingSettings].exposure_ev,
        "windows": [asdict(window) for window in windows],
        "reference": {
            "spp": min(references.spp(frame) for frame in range(len(job.path))),
            "wall_s": prepared_s,  # of this call; short where the store has them
            "noise_floor": floor,
        },
        "measures": {name: {"title": QUALITIES[name].title, "unit": QUALITIES[name].unit} for name in names},
        "left_out": left_out,
        "configurations": rows,
        "ratios": ratios(rows, names),
    }
    write_json(place.folder / "bench.json", found)
    return found


def forecast_s(job: Job, configurations: Sequence[Configuration], seeds: int, cores: int) -> float:
    """Rough duration of the configurations of a bench on CPUs, wall seconds, from the number of paths."""
    pixels = job.path.width * job.path.height
    paths = sum(len(c.job.path) * c.expected_spp * (1 if c.is_baseline else seeds) for c in configurations)
    return pixels * paths / PATHS_PER_CPU_S / cores


def _prepare(job: Job, place: Place, spp: int, *, quiet: bool) -> list[Window]:
    """Draw the windows of a bench, if it has none, and trace the references that the store lacks."""
    file = place.folder / "windows.json"
    identity = json.loads(json.dumps({k: job.identity()[k] for k in ("scene", "path")}))
    identity["scene"].pop("variant")
    held = read_json(file) if file.is_file() else None
    if held is not None and held["identity"] != identity:
        raise InputError(
            f"{place.folder} holds the bench of another scene or other frames; name another folder by --out"
        )
    if held is None:
        walk = Walkthrough(job.path, job.settings, job.open_renderer())
        windows = draw_windows(walk)
        write_json(file, {"identity": identity, "windows": [asdict(window) for window in windows]})
    else:
        windows = windows_of(held["windows"])
    references = References(place.store, job, windows)
    if references.missing(spp):
        with watch(quiet=quiet) as monitor:
            references.grow(spp, Prefixed(monitor, job.scene.file.resolve().parent.name))
    return windows


class _Bench:
    """Configurations, each rendered and measured once."""

    def __init__(
        self,
        job: Job,
        frames: int,
        folder: Path,
        references: References,
        windows: Sequence[Window],
        names: Sequence[str],
        *,
        quiet: bool,
    ) -> None:
        self._job, self._frames, self._folder, self._names, self._quiet = job, frames, folder, names, quiet
        self._references, self._windows = references, windows

    def row(self, one: Configuration, seeds: int, floor: dict[str, list[float]]) -> dict[str, Any]:
        """Render and measure a configuration with each of its seeds; return its row of the result."""
        runs = [self._run(member) for member in with_seeds(one, seeds)]
        values = {
            name: np.mean([run["values"][name] for run in runs], axis=0).tolist() for name in self._names
        }
        return {
            "name": one.name,
            "family": one.family,
            "spp": one.spp,
            "variant": one.variant,
            "pixel_filter": one.pixel_filter.value,
            "cost": mean_cost([run["cost"] for run in runs]),
            "scores": {name: QUALITIES[name].score(values[name]) for name in self._names},
            "values": values,
            "seeds": [
                {name: run[name] for name in ("seed", "values", "origin")} | {"cpu_s": run["cost"]["cpu_s"]}
                for run in runs
            ],
            "undecided": undecided(values, floor),
        }

    def _run(self, one: Configuration) -> dict[str, Any]:
        """Render and measure a configuration with its own seed."""
        folder = self._folder / "configurations" / one.name
        self._render(one, folder)
        return {
            "seed": one.seed,
            "values": self._best(one, folder),
            "cost": self._cost(one, folder),
            "origin": read_json(self._folder / "costs" / f"{one.name}.json")["origin"],
        }

    def floor(self) -> dict[str, list[float]]:
        """Values of one half of the references against the other, by measures that contain their noise."""
        found = self._values("noise floor, gaussian", None)
        return {name: values for name, values in found.items() if QUALITIES[name].has_noise}

    def _best(self, one: Configuration, run: Path) -> dict[str, list[float]]:
        """Values against references of the Gaussian pixel filter, by measure and window.

        Box-filtered frames are measured twice: filtered to a Gaussian, and as they are, against references of
        the box. By each measure the better values count.
        """
        if one.pixel_filter is SampleFilter.GAUSSIAN:
            return self._values(one.name, run)
        filtered = self._values(one.name, run, is_filtered=True)
        own = self._values(f"{one.name}, box", run, SampleFilter.BOX)
        return {m: min(filtered[m], own[m], key=QUALITIES[m].error) for m in filtered}

    def _values(
        self,
        name: str,
        run: Path | None,
        pixel_filter: SampleFilter = SampleFilter.GAUSSIAN,
        *,
        is_filtered: bool = False,
    ) -> dict[str, list[float]]:
        """Values by measure and window; read from their file if they are there, else measured."""
        frames = range(len(self._job.path))
        identity: dict[str, Any] = {
            "run": run and RunFolder.read(run).digest(),
            "windows": [asdict(window) for window in self._windows],
            "references": [self._references.folder.name, *map(self._references.spp, frames)],
            **self._job.settings.to_tables([ViewingSettings]),
            "pursuit": self._job.settings[MetricSettings].pursuit.value,
            "versions": [package_versions(), colorvideovdp.version()],
            "measuring": hashlib.sha256(b"".join(f.read_bytes() for f in sorted(MEASURING))).hexdigest(),
        }
        if is_filtered:
            identity["filter"] = list(GAUSSIAN_OF_BOX)
        file = self._folder / "scores" / f"{name}.json"
        found: dict[str, Any] = read_json(file) if file.is_file() else {}
        if found.get("identity") != identity:
            found = {"identity": identity, "values": {}}
        wanted = [m for m in self._names if run is not None or QUALITIES[m].has_noise]
        if missing := [m for m in wanted if m not in found["values"]]:
            with watch(quiet=self._quiet) as monitor:
                path, windows = self._job.path, self._windows
                source = windows_of_run(run, path, windows, is_filtered=is_filtered) if run else None
                found["values"] |= measure(
                    source, self._references, windows, self._job, missing, Prefixed(monitor, name),
                    pixel_filter=pixel_filter,
                )  # fmt: skip
            write_json(file, found)
        return {m: found["values"][m] for m in wanted}

    def _render(self, one: Configuration, folder: Path) -> None:
        """Render in a new process, unless it is done on such a machine; note the cost of the start."""
        file = self._folder / "costs" / f"{one.name}.json"
        is_finished = _is_run_of(one.job, folder) and (folder / "summary.json").is_file()
        if is_finished and file.is_file() and _is_of_here(read_json(file)["origin"]):
            return
        for _ in range(ATTEMPTS):
            if _is_run_of(one.job, folder):  # costs of an interrupted run contain several starts
                shutil.rmtree(folder)
            spent = alone("cpu", _render, one.job, folder, quiet=self._quiet)
            if not spent["kernels"]:  # else they are in the cache on disk now
                break
        spent["start_cpu_s"] = spent.pop("cpu_s") - _ledger_cpu_s(folder)
        write_json(file, {"cost": spent, "origin": {**origin(), "machine": machine()}})

    def _cost(self, one: Configuration, folder: Path) -> dict[str, Any]:
        """CPU and wall seconds of all frames, by stage and in total, the start included."""
        uncharged = _uncharged(one)
        tasks = [line["cost"] for line in RunFolder.read(folder).lines() if line["pass"] not in uncharged]
        stages = add_costs(extrapolated(tasks, len(one.job.path), self._frames))
        charged = {name: spent for name, spent in stages.items() if name not in uncharged}
        total = {kind: sum(spent[kind] for spent in charged.values()) for kind in ("cpu_s", "wall_s")}
        start = read_json(self._folder / "costs" / f"{one.name}.json")["cost"]
        total["cpu_s"] += start["start_cpu_s"]
        return {**total, **start, "stages": charged}


def extrapolated(
    tasks: Sequence[dict[str, dict[str, float]]], rendered: int, frames: int
) -> Iterator[dict[str, dict[str, float]]]:
    """Costs of tasks as if more frames were rendered: all but the first task's, whose cost has a start's.

    Parameters
    ----------
    tasks
        Costs by stage and kind; one of each frame, where not all frames are rendered.
    rendered, frames
        Numbers of frames: rendered, and of the walkthrough.
    """
    factor = (frames - 1) / (rendered - 1) if 1 < rendered < frames else frames / rendered
    for place, cost in enumerate(tasks):
        times = 1.0 if place == 0 and rendered > 1 else factor
        yield {stage: {kind: times * of for kind, of in spent.items()} for stage, spent in cost.items()}


def mean_cost(costs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Means of the costs of several runs, also by stage; the largest peak memory and number of kernels."""
    found: dict[str, Any] = {}
    for name, first in costs[0].items():
        of = [cost[name] for cost in costs]
        if isinstance(first, dict):
            found[name] = mean_cost(of)
        else:
            found[name] = max(of) if name in ("peak_mib", "kernels") else sum(of) / len(of)
    return found


def undecided(values: Mapping[str, Sequence[float]], floors: Mapping[str, Sequence[float]]) -> list[str]:
    """Measures whose error is not a third above that of the noise floor.

    Parameters
    ----------
    values, floors
        Values of the windows by measure: of a configuration, and of one half of the references against the
        other.
    """
    return [
        name
        for name, floor in floors.items()
        if QUALITIES[name].error(values[name]) < DECIDED * QUALITIES[name].error(floor)
    ]


def _ledger_cpu_s(folder: Path) -> float:
    """CPU seconds of all tasks of a run folder."""
    stages = add_costs(line["cost"] for line in RunFolder.read(folder).lines())
    return sum(spent["cpu_s"] for spent in stages.values())


def _uncharged(one: Configuration) -> tuple[str, ...]:
    """Passes and stages that a configuration does not need."""
    if not one.is_baseline:
        return UNCHARGED
    return BASELINES_UNCHARGED if "accumulated" in one.variant else (*BASELINES_UNCHARGED, GBUFFER)


def _is_run_of(job: Job, folder: Path) -> bool:
    """Whether a folder holds a run of a job, finished or not."""
    is_run = (folder / RUN_FILE).is_file()
    return is_run and digest_of(RunFolder.read(folder).identity) == digest_of(job.identity())


def _is_of_here(found: Mapping[str, Any]) -> bool:
    """Whether something was rendered on a machine like this one, by its origin."""
    return all(found["machine"][name] == machine()[name] for name in ("processor", "cores"))


def _render(job: Job, folder: Path, *, quiet: bool) -> dict[str, float]:
    """Render; return the CPU seconds of this process from its start, its peak memory, and new kernels."""
    before = cached_kernels()
    with watch(quiet=quiet) as monitor:
        render(job, folder, Prefixed(monitor, folder.name))
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"cpu_s": time.process_time(), "peak_mib": peak_mib, "kernels": cached_kernels() - before}


def cached_kernels() -> int:
    """Number of compiled kernels in Dr.Jit's cache on disk."""
    return sum(1 for _ in KERNELS.glob("*"))
