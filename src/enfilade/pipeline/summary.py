"""What a run did and what it cost, from its ledger and nothing else: Tables 1 and 2 (§6)."""

from __future__ import annotations

import resource
from typing import Any

from enfilade.pipeline.cost import add_costs
from enfilade.pipeline.survey import Survey
from enfilade.pipeline.workshop import Workshop

TRACED = {"slow": "slow", "specular": "specular", "occlusion": "hole", "keyframes": "keyframe"}


def summarize(workshop: Workshop, survey: Survey, video: str) -> dict[str, Any]:
    """Gather the figures of a finished run.

    Returns
    -------
    dict
        ``table1``: pixels traced, percent of all, by reason. ``table2``: time in total, by frame and
        by stage, of all sessions that worked on the run. ``per_frame`` and ``segments``: Figs. 12
        and 13. ``peak_memory_bytes``: of this process.
    """
    job, lines = workshop.job, list(workshop.run.lines())
    per_frame = _per_frame(workshop, survey, lines)
    count = len(per_frame)
    table1 = {name: sum(row[source] for row in per_frame) / count for name, source in TRACED.items()}
    stages = add_costs([line["cost"] for line in lines])
    wall, cpu = (sum(s[kind] for s in stages.values()) for kind in ("wall_s", "cpu_s"))
    return {
        "method": job.method,
        "frames": count,
        "size": [job.path.width, job.path.height],
        "fps": job.path.fps,
        "spp": job.settings.trace.spp,
        "split_percent": job.settings.masks.split_percent,
        "table1": {**table1, "total": sum(table1.values())},
        "table2": {
            "total_s": wall,
            "per_frame_s": wall / count,
            "cpu_s": cpu,
            "stages": stages,
        },
        "per_frame": per_frame,
        "segments": [_segment(line) for line in lines if "verdict" in line],
        "dropped_samples": sum(line.get("dropped", 0) for line in lines),
        "peak_memory_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "video": video,
    }


def _per_frame(workshop: Workshop, survey: Survey, lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    sources = {line["frame"]: line["sources"] for line in lines if "sources" in line}
    pixels = workshop.job.path.width * workshop.job.path.height
    rows = []
    for number, speed in zip(workshop.job.path.numbers, survey.speed_deg_s, strict=True):
        row = {s: 100.0 * sources[number][s] / pixels for s in TRACED.values()}
        rows.append({"frame": number, "velocity_deg_s": speed, **row, "traced": sum(row.values())})
    return rows


def _segment(line: dict[str, Any]) -> dict[str, Any]:
    verdict = line["verdict"]
    return {
        "first": line["first"],
        "last": line["last"],
        "middle": line["middle"],
        "depth": line["depth"],
        "percent_visible": verdict["percent_visible"],
        "percent_visible_no_pursuit": verdict["percent_visible_no_pursuit"],
        "is_split": verdict["is_split"],
        "items": len(verdict["items"]),
    }
