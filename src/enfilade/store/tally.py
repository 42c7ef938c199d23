"""What a run has done and spent so far, from its ledger alone: Tables 1 and 2, Figs. 12 and 13 (§6)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

__all__ = ["add_costs", "tally"]

TRACED = {"slow": "slow", "specular": "specular", "occlusion": "hole", "keyframes": "keyframe"}
RAYS = ("camera", "lobes", "light", "drafts")  # what rays are sent for, where a method counts them


def tally(
    identity: Mapping[str, Any], lines: Iterable[Mapping[str, Any]], speed_deg_s: Sequence[float] | None
) -> dict[str, Any]:
    """Gather the figures of a finished or a running run.

    Parameters
    ----------
    identity
        As ``run.json`` has it.
    lines
        Of the ledger; those of unfinished units are missing.
    speed_deg_s
        Mean image velocity of each frame of the path; None where it is not known yet.

    Returns
    -------
    dict
        ``frames``: of the path. ``table1``: pixels traced, percent of those of the frames that are known,
        by reason. ``table2``: seconds in total, by frame of the path and by stage, of all sessions that
        worked on the run. ``per_frame``: frames of which it is known where their pixels come from, in
        percent, with their mean velocity (or None). ``rays``: of a run that counts them, how many were sent
        for a pixel and frame of the path, by purpose, and ``rays_per_frame``: the same of each frame, where
        it is known. ``segments``: what the metric said of each.
        ``dropped_samples``: that were NaN or infinite.
    """
    kept = list(lines)
    path, settings = identity["path"], identity["settings"]
    count = len(path["frames"])
    per_frame = _per_frame(path, kept, speed_deg_s)
    table1 = {
        name: sum(row[source] for row in per_frame) / max(len(per_frame), 1)
        for name, source in TRACED.items()
    }
    rays = _rays(path, kept)
    stages = add_costs(line.get("cost", {}) for line in kept)
    wall, cpu = (sum(s[kind] for s in stages.values()) for kind in ("wall_s", "cpu_s"))
    return {
        "method": identity["method"],
        "frames": count,
        "size": list(path["size"]),
        "fps": path["fps"],
        "spp": settings["trace"]["spp"],
        "split_percent": settings["masks"]["split_percent"],
        "table1": {**table1, "total": sum(table1.values())},
        "table2": {"total_s": wall, "per_frame_s": wall / count, "cpu_s": cpu, "stages": stages},
        "per_frame": per_frame,
        "rays": {kind: sum(row[kind] for row in rays) / count for kind in RAYS} if rays else {},
        "rays_per_frame": rays,
        "segments": [_segment(line) for line in kept if "verdict" in line],
        "dropped_samples": sum(line.get("dropped", 0) for line in kept),
    }


def add_costs(costs: Iterable[Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Sum the costs of many units, by stage."""
    total: dict[str, dict[str, float]] = {}
    for cost in costs:
        for stage, spent in cost.items():
            into = total.setdefault(stage, {"wall_s": 0.0, "cpu_s": 0.0})
            for kind, seconds in spent.items():
                into[kind] += seconds
    return total


def _per_frame(
    path: Mapping[str, Any], lines: list[Mapping[str, Any]], speed_deg_s: Sequence[float] | None
) -> list[dict[str, Any]]:
    sources = {line["frame"]: line["sources"] for line in lines if "sources" in line}
    pixels = path["size"][0] * path["size"][1]
    rows = []
    for index, number in enumerate(path["frames"]):
        if number in sources:
            row = {s: 100.0 * sources[number][s] / pixels for s in TRACED.values()}
            speed = None if speed_deg_s is None else speed_deg_s[index]
            rows.append({"frame": number, "velocity_deg_s": speed, **row, "traced": sum(row.values())})
    return rows


def _rays(path: Mapping[str, Any], lines: list[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rays sent for a pixel of each frame."""
    counted: dict[int, dict[str, int]] = {}
    for line in lines:
        for kind, count in line.get("rays", {}).items():
            of = counted.setdefault(line["frame"], dict.fromkeys(RAYS, 0))
            of[kind] += count
    pixels = path["size"][0] * path["size"][1]
    return [
        {"frame": number, **{kind: count / pixels for kind, count in counted[number].items()}}
        for number in path["frames"]
        if number in counted
    ]


def _segment(line: Mapping[str, Any]) -> dict[str, Any]:
    verdict = line["verdict"]
    return {
        "first": line["first"],
        "last": line["last"],
        "middle": line["middle"],
        "depth": line["depth"],
        "percent_visible": verdict["percent_visible"],
        "percent_visible_no_pursuit": verdict["percent_visible_no_pursuit"],
        "is_split": verdict["is_split"],
        "unseen_items": len(verdict["unseen"]),
    }
