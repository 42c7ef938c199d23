"""Tables of a run and a comparison for a terminal, and their number formats."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

TRACED_COLUMNS = {  # titles of the columns of Table 1, by key of the summary
    "slow": "slow",
    "specular": "specular",
    "occlusion": "disoccluded",
    "keyframes": "keyframes",
    "total": "total",
}
WORST_FRAMES = 8  # of a comparison


def run_tables(summary: Mapping[str, Any]) -> list[Table]:
    """Rays by kind, or traced pixels by reason (Table 1); and time by stage (Table 2).

    Parameters
    ----------
    summary
        See :func:`~enfilade.runs.statistics.statistics`.
    """
    return [_rays_table(summary) if summary["rays"] else _traced_table(summary), _time_table(summary)]


def result_line(found: Mapping[str, Any]) -> str:
    """The result of a comparison, ``SequenceDifference.to_dict()``, in one line."""
    visible = percent(found["percent_visible"]["mean"])
    return f"{found['score_jnd']:.2f} JND ({found['meaning']}); {visible} % of the pixels above 1 JND"


def comparison_table(found: Mapping[str, Any]) -> Table:
    """Frames with the largest differences, and the whole sequence; of ``SequenceDifference.to_dict()``."""
    from enfilade.comparison import short_name

    rows = found["per_frame"]
    width, height = found["size"]
    table = _table(
        f"{len(rows)} frames, {width}x{height}, {found['pixels_per_degree']:.1f} pixels per degree, "
        f"{found['fps']:g} fps, mode {found['mode']}",
        ("frame", "JND", "steady", "transient", "visible, %", "PSNR, dB", "deg/s"),
    )
    for row in sorted(rows, key=lambda r: -r["score_jnd"])[:WORST_FRAMES]:
        table.add_row(Text(short_name(row["name"])), *_difference(row, row["percent_visible"]))
    if len(rows) > WORST_FRAMES:
        table.caption = f"the {WORST_FRAMES} frames with the largest score; --json lists all"
    table.add_section()
    velocity = sum(row["velocity_deg_s"] for row in rows) / len(rows)
    whole = {**found, "velocity_deg_s": velocity}
    table.add_row("sequence", *_difference(whole, found["percent_visible"]["mean"]))
    return table


def psnr_text(found: Mapping[str, Any]) -> str:
    """The PSNR of a compared frame or sequence, as plain values."""
    if found["psnr_db"] is None:
        return "identical" if found["is_identical"] else "infinite"
    return f"{found['psnr_db']:.2f} dB"


def spoken(name: str) -> str:
    """The name of a pass or of a kind of rays as words: ``hash_grid`` is "hash grid"."""
    return name.replace("_", " ")


def percent(value: float) -> str:
    """A percentage with one decimal; two below 1 percent."""
    return f"{value:.2f}" if 0.0 < abs(value) < 1.0 else f"{value:.1f}"


def seconds(value: float) -> str:
    """A time with its unit and about three digits."""
    if value >= 3600.0:
        return f"{value / 3600.0:.2f} h"
    if value >= 100.0:
        return f"{value / 60.0:.1f} min"
    return f"{value:.2f} s" if value >= 0.1 else f"{1000.0 * value:.1f} ms"


def _rays_table(summary: Mapping[str, Any]) -> Table:
    rays = summary["rays"]
    table = _table("Rays per pixel and frame", ("method", *map(spoken, rays), "total"))
    table.add_row(summary["method"], *(f"{count:.2f}" for count in (*rays.values(), sum(rays.values()))))
    return table


def _traced_table(summary: Mapping[str, Any]) -> Table:
    table = _table("Pixels traced, percent (Table 1)", ("method", *TRACED_COLUMNS.values()))
    table.add_row(summary["method"], *(percent(summary["traced_percent"][key]) for key in TRACED_COLUMNS))
    return table


def _time_table(summary: Mapping[str, Any]) -> Table:
    times = summary["time_s"]
    total = max(times["total_s"], 1e-9)
    table = _table("Time (Table 2)", ("stage", "wall", "CPU", "wall per frame", "%"))
    for name, spent in times["stages"].items():
        wall = spent["wall_s"]
        per_frame = seconds(wall / summary["frames"])
        table.add_row(
            spoken(name), seconds(wall), seconds(spent["cpu_s"]), per_frame, percent(100.0 * wall / total)
        )
    table.add_section()
    sums = (seconds(times[key]) for key in ("total_s", "cpu_s", "per_frame_s"))
    table.add_row("total", *sums, percent(100.0))
    return table


def _difference(row: Mapping[str, Any], visible: float) -> list[str]:
    scores = [f"{row[key]:.3f}" for key in ("score_jnd", "steady_jnd", "transient_jnd")]
    return [*scores, percent(visible), psnr_text(row).removesuffix(" dB"), f"{row['velocity_deg_s']:.2f}"]


def _table(title: str, columns: Iterable[str]) -> Table:
    table = Table(title=title, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD)
    for number, name in enumerate(columns):
        table.add_column(name, justify="right" if number else "left")
    return table
