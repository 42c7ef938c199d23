"""A bench in one folder: references and configurations rendered, measured, and compared.

::

    references/box/ gaussian/    run folders of the references, with all AOVs
    configurations/NAME/         run folders of the configurations
    scores/NAME.json             measures of the configurations
    bench.json  bench.png  crops.png
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from enfilade.camera.path import CameraPath
from enfilade.cli.progress import watch
from enfilade.device import Choice, activate
from enfilade.errors import EnfiladeError, SettingsError
from enfilade.files import read_json, write_json
from enfilade.kernels.estimate import SPP_PER_SUM
from enfilade.monitor import Silence
from enfilade.resource_limits import die_with
from enfilade.runs.delivery import ANALYSIS, CLIPS, VIDEO
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import Job
from enfilade.runs.render import render
from enfilade.runs.statistics import add_costs
from enfilade.settings import (
    MetricSettings,
    OutputSettings,
    ReferenceSettings,
    SampleFilter,
    SamplingSettings,
    TraceSettings,
    ViewingSettings,
)
from studies.bench.baselines import why_missing
from studies.bench.configurations import FAMILIES, Configuration
from studies.bench.measures import NOISE_FREE, SCALES
from studies.bench.measuring import available, measure
from studies.bench.ratios import ratios
from studies.progress import Prefixed
from studies.versions import machine, origin, package_versions

PATHS_PER_CPU_S = 1.0e6  # measured in a furnished room on one core of 2026; for the forecast
WARM_FRAMES = 3  # rendered and discarded before the measurement, to compile the kernels
UNCHARGED = (CLIPS.name, VIDEO.name)  # baselines need no video
BASELINES_UNCHARGED = (*UNCHARGED, ANALYSIS.name)  # nor statistics of the path
GBUFFER = "gbuffer"  # not charged to baselines that do not accumulate over time


def bench(
    job: Job,
    configurations: Sequence[Configuration],
    folder: Path,
    *,
    reference_spp: int,
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
        Scene, path and settings.
    configurations
        Rendered on the CPU.
    folder
        Created if it does not exist.
    reference_spp
        Paths a pixel of the references, half of them in each of two independent halves.
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
        A requested measure is not available, or no configuration can be rendered.
    """
    job.check()
    names, left_out = available(measures, job)
    reasons = {family: why for family in FAMILIES if (why := why_missing(family))}
    missing = reasons.keys() & {c.family for c in configurations}
    left_out += [f"{FAMILIES[family]} is left out: {reasons[family]}" for family in sorted(missing)]
    available_configurations = [c for c in configurations if c.family not in reasons]
    if not available_configurations:
        raise SettingsError(f"no configuration can be rendered: {'; '.join(left_out)}")
    runs = _Bench(job, folder, names, quiet=quiet)
    filters = dict.fromkeys(c.pixel_filter for c in available_configurations)
    references = {kind.value: runs.reference(kind, reference_spp, reference_device) for kind in filters}
    floors = {kind.value: runs.noise_floor(kind) for kind in filters}
    rows = [runs.row(one, floors[one.pixel_filter.value]) for one in available_configurations]
    found = {
        **origin(),
        "machine": machine(),
        "versions": package_versions(),
        "scene": f"{job.scene.file.resolve().parent.name}/{job.scene.file.name}",
        "size": [job.path.width, job.path.height],
        "fps": job.path.fps,
        "frames": list(job.path.numbers),
        "pixels_per_degree": job.viewing.pixels_per_degree,
        "exposure_ev": job.settings[ViewingSettings].exposure_ev,
        "reference": {
            "spp": reference_spp,
            "filters": references,
            "noise_floor": floors,
        },
        "measures": {
            name: {key: getattr(SCALES[name], key) for key in ("title", "unit", "is_more_better")}
            for name in names
        },
        "left_out": left_out,
        "configurations": rows,
        "ratios": ratios(rows, names),
    }
    write_json(folder / "bench.json", found)
    return found


def forecast_s(job: Job, configurations: Sequence[Configuration], reference_spp: int, cores: int) -> float:
    """Rough duration of a whole bench on CPUs, wall seconds, from its number of paths."""
    pixels = job.path.width * job.path.height * len(job.path)
    filters = len({c.pixel_filter for c in configurations})
    spps = (c.spp for c in configurations if c.family in ("traced", "denoised"))
    return pixels * (reference_spp * filters + sum(spps)) / PATHS_PER_CPU_S / cores


