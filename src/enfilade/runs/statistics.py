"""Work and cost of a run so far, from its ledger alone: Tables 1 and 2, Figs. 12 and 13 (§6)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from enfilade.methods.base import FRAMES
from enfilade.runs.delivery import ANALYSIS, VIDEO
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import read_table
from enfilade.settings import ViewingSettings
from enfilade.viewing import Viewing

TRACED = ("slow", "specular", "disoccluded", "keyframe")  # of `records.Provenance`, in the order of Table 1


def statistics(run: RunFolder) -> dict[str, Any]:
    """Gather the figures of a finished or running run.

    Returns
    -------
    dict
        ``method``, ``frames`` (of the path), ``size``, ``fps``, ``video``. ``traced_percent``: pixels traced,
        percent of those of the finished frames, by provenance. ``time_s``: wall and CPU seconds, in total, by
        frame of the path and by stage, of the last execution of each task; failed attempts and the loading of
        scenes are not counted. ``per_frame``: provenance of the pixels of each finished frame, percent, with
        the mean velocity (or None). ``rays``: per pixel and frame of the path, by kind; ``rays_per_frame``:
        of each frame. ``segments``: the metric's result for each segment. ``dropped_samples``: NaN or
        infinite samples that were left out. ``black_frames``: numbers of the finished frames whose pixels are
        all black.
    """
    lines, path = list(run.lines()), run.identity["path"]
    count = len(path["frames"])
    per_frame = _per_frame(path, lines, _speeds_deg_s(path, lines, _viewing(run)))
    traced_percent = {name: sum(row[name] for row in per_frame) / max(len(per_frame), 1) for name in TRACED}
    rays = _rays(path, lines)
    kinds = dict.fromkeys(kind for row in rays for kind in row if kind != "frame")
    stages = add_costs(line.get("cost", {}) for line in lines)
    wall, cpu = (sum(s[kind] for s in stages.values()) for kind in ("wall_s", "cpu_s"))
    return {
        "method": run.identity["method"]["name"],
        "frames": count,
        "size": list(path["size"]),
        "fps": path["fps"],
        "video": next((name for line in lines if line["pass"] == VIDEO.name for name in line["files"]), ""),
        "traced_percent": {**traced_percent, "total": sum(traced_percent.values())},
        "time_s": {"total_s": wall, "per_frame_s": wall / count, "cpu_s": cpu, "stages": stages},
        "per_frame": per_frame,
        "rays": {kind: sum(row.get(kind, 0.0) for row in rays) / count for kind in kinds},
        "rays_per_frame": rays,
        "segments": [segment for line in lines for segment in line.get("segments", ())],
        "dropped_samples": sum(line.get("dropped", 0) for line in lines),
        "black_frames": sorted(line["frame"] for line in lines if line.get("is_black")),
    }


def add_costs(costs: Iterable[Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Sum the costs of tasks, by stage."""
    total: dict[str, dict[str, float]] = {}
    for cost in costs:
        for stage, spent in cost.items():
            into = total.setdefault(stage, {"wall_s": 0.0, "cpu_s": 0.0})
            for kind, seconds in spent.items():
                into[kind] += seconds
    return total


def _viewing(run: RunFolder) -> Viewing:
    """Viewing conditions of the video, on which the results of not every method depend."""
    settings = ViewingSettings.from_table(read_table(run.folder)["settings"].get("viewing", {}))
    path = run.identity["path"]
    width, height = path["size"]
    return settings.conditions(width, height, path["fps"])


def _speeds_deg_s(
    path: Mapping[str, Any], lines: Iterable[Mapping[str, Any]], viewing: Viewing
) -> dict[int, float]:
    """Mean image velocity of the frames that are analyzed, deg/s, by index on the path."""
    places = {number: index for index, number in enumerate(path["frames"])}
    return {
        places[line["frame"]] + offset: viewing.velocity_deg_s(float(table["speed_px"]))
        for line in lines
        if line["pass"] == ANALYSIS.name
        for offset, table in enumerate(line["frames"])
    }


def _per_frame(
    path: Mapping[str, Any], lines: list[dict[str, Any]], speed_deg_s: Mapping[int, float]
) -> list[dict[str, Any]]:
    counts = {line["frame"]: line["provenance"] for line in lines if line["pass"] == FRAMES}
    pixels = path["size"][0] * path["size"][1]
    rows = []
    for index, number in enumerate(path["frames"]):
        if number in counts:
            row = {name: 100.0 * counts[number][name] / pixels for name in TRACED}
            speed = speed_deg_s.get(index)
            rows.append({"frame": number, "velocity_deg_s": speed, **row, "traced": sum(row.values())})
    return rows


def _rays(path: Mapping[str, Any], lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rays a pixel of each frame, by kind."""
    counted: dict[int, dict[str, int]] = {}
    for line in lines:
        for kind, count in line.get("rays", {}).items():
            of = counted.setdefault(line["frame"], {})
            of[kind] = of.get(kind, 0) + count
    pixels = path["size"][0] * path["size"][1]
    return [
        {"frame": number, **{kind: count / pixels for kind, count in counted[number].items()}}
        for number in path["frames"]
        if number in counted
    ]
