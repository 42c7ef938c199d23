"""All case studies: each item measured once a scene, kept as JSON, images as they are looked at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from enfilade.images import write_arrays
from enfilade.monitor import Monitor
from studies.cases import placement, reflections, separation, shares, statistics, supports, threshold, times
from studies.cases.case import Case, Measured
from studies.cases.terms import Terms
from studies.cases.windows import probes_of

__all__ = ["ITEMS", "SCENES", "forecast_s", "measure"]

PATH_S = 4.5e-6  # CPU seconds of a path on one of two busy hyperthreads; for a rough forecast
FRAME_S = 1.5  # ... and of all but tracing for a frame of 640x480
VARIANT_S = 2.5  # ... and of filtering and judging one of 640x480 once
VGA = 640 * 480
VARIANTS = {"threshold": 50, "supports": 80, "separation": 15, "reflections": 15}  # tried on a window
PATHS = {"room": 0.4, "atrium": 0.55}  # share of pixels that the paper's method traces
SCENES = ("room", "atrium")
LENGTHS = {"full": {"room": 448, "atrium": 200}, "small": {"room": 60, "atrium": 60}}


def _threshold(case: Case) -> dict[str, Any]:
    terms = threshold.Calibration()
    plain, traced = case.plain_windows, case.windows
    return {
        "plain": threshold.calibrate(plain, _probes(case), terms),
        "traced": threshold.calibrate(traced, _traced_probes(case), terms),
    }


def _supports(case: Case) -> dict[str, Any]:
    terms = supports.Supports()
    return {
        "plain": supports.measure(case.plain_windows, _probes(case), terms),
        "traced": supports.measure(case.windows, _traced_probes(case), terms),
    }


def _separation(case: Case) -> dict[str, Any]:
    rows, example = separation.measure(case.plain_windows, _probes(case))
    write_arrays(case.folder / "separation.npz", example)
    return rows


def _reflections(case: Case) -> dict[str, Any]:
    probes = reflections.most_mirrors(case.plain_windows, case.terms.windows)
    if not probes:
        return {"frames": []}
    rows, example = reflections.measure(case.plain_windows, probes)
    write_arrays(case.folder / "reflections.npz", example)
    return rows


def _probes(case: Case) -> list[int]:
    return probes_of(case.survey, len(case.whole.path), case.terms.windows)


def _traced_probes(case: Case) -> list[int]:
    return probes_of(case.short_survey, len(case.short.path), case.terms.traced_windows)


@dataclass(frozen=True)
class Item:
    """One question.

    Attributes
    ----------
    measure : callable
        Takes a case, and returns what is kept as JSON.
    fields : tuple of str
        Of the terms, on which that depends.
    images : str or None
        A file that it leaves beside its JSON.
    """

    measure: Callable[[Case], Any]
    fields: tuple[str, ...]
    images: str | None = None


WHOLE = ("preset", "size", "spp")
PLAIN = ("preset", "size", "windows")
BOTH = (*PLAIN, "window_size", "window_spp", "window_reference_spp", "traced_windows")
JUDGED = ("reference_spp", "crop", "crops", "most_spp")
ITEMS = {  # in the order of the paper's figures and tables
    "placement": Item(placement.measure, ("preset", "size", "sweep_step")),
    "statistics": Item(statistics.measure, WHOLE),
    "shares": Item(shares.measure, WHOLE),
    "times": Item(times.measure, (*WHOLE, *JUDGED)),
    "threshold": Item(_threshold, BOTH),
    "supports": Item(_supports, BOTH),
    "separation": Item(_separation, PLAIN, "separation.npz"),
    "reflections": Item(_reflections, PLAIN),
}


def measure(
    scenes: Sequence[str], items: Sequence[str], terms: Terms, folder: Path, monitor: Monitor
) -> dict[str, dict[str, Measured]]:
    """Measure what is asked, or read it where it was measured before on the same terms.

    Parameters
    ----------
    scenes
        Of ``room`` and ``atrium``.
    items
        Of :data:`ITEMS`.
    terms
    folder
        Gets a folder for each scene. Killed anywhere, the same call goes on: whole walkthroughs at their
        first missing frame, other items at their beginning, with the frames that they have traced.
    monitor

    Returns
    -------
    dict
        By scene and item, in the order of :data:`SCENES`: what was asked, and of other scenes what of it was
        measured before.

    Raises
    ------
    RunFolderError
        The folder holds scenes or walkthroughs made on other terms.
    """
    cases = {scene: Case(scene, terms, folder / scene, monitor) for scene in SCENES}
    for scene in scenes:
        cases[scene].check()
    asked = {name: ITEMS[name] for name in items}
    found: dict[str, dict[str, Measured]] = {}
    for scene in scenes:
        case = cases[scene]
        found[scene] = {
            name: case.stored(name, partial(item.measure, case), item.fields, item.images)
            for name, item in asked.items()
        }
    for scene in SCENES:
        if scene not in scenes:
            kept = {name: cases[scene].kept(name, item.fields, item.images) for name, item in asked.items()}
            found[scene] = {name: one for name, one in kept.items() if one is not None}
    return {scene: found[scene] for scene in SCENES}


def forecast_s(scenes: Sequence[str], items: Sequence[str], terms: Terms, cores: int) -> float:
    """Roughly how long items take that begin anew, wall seconds: by paths and frames alone."""
    whole, short = terms.size[0] * terms.size[1], terms.window_size[0] * terms.window_size[1]
    crop = min(terms.crop[0] * terms.crop[1], whole)
    total = 0.0
    for scene in scenes:
        frames = LENGTHS[terms.preset][scene]
        frame_s = FRAME_S * frames * max(whole / VGA, 0.2)
        if not {"statistics", "shares", "times"}.isdisjoint(items):
            total += PATH_S * whole * PATHS[scene] * frames * terms.spp + frame_s
        if "times" in items:  # the default method, and what is judged
            total += 1.5 * frame_s + PATH_S * crop * terms.crops * (terms.reference_spp + 2 * terms.most_spp)
        if not {"threshold", "supports"}.isdisjoint(items):
            windows = terms.traced_windows * (25 * terms.window_spp + terms.window_reference_spp)
            total += PATH_S * short * windows
        for item in VARIANTS.keys() & set(items):
            traced = short * terms.traced_windows if item in ("threshold", "supports") else 0
            total += VARIANT_S * VARIANTS[item] * (terms.windows * whole + traced) / VGA
    return total / max(cores, 1)
