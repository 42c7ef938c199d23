"""Tables of a run and a comparison: their figures as text, for a terminal and for the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

WORST_FRAMES = 8  # of a comparison
UNITS = {"psnr": " dB", "cvvdp": " JOD"}  # of further measures


def run_tables(summary: Mapping[str, Any]) -> list[Table]:
    """Rays by kind, or traced pixels by reason (Table 1); and time by stage (Table 2).

    Parameters
    ----------
    summary
        See :func:`~enfilade.runs.statistics.statistics`.
    """
    if summary["rays"]:
        title, columns = "Rays per pixel and frame", rays_columns(summary)
    else:
        title, columns = "Pixels traced, percent (Table 1)", traced_columns(summary)
    effort = _table(title, ("method", *(name for name, _ in columns)))
    effort.add_row(summary["method"], *(figure for _, figure in columns))
    time = _table("Time (Table 2)", ("stage", "wall", "CPU", "wall per frame", "%"))
    *stages, total = time_rows(summary)
    for stage in stages:
        time.add_row(*stage.values())
    time.add_section()
    time.add_row(*total.values())
    return [effort, time]


def rays_columns(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Rays per pixel and frame, by kind and in total: title and figure of each column."""
    total = sum(summary["rays"].values())
    return [(spoken(kind), f"{count:.2f}") for kind, count in (*summary["rays"].items(), ("total", total))]


def traced_columns(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Table 1, pixels traced by reason and in total, percent: title and figure of each column."""
    return [(name, percent(share)) for name, share in summary["traced_percent"].items()]


def time_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Table 2, time by stage and in total: name, wall, CPU, wall per frame and percent of each row."""
    times = summary["time_s"]
    total = {"wall_s": times["total_s"], "cpu_s": times["cpu_s"]}
    return [
        {
            "name": spoken(name),
            "wall": seconds(spent["wall_s"]),
            "cpu": seconds(spent["cpu_s"]),
            "per_frame": seconds(spent["wall_s"] / summary["frames"]),
            "percent": percent(100.0 * spent["wall_s"] / max(times["total_s"], 1e-9)),
        }
        for name, spent in (*times["stages"].items(), ("total", total))
    ]


def result_line(found: Mapping[str, Any]) -> str:
    """The result of a comparison, ``SequenceDifference.to_dict()``, in one line."""
    visible = percent(found["percent_visible"]["mean"])
    return f"{found['score_jnd']:.2f} JND ({found['meaning']}); {visible} % of the pixels above 1 JND"


def measures_line(found: Mapping[str, Any]) -> str:
    """Results of the further measures of a comparison in one line; empty where there are none."""
    return ", ".join(
        f"{name} {_figure(score, UNITS.get(name, ''))}" for name, score in found["scores"].items()
    )


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


def _difference(row: Mapping[str, Any], visible: float) -> list[str]:
    scores = [f"{row[key]:.3f}" for key in ("score_jnd", "steady_jnd", "transient_jnd")]
    return [*scores, percent(visible), psnr_text(row).removesuffix(" dB"), f"{row['velocity_deg_s']:.2f}"]


def _figure(value: float | None, unit: str) -> str:
    return "infinite" if value is None else f"{value:.4g}{unit}"


def _table(title: str, columns: Iterable[str]) -> Table:
    table = Table(title=title, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD)
    for number, name in enumerate(columns):
        table.add_column(name, justify="right" if number else "left")
    return table
