"""Tables 1 and 2 (§6) of a run, and the table of a plan, for a terminal or a text file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

SOURCES = {  # Table 1, in its order: key of the summary, heading
    "slow": "slow",
    "specular": "specular",
    "occlusion": "occlusion",
    "keyframes": "keyframes",
    "total": "total",
}


RAYS = {"camera": "camera", "lobes": "lobes", "light": "light", "drafts": "drafts"}  # key, heading
WORST_FRAMES = 8  # of a comparison: what fits on a screen


def run_tables(summary: Mapping[str, Any]) -> list[Table]:
    """Tables 1 and 2 of a finished run; of one that counts rays, these in place of Table 1.

    Parameters
    ----------
    summary
        What ``summary.json`` holds.
    """
    first = rays_table(summary) if summary.get("rays") else traced_table(summary)
    return [first, time_table(summary)]


def rays_table(summary: Mapping[str, Any]) -> Table:
    """Rays sent for a pixel and frame, by purpose."""
    table = _table("Rays per pixel and frame", "method", *RAYS.values(), "total")
    rays = summary["rays"]
    counts = [*(rays[kind] for kind in RAYS), sum(rays.values())]
    table.add_row(str(summary.get("method", "")), *(f"{count:.2f}" for count in counts))
    return table


def traced_table(summary: Mapping[str, Any]) -> Table:
    """Table 1: percentage of pixels that were path traced, by reason."""
    table = _table("Pixels traced, percent (Table 1)", "method", *SOURCES.values())
    shares = summary["table1"]
    table.add_row(str(summary.get("method", "")), *(percent(shares[key]) for key in SOURCES))
    return table


def time_table(summary: Mapping[str, Any]) -> Table:
    """Table 2: where the time went, stage by stage; wall-clock and CPU seconds."""
    times = summary["table2"]
    count = _frame_count(summary)
    table = _table("Time (Table 2)", "stage", "wall", "CPU", "wall per frame", "share")
    total = max(float(times["total_s"]), 1e-9)
    for name, stage in times["stages"].items():
        wall = float(stage["wall_s"])
        cells = (seconds(wall), seconds(stage["cpu_s"]), seconds(wall / count), percent(100.0 * wall / total))
        table.add_row(name, *cells)
    table.add_section()
    row = (seconds(times["total_s"]), seconds(times["cpu_s"]), seconds(times["per_frame_s"]), percent(100.0))
    table.add_row("total", *row)
    return table


def plan_tables(plan: Mapping[str, Any]) -> list[Table]:
    """What a plan expects: the walkthrough at a glance, and the forecast of cost.

    Parameters
    ----------
    plan
        ``Plan.to_dict()``.
    """
    made = _rehearsed_table if plan["method"] == "decoupled" else _forecast_table
    return [_walk_table(plan), made(plan["forecast"])]


def _walk_table(plan: Mapping[str, Any]) -> Table:
    table = _table("Walkthrough, per frame", "", "mean", "least", "most")
    rows = {
        "image velocity, deg/s": ("mean_speed_deg_s", "{:.2f}"),
        "slow pixels, percent": ("slow_percent", "{:.1f}"),
        "specular pixels, percent": ("specular_percent", "{:.1f}"),
        "holes, percent (estimate)": ("hole_percent", "{:.1f}"),
    }
    for title, (key, form) in rows.items():
        values = [float(v) for v in plan.get(key) or [] if v is not None]
        if values:
            figures = (sum(values) / len(values), min(values), max(values))
            table.add_row(title, *(form.format(v) for v in figures))
    frames, keyframes = plan["frames"], plan["keyframes"]
    table.caption = f"{len(frames)} frames, {len(keyframes)} initial keyframes: {_listed(keyframes)}"
    return table


def _forecast_table(forecast: Mapping[str, Any]) -> Table:
    table = _table("Forecast", "", "")
    table.add_row("pixels traced, percent", percent(forecast["traced_percent"]))
    for reason, share in forecast["shares_percent"].items():
        table.add_row(f"  {reason}", percent(share))
    if "traced_percent_least" in forecast:
        table.add_row("  if no specular surface has to be", percent(forecast["traced_percent_least"]))
    table.add_row("paths", f"{forecast['paths']:,}")
    table.add_row("time of tracing", seconds(forecast["seconds"]))
    table.caption = "Splits of segments are not foreseen."
    return table


def _rehearsed_table(forecast: Mapping[str, Any]) -> Table:
    table = _table("Forecast", "", "")
    table.add_row("rays per pixel and frame", f"{sum(forecast['rays'].values()):.1f}")
    for kind, title in RAYS.items():
        table.add_row(f"  {title}", f"{forecast['rays'][kind]:.2f}")
    table.add_row("paths of a keyframe's pixel", str(forecast["paths"]))
    table.add_row("time", seconds(forecast["seconds"]))
    table.add_row("CPU time", seconds(forecast["cpu_seconds"]))
    width, height = forecast["rehearsed_size"]
    table.caption = f"Rehearsed with {forecast['rehearsed_frames']} frames at {width}x{height}."
    return table


def verdict(found: Mapping[str, Any]) -> str:
    """The result of a comparison in one line: score, meaning, and how much of the image it concerns.

    Parameters
    ----------
    found
        ``SequenceDifference.to_dict()``.
    """
    share = percent(found["percent_visible"]["mean"])
    return f"{found['score_jnd']:.2f} JND ({found['meaning']}); {share} % of the pixels above 1 JND"


def comparison_table(found: Mapping[str, Any]) -> Table:
    """What the metric says of two sequences, and of the frames where it sees most.

    Parameters
    ----------
    found
        ``SequenceDifference.to_dict()``.
    """
    width, height = found["size"]
    table = _table("", "frame", "JND", "steady", "transient", "visible, %", "PSNR, dB", "deg/s")
    rows = found["per_frame"]
    for row in sorted(rows, key=lambda r: -r["score_jnd"])[:WORST_FRAMES]:
        table.add_row(Text(_short(row["name"])), *_difference(row, row["percent_visible"]))
    if len(rows) > WORST_FRAMES:
        table.caption = f"the {WORST_FRAMES} frames with most; --json lists all"
    table.add_section()
    velocity = sum(row["velocity_deg_s"] for row in rows) / len(rows)
    table.add_row(
        "sequence", *_difference({**found, "velocity_deg_s": velocity}, found["percent_visible"]["mean"])
    )
    density = f"{found['pixels_per_degree']:.1f} pixels per degree"
    table.title = (
        f"{len(rows)} frames, {width}x{height}, {density}, {found['fps']:g} fps, mode {found['mode']}"
    )
    return table


def percent(value: float) -> str:
    """A share with one digit after the point; two below 1 percent, where the paper's holes are."""
    return f"{value:.2f}" if 0.0 < abs(value) < 1.0 else f"{value:.1f}"


