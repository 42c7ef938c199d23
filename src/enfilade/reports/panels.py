"""Charts of a run over its frames: velocity, rays or traced pixels, quality, time (Figs. 12, 13)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from enfilade.reports.charts import BLUE, GREEN, PALETTE, PROVENANCE_COLORS, VERMILION, Panel, Series
from enfilade.reports.tables import spoken
from enfilade.runs.delivery import ANALYSIS, CLIPS, VIDEO

DELIVERY = frozenset({ANALYSIS.name, CLIPS.name, VIDEO.name})  # passes whose tasks cover many frames


def run_panels(summary: Mapping[str, Any], split_percent: float | None = None) -> list[Panel]:
    """Velocity, rays by kind or else traced pixels by reason, and predictions of the metric, if there are.

    Parameters
    ----------
    summary
        See :func:`~enfilade.runs.statistics.statistics`.
    split_percent
        Visible pixels, percent, above which segments are split; None: unknown.
    """
    analyzed = [row for row in summary["per_frame"] if row["velocity_deg_s"] is not None]
    speeds = {row["frame"]: row["velocity_deg_s"] for row in analyzed}
    effort = _rays_panel(summary) if summary["rays"] else _traced_panel(summary)
    found = [
        _velocity_panel(speeds, marked_keyframes(analyzed)),
        effort,
        _predictions_panel(summary["segments"], split_percent),
    ]
    return [panel for panel in found if any(series.values for series in panel.series)]


def marked_keyframes(rows: Sequence[Mapping[str, Any]]) -> list[int]:
    """Frames with keyframe pixels, from ``per_frame`` of a summary; none where all are traced whole."""
    found = [row["frame"] for row in rows if row["keyframe"]]
    return [] if len(found) == len(rows) else found


def plan_panels(plan: Mapping[str, Any]) -> list[Panel]:
    """Velocity with the initial keyframes, and slow and specular pixels; of ``Plan.to_dict()``."""
    frames = plan["frames"]
    speeds = dict(zip(frames, plan["mean_speed_deg_s"], strict=True))
    shares = tuple(
        Series(name, PROVENANCE_COLORS[name], dict(zip(frames, plan[f"{name}_percent"], strict=True)), mark)
        for name, mark in (("slow", "line"), ("specular", "dashed"))
    )
    pixels = Panel("pixels", "Slow and specular pixels", "%", "", shares, top=100.0)
    return [_velocity_panel(speeds, plan["keyframes"]), pixels]


def quality_panel(difference: Mapping[str, Any]) -> Panel:
    """Visible difference of each frame from a reference; of ``SequenceDifference.to_dict()``."""
    scores = {row["number"]: row["score_jnd"] for row in difference["per_frame"]}
    least, most = min(scores.values()), max(scores.values())
    text = f"Visible difference from the reference: {least:.2f} to {most:.2f} just noticeable differences."
    series = [Series("score", GREEN, scores)]
    if floor := difference["noise_floor"]:
        floors = dict(zip(scores, floor["per_frame_jnd"], strict=True))
        series.append(Series("noise floor: reference against reference", VERMILION, floors, "dashed"))
        most = max(most, *floors.values())
    return Panel(
        "quality",
        "Visible difference from the reference",
        "JND",
        text,
        tuple(series),
        top=1.1 * max(most, 1.0),
    )


def time_panel(lines: Iterable[Mapping[str, Any]], rays: Mapping[str, float]) -> Panel:
    """Wall time of the tasks of each frame by pass, without analysis and video.

    Parameters
    ----------
    lines
        Of the ledger.
    rays
        Of the summary: a pass has the colour of the rays of its name.
    """
    spent: dict[str, dict[int, float]] = {}
    for line in lines:
        if line["pass"] not in DELIVERY:
            seconds = sum(stage["wall_s"] for stage in line["cost"].values())
            spent.setdefault(line["pass"], {})[line["frame"]] = seconds
    series, totals = _stacked(spent, [*(kind for kind, mean in rays.items() if mean), *spent])
    text = f"Time of the tasks of each frame, by pass: at most {max(totals, default=0.0):.1f} seconds."
    return Panel("time", "Time, by pass", "s", text, series, top=1.05 * max(totals, default=1.0) or 1.0)


def _velocity_panel(speeds: Mapping[int, float], keyframes: Iterable[int]) -> Panel:
    marks = {frame: speeds[frame] for frame in keyframes}
    series = [Series("mean over the image", BLUE, speeds), Series("keyframes", VERMILION, marks, "triangle")]
    least, most = min(speeds.values(), default=0.0), max(speeds.values(), default=0.0)
    text = f"Mean image velocity of each frame: {least:.2f} to {most:.2f} degrees per second."
    kept = tuple(s for s in series if s.values)
    return Panel("velocity", "Image velocity", "deg/s", text, kept, top=1.08 * max(most, 0.1))


def _rays_panel(summary: Mapping[str, Any]) -> Panel:
    rows = summary["rays_per_frame"]
    counts = {
        kind: {row["frame"]: row.get(kind, 0.0) for row in rows}
        for kind, mean in summary["rays"].items()
        if mean
    }
    series, totals = _stacked(counts, counts)
    mean = sum(summary["rays"].values())
    return Panel(
        "rays",
        "Rays per pixel, by kind",
        "",
        f"Rays per pixel of each frame, by kind: {mean:.1f} on average over the path.",
        series,
        top=1.05 * max(totals, default=1.0) or 1.0,
        level=(mean, f"mean {mean:.1f}"),
    )


def _traced_panel(summary: Mapping[str, Any]) -> Panel:
    rows, mean = summary["per_frame"], summary["traced_percent"]["total"]
    series = [
        Series(name, color, {row["frame"]: row[name] for row in rows}, "bar")
        for name, color in PROVENANCE_COLORS.items()
    ]
    return Panel(
        "traced",
        "Pixels traced, by reason",
        "%",
        f"Pixels traced in each frame, by reason: {mean:.1f} percent on average.",
        tuple(s for s in series if any(s.values.values())),
        top=100.0,
        level=(mean, f"mean {mean:.1f} %"),
    )


def _predictions_panel(segments: Sequence[Mapping[str, Any]], split_percent: float | None) -> Panel:
    """Predictions of the metric for the middles of segments, before and after segments are split (§4.3)."""
    compared = [s for s in segments if None not in (s["middle"], s["percent_visible"])]
    compared.sort(key=lambda s: s["middle"])
    chosen = {
        ("before split", "square"): [s for s in compared if s["depth"] == 0],
        ("after split", "circle"): [s for s in compared if not s["is_split"]],
    }
    eyes = (
        ("pursuit", "percent_visible", VERMILION),
        ("at rest", "percent_visible_no_pursuit", BLUE),
    )
    series = [
        Series(f"{eye}, {when}", color, {s["middle"]: s[key] for s in of if s.get(key) is not None}, mark)
        for eye, key, color in eyes
        for (when, mark), of in chosen.items()
    ]
    most = max((s["percent_visible"] for s in compared), default=0.0)
    split = sum(s["is_split"] for s in compared)
    return Panel(
        "predictions",
        "Predicted visible pixels",
        "%",
        f"Visible pixels that the metric predicts for segment middles: at most {most:.1f} percent; "
        f"{split} of {len(compared)} segments were split.",
        tuple(s for s in series if s.values),
        top=1.2 * max(most, split_percent or 0.1),
        level=None if split_percent is None else (split_percent, f"split above {split_percent:g} %"),
    )


def _stacked(
    values: Mapping[str, Mapping[int, float]], names: Iterable[str]
) -> tuple[tuple[Series, ...], list[float]]:
    """Bars of equal frames, in colours by the order of names, and their sum at each frame."""
    colors = dict(zip(dict.fromkeys(names), itertools.cycle(PALETTE), strict=False))
    frames = sorted({frame for of in values.values() for frame in of})
    series = tuple(
        Series(spoken(name), colors[name], {f: of.get(f, 0.0) for f in frames}, "bar")
        for name, of in values.items()
    )
    return series, [sum(s.values[f] for s in series) for f in frames]