class _Bench:
    """References and configurations, each rendered and measured once."""

    def __init__(self, job: Job, folder: Path, names: Sequence[str], *, quiet: bool) -> None:
        self._job, self._folder, self._names, self._quiet = job, folder, names, quiet

    def reference(self, pixel_filter: SampleFilter, spp: int, device: Choice) -> dict[str, Any]:
        """Render both halves of a reference; return their cost and the renderer's variant."""
        costs, variant = [], ""
        for half, folder in enumerate(self._halves(pixel_filter), 1):
            seed = (self._job.settings[TraceSettings].seed + half) % 2**32  # not those of configurations
            settings = (
                self._job.settings.replace(TraceSettings, seed=seed)
                .replace(SamplingSettings, spp=max(spp // 2, 1))
                .replace(ReferenceSettings, pixel_filter=pixel_filter)
                .replace(OutputSettings, layers="all")
            )
            job = replace(self._job, method="reference", settings=settings)
            _render_alone(job, folder, device, is_warm=False, quiet=self._quiet)
            run = RunFolder.read(folder)
            costs.append(_cost(run, UNCHARGED))
            variant = run.identity["scene"]["variant"]
        total = {key: sum(cost[key] for cost in costs) for key in ("cpu_s", "wall_s")}
        return {**total, "variant": variant}

    def row(self, one: Configuration, floor: Mapping[str, float | None]) -> dict[str, Any]:
        """Render and measure a configuration; return its row of the result."""
        folder = self._run(one)
        _render_alone(one.job, folder, "cpu", is_warm=True, quiet=self._quiet)
        scores = self._scores(one.name, folder, self._halves(one.pixel_filter))
        return {
            "name": one.name,
            "family": one.family,
            "spp": one.spp,
            "variant": one.variant,
            "pixel_filter": one.pixel_filter.value,
            "cost": _cost(RunFolder.read(folder), _uncharged(one)),
            "scores": scores,
            "undecided": [name for name, least in floor.items() if _is_near(scores[name], least)],
        }

    def noise_floor(self, pixel_filter: SampleFilter) -> dict[str, float | None]:
        """Scores of one half of a reference against the other, by the measures that contain their noise."""
        first, second = self._halves(pixel_filter)
        found = self._scores(f"noise floor, {pixel_filter.value}", first, (second, second))
        return {name: score for name, score in found.items() if name not in NOISE_FREE}

    def _scores(self, name: str, test: Path, halves: tuple[Path, Path]) -> dict[str, float | None]:
        """Scores of a run folder by measure; read from their file if they are there, else measured."""
        settings = self._job.settings
        identity = {
            "runs": [RunFolder.read(folder).digest() for folder in (test, *halves)],
            **settings.to_tables([ViewingSettings]),
            "metering": settings[MetricSettings].metering.value,
        }
        file = self._folder / "scores" / f"{name}.json"
        found: dict[str, Any] = read_json(file) if file.is_file() else {}
        if found.get("identity") != identity:
            found = {"identity": identity, "measures": {}}
        if missing := [measure for measure in self._names if measure not in found["measures"]]:
            with watch(quiet=self._quiet) as monitor:
                prefixed = Prefixed(monitor, name)
                found["measures"] |= measure(test, halves, self._job, missing, prefixed)
            write_json(file, found)
        return {measure: found["measures"][measure]["score"] for measure in self._names}

    def _run(self, one: Configuration) -> Path:
        return self._folder / "configurations" / one.name

    def _halves(self, pixel_filter: SampleFilter) -> tuple[Path, Path]:
        folder = self._folder / "references"
        return folder / f"{pixel_filter.value}-1", folder / f"{pixel_filter.value}-2"


def _is_near(score: float | None, floor: float | None) -> bool:
    """Whether a score is nearer to the noise floor of its measure than a third of it."""
    return score is not None and floor is not None and abs(score - floor) < abs(floor) / 3.0


def _uncharged(one: Configuration) -> tuple[str, ...]:
    """Passes and stages that a configuration does not need."""
    if not one.is_baseline:
        return UNCHARGED
    return BASELINES_UNCHARGED if "accumulated" in one.variant else (*BASELINES_UNCHARGED, GBUFFER)


def _cost(run: RunFolder, uncharged: Sequence[str]) -> dict[str, Any]:
    """CPU and wall seconds of a run, by stage and in total, over all sessions."""
    stages = add_costs(line["cost"] for line in run.lines() if line["pass"] not in uncharged)
    charged = {name: spent for name, spent in stages.items() if name not in uncharged}
    total = {kind: sum(spent[kind] for spent in charged.values()) for kind in ("cpu_s", "wall_s")}
    return {**total, "stages": charged}


def _render_alone(job: Job, folder: Path, device: Choice, *, is_warm: bool, quiet: bool) -> None:
    """Render in a new process, unless the run is finished."""
    if _is_finished(job, folder):
        return
    context = get_context("spawn")
    # The device is chosen before the job is unpickled: Dr.Jit's array types bind to it at import.
    arguments = os.getpid(), device
    with ProcessPoolExecutor(1, mp_context=context, initializer=_begin, initargs=arguments) as pool:
        try:
            pool.submit(_render, job, folder, is_warm=is_warm, quiet=quiet).result()
        except BrokenProcessPool as error:
            raise EnfiladeError(
                f"the process that rendered {folder} was killed, perhaps for lack of memory; the same "
                "command continues"
            ) from error


def _begin(parent: int, device: Choice) -> None:
    die_with(parent)
    activate(device)


def _is_finished(job: Job, folder: Path) -> bool:
    """Whether a run folder holds the finished run of a job, on any device."""
    if not (folder / "summary.json").is_file():
        return False
    wanted, existing = json.loads(json.dumps(job.identity())), RunFolder.read(folder).identity
    return bool({**wanted, "renderer": None} == {**existing, "renderer": None})


def _render(job: Job, folder: Path, *, is_warm: bool, quiet: bool) -> None:
    """Compile the kernels, then render; runs in the new process."""
    if is_warm:
        with tempfile.TemporaryDirectory(prefix="enfilade-") as scratch:
            render(_excerpt(job), Path(scratch) / "run", Silence())
    with watch(quiet=quiet) as monitor:
        render(job, folder, Prefixed(monitor, folder.name))


def _excerpt(job: Job) -> Job:
    """A few frames of a job, spread over the path, as one shot."""
    path = job.path
    count = min(WARM_FRAMES, len(path))
    frames = sorted({round(i * (len(path) - 1) / max(count - 1, 1)) for i in range(count)})
    spp = min(job.settings[SamplingSettings].spp, SPP_PER_SUM)  # more need no other kernel
    cameras, numbers = tuple(path.cameras[f] for f in frames), tuple(path.numbers[f] for f in frames)
    settings = job.settings.replace(SamplingSettings, spp=spp)
    return replace(job, path=CameraPath(cameras, numbers, path.fps), settings=settings)