def seconds(value: float) -> str:
    """A time with its unit and about three digits."""
    if value >= 3600.0:
        return f"{value / 3600.0:.2f} h"
    if value >= 100.0:
        return f"{value / 60.0:.1f} min"
    return f"{value:.2f} s" if value >= 0.1 else f"{1000.0 * value:.1f} ms"


def _short(name: str) -> str:
    # "frame 3 of walk.mp4", or the path of an image
    return name.partition(" of ")[0] if name.startswith("frame ") else name.rpartition("/")[2]


def _difference(row: Mapping[str, Any], visible: float) -> list[str]:
    scores = [f"{row[key]:.3f}" for key in ("score_jnd", "steady_jnd", "transient_jnd")]
    psnr = "identical" if row["psnr_db"] is None else f"{row['psnr_db']:.2f}"
    return [*scores, percent(visible), psnr, f"{row['velocity_deg_s']:.2f}"]


def _listed(numbers: list[int], most: int = 12) -> str:
    shown = ", ".join(str(n) for n in numbers[:most])
    return shown if len(numbers) <= most else f"{shown}, ... {numbers[-1]}"


def _frame_count(summary: Mapping[str, Any]) -> int:
    frames = summary["frames"]
    return max(len(frames) if isinstance(frames, list) else int(frames), 1)


def _table(title: str, first: str, *others: str) -> Table:
    table = Table(title=title, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD)
    table.add_column(first)
    for name in others:
        table.add_column(name, justify="right")
    return table
