"""Refinement by the number of paths: segments that are split, and predictions (Figs. 12b, 13b)."""

from __future__ import annotations

from typing import Any

from enfilade.methods.walkthrough import Walkthrough
from enfilade.settings import MaskSettings, SamplingSettings
from studies.cases.case import Case
from studies.cases.statistics import predictions, refined

SPPS = (8, 32, 128)


def measure(case: Case) -> dict[str, Any]:
    """Refine all initial segments without noise, and path traced with several numbers of paths.

    Returns
    -------
    dict
        By light, ``"no noise"`` or the number of paths: ``segments`` as in a summary, and ``predictions``
        (:func:`~studies.cases.statistics.predictions`).
    """
    whole = case.walk
    lights = {"no noise": case.noise_free_windows.walk}
    for spp in SPPS:
        settings = whole.settings.replace(SamplingSettings, spp=spp)
        lights[str(spp)] = Walkthrough(whole.path, settings, whole.renderer)
    limit = whole.settings[MaskSettings].split_percent
    found = {}
    for light, walk in lights.items():
        segments = refined(case, walk, light)
        found[light] = {"segments": segments, "predictions": predictions(segments, limit)}
    return found


def agreement(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> tuple[int, int]:
    """Initial segments of which both lights make the same decision, and their number."""
    decisions = [
        {(s["first"], s["last"]): s["is_split"] for s in of if s["depth"] == 0 and s["middle"] is not None}
        for of in (one, other)
    ]
    same = sum(decisions[1][ends] == is_split for ends, is_split in decisions[0].items())
    return same, len(decisions[0])
