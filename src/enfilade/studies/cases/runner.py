"""All case studies: each item measured once a scene, kept as JSON, images as they are looked at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from enfilade.codec import write_arrays
from enfilade.monitor import Monitor
from enfilade.studies.cases import (
    placement,
    reflections,
    separation,
    shares,
    statistics,
    supports,
    threshold,
    times,
)
from enfilade.studies.cases.case import Case
from enfilade.studies.cases.terms import Terms
from enfilade.studies.cases.windows import probes_of

__all__ = ["ITEMS", "forecast_s", "measure"]

PATH_S = 4.5e-6  # CPU seconds of a path on one of two busy hyperthreads; for a rough forecast
FRAME_S = 1.5  # ... and of all but tracing for a frame of 640x480
VARIANT_S = 2.5  # ... and of filtering and judging one of 640x480 once
VGA = 640 * 480
VARIANTS = 160  # of filters and thresholds that are tried on a window
PATHS = {"room": 0.4, "atrium": 0.55}  # share of pixels that the paper's method traces
LENGTHS = {"full": {"room": 448, "atrium": 200}, "small": {"room": 60, "atrium": 60}}


def _threshold(case: Case) -> dict[str, Any]:
    terms = threshold.Calibration()
    plain, traced = case.plain_windows, case.windows
    count = case.terms.windows
    return {
        "plain": threshold.calibrate(plain, probes_of(case.survey, len(case.whole.path), count), terms),
        "traced": threshold.calibrate(
            traced, probes_of(case.short_survey, len(case.short.path), count), terms
        ),
    }


def _supports(case: Case) -> dict[str, Any]:
    terms = supports.Supports()
    count = case.terms.windows
    return {
        "plain": supports.measure(
            case.plain_windows, probes_of(case.survey, len(case.whole.path), count), terms
        ),
        "traced": supports.measure(
            case.windows, probes_of(case.short_survey, len(case.short.path), count), terms
        ),
    }


def _separation(case: Case) -> dict[str, Any]:
    probes = probes_of(case.survey, len(case.whole.path), case.terms.windows)
    rows, example = separation.measure(case.plain_windows, probes)
    write_arrays(case.folder / "separation.npz", example)
    return rows


def _reflections(case: Case) -> dict[str, Any]:
    probes = reflections.most_mirrors(case.plain_windows, case.terms.windows)
    if not probes:
        return {"frames": []}
    rows, example = reflections.measure(case.plain_windows, probes)
    write_arrays(case.folder / "reflections.npz", example)
    return rows


ITEMS: dict[str, Callable[[Case], Any]] = {  # in the order of the paper's figures and tables
    "placement": placement.measure,
    "statistics": statistics.measure,
    "shares": shares.measure,
    "times": times.measure,
    "threshold": _threshold,
    "supports": _supports,
    "separation": _separation,
    "reflections": _reflections,
}


def measure(
    scenes: Sequence[str], items: Sequence[str], terms: Terms, folder: Path, monitor: Monitor
) -> dict[str, dict[str, Any]]:
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
        By scene and item.
    """
    found: dict[str, dict[str, Any]] = {}
    for scene in scenes:
        case = Case(scene, terms, folder / scene, monitor)
        found[scene] = {name: case.stored(name, partial(ITEMS[name], case)) for name in items}
    return found


def forecast_s(scenes: Sequence[str], terms: Terms, cores: int) -> float:
    """Roughly how long everything takes that begins anew, wall seconds: by paths and frames alone."""
    whole, short = terms.size[0] * terms.size[1], terms.window_size[0] * terms.window_size[1]
    crop = min(terms.crop[0] * terms.crop[1], whole)
    total = 0.0
    for scene in scenes:
        frames = LENGTHS[terms.preset][scene]
        spp = PATHS[scene] * frames * terms.spp
        windows = terms.windows * (25 * terms.window_spp + terms.reference_spp)
        judged = terms.crops * (terms.reference_spp + 2 * terms.most_spp)
        total += PATH_S * (whole * spp + short * windows + crop * judged)
        total += FRAME_S * (frames + 3 * terms.decoupled_frames) * max(whole / VGA, 0.2)
        total += VARIANT_S * VARIANTS * terms.windows * (whole + short) / VGA
    return total / max(cores, 1)
