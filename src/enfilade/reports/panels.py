"""Charts of the report, over the frames: Figs. 12 and 13 of a run, and its difference to a reference.

A panel is a table fit for JSON: traces as Plotly takes them, and what stands around them. Colours that
depend on the page's theme are named (``ink``) and filled in by the page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from enfilade.records import Provenance
from enfilade.reports.layers import SOURCE_COLORS

__all__ = ["PURPOSES", "counts_rays", "panels"]

Panel = dict[str, Any]
BLUE, VERMILION, GREEN = "#3D8FC6", "#D55E00", "#009E73"
REASONS = {  # of a row of the summary: name, colour
    "slow": ("slow", SOURCE_COLORS[Provenance.SLOW]),
    "specular": ("specular", SOURCE_COLORS[Provenance.SPECULAR]),
    "hole": ("holes", SOURCE_COLORS[Provenance.DISOCCLUDED]),
    "keyframe": ("keyframes", SOURCE_COLORS[Provenance.KEYFRAME]),
}


PURPOSES = {  # sent for: name, colour
    "camera": ("what is seen", SOURCE_COLORS[Provenance.SLOW]),
    "lobes": ("mirrors, glass and gloss", SOURCE_COLORS[Provenance.SPECULAR]),
    "light": ("light of keyframes", SOURCE_COLORS[Provenance.KEYFRAME]),
    "drafts": ("drafts of it", SOURCE_COLORS[Provenance.DISOCCLUDED]),
}


def counts_rays(figures: Mapping[str, Any]) -> bool:
    """Whether the method of a run counts rays, not traced pixels; it may have counted none yet."""
    return bool(figures["method"] == "decoupled")


def panels(
    figures: Mapping[str, Any],
    numbers: Sequence[int],
    speed_deg_s: Sequence[float] | None,
    beside: Mapping[int, Mapping[str, float | None]],
) -> list[Panel]:
    """Charts of a run; those without anything to show are left out.

    Parameters
    ----------
    figures
        See :func:`~enfilade.store.tally`.
    numbers
        Of all frames of the path.
    speed_deg_s
        Mean velocity of each; None where it is not known.
    beside
        By frame number: ``psnr_db``, ``score_jnd`` (each may be None).
    """
    rows = figures["per_frame"]
    made = [
        _velocity(numbers, speed_deg_s, rows) if speed_deg_s else None,
        _sent(figures) if counts_rays(figures) else _traced(rows, figures["table1"]) if rows else None,
        _predictions(figures["segments"], figures["split_percent"]),
        _score(beside) or _psnr(beside),
    ]
    return [panel for panel in made if panel is not None]


def _velocity(numbers: Sequence[int], speeds: Sequence[float], rows: Sequence[Mapping[str, Any]]) -> Panel:
    at = dict(zip(numbers, speeds, strict=True))
    traces = [_line("mean over the image", numbers, speeds, BLUE)]
    keyframes = [row["frame"] for row in rows if row["keyframe"] > 0.0]
    if 0 < len(keyframes) < len(rows):
        traces.append(
            _points("keyframe", keyframes, [at[k] for k in keyframes], VERMILION, "triangle-down", None)
        )
    text = f"Mean image velocity per frame, {min(speeds):.2f} to {max(speeds):.2f} degrees per second."
    return _panel("velocity", "Image velocity", "deg/s", traces, text, top=1.08 * max(*speeds, 0.1))


def _traced(rows: Sequence[Mapping[str, Any]], table1: Mapping[str, float]) -> Panel:
    traces = [
        _bars(name, rows, key, color, "%{y:.1f} %")
        for key, (name, color) in REASONS.items()
        if any(row[key] > 0.0 for row in rows)
    ]
    total = table1["total"]
    text = f"Pixels traced per frame by reason; {total:.1f} percent on average."
    panel = _panel("traced", "Pixels traced, by reason", "%", traces, text, top=100.0)
    return {**panel, "ticks": [0, 50, 100], "level": {"value": total, "name": f"mean {total:.1f} %"}}


def _sent(figures: Mapping[str, Any]) -> Panel | None:
    rows, rays = figures["rays_per_frame"], figures["rays"]
    if not rows:
        return None
    traces = [
        _bars(name, rows, kind, color, "%{y:.1f}")
        for kind, (name, color) in PURPOSES.items()
        if rays[kind] > 0.0
    ]
    total = sum(rays.values())
    text = f"Rays sent for a pixel of each frame, by purpose; {total:.1f} on average."
    most = max(sum(row[kind] for kind in PURPOSES) for row in rows)
    panel = _panel("rays", "Rays per pixel, by purpose", "", traces, text, top=1.05 * most)
    return {**panel, "level": {"value": total, "name": f"mean {total:.1f}"}}


def _bars(name: str, rows: Sequence[Mapping[str, Any]], key: str, color: str, value: str) -> dict[str, Any]:
    return {
        "type": "bar",
        "name": name,
        "x": [row["frame"] for row in rows],
        "y": [round(row[key], 3) for row in rows],
        "marker": {"color": color, "line": {"width": 0}},
        "hovertemplate": f"{value} {name}<extra></extra>",
    }


def _predictions(segments: Sequence[Mapping[str, Any]], threshold: float) -> Panel | None:
    judged = [s for s in segments if s["middle"] is not None]
    if not judged:
        return None
    when = {
        "before splitting": [s for s in judged if s["depth"] == 0],
        "after": [s for s in judged if not s["is_split"]],
    }
    traces = []
    for key, eye, color, dash in (
        ("percent_visible", "pursuit", VERMILION, "solid"),
        ("percent_visible_no_pursuit", "no pursuit", BLUE, "dot"),
    ):
        for title, chosen in when.items():
            points = sorted((s["middle"], round(s[key], 3)) for s in chosen)
            symbol = "square-open" if title != "after" else "circle"
            x, y = ([p[i] for p in points] for i in (0, 1))
            traces.append(_points(f"{eye}, {title}", x, y, color, symbol, dash))
    most = max(s["percent_visible"] for s in judged)
    split = sum(bool(s["is_split"]) for s in judged)
    text = (
        f"What the metric predicted for the middle of each segment: at most {most:.1f} percent of pixels "
        f"visible; {split} of {len(judged)} segments were split."
    )
    panel = _panel(
        "predictions", "Predictions for segment middles", "% visible", traces, text,
        top=1.2 * max(most, threshold),
    )  # fmt: skip
    legend = [
        {"name": "pursuit", "color": VERMILION, "symbol": "line"},
        {"name": "no pursuit", "color": BLUE, "symbol": "dots"},
        {"name": "before", "color": "var(--ink-soft)", "symbol": "square-open"},
        {"name": "after splitting", "color": "var(--ink-soft)", "symbol": "circle"},
    ]
    return {**panel, "legend": legend, "level": {"value": threshold, "name": f"split above {threshold:g} %"}}


def _score(beside: Mapping[int, Mapping[str, float | None]]) -> Panel | None:
    points = [
        (n, found["score_jnd"]) for n, found in sorted(beside.items()) if found["score_jnd"] is not None
    ]
    if not points:
        return None
    x, y = [p[0] for p in points], [float(p[1] or 0.0) for p in points]
    text = f"Visible difference to the reference per frame, {min(y):.2f} to {max(y):.2f} JND."
    panel = _panel(
        "score", "Visible difference to the reference", "JND", [_line("score", x, y, GREEN)], text,
        top=1.1 * max(*y, 1.0),
    )  # fmt: skip
    return {**panel, "level": {"value": 1.0, "name": "1 JND"}}


def _psnr(beside: Mapping[int, Mapping[str, float | None]]) -> Panel | None:
    points = [(n, found["psnr_db"]) for n, found in sorted(beside.items()) if found["psnr_db"] is not None]
    if not points:
        return None
    x, y = [p[0] for p in points], [float(p[1] or 0.0) for p in points]
    text = f"PSNR to the reference per frame, {min(y):.1f} to {max(y):.1f} dB."
    panel = _panel("psnr", "PSNR to the reference", "dB", [_line("PSNR", x, y, BLUE)], text, top=max(y) + 2.0)
    return {**panel, "bottom": max(min(y) - 4.0, 0.0)}


def _panel(name: str, title: str, unit: str, traces: list[dict[str, Any]], text: str, *, top: float) -> Panel:
    legend = [
        {
            "name": trace["name"],
            "color": trace["marker"]["color"] if trace["type"] == "bar" else trace["line"]["color"],
            "symbol": "bar" if trace["type"] == "bar" else trace["marker"].get("symbol", "line"),
        }
        for trace in traces
    ]
    return {
        "name": name, "title": title, "unit": unit, "traces": traces, "legend": legend, "text": text,
        "bottom": 0.0, "top": top, "ticks": None, "level": None,
    }  # fmt: skip


def _line(name: str, x: Sequence[int], y: Sequence[float], color: str) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines" if len(x) > 1 else "markers",
        "name": name,
        "x": list(x),
        "y": [round(value, 4) for value in y],
        "line": {"color": color, "width": 1.75},
        "marker": {"color": color},
        "hovertemplate": "%{y:.2f}<extra></extra>",
    }


def _points(
    name: str, x: Sequence[int], y: Sequence[float], color: str, symbol: str, dash: str | None
) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "markers" if dash is None else "lines+markers",
        "name": name,
        "x": list(x),
        "y": [round(value, 4) for value in y],
        "line": {"color": color, "width": 1, "dash": dash or "solid"},
        "marker": {"color": color, "symbol": symbol, "size": 7},
        "cliponaxis": False,
        "hovertemplate": f"%{{y:.2f}} {name}<extra></extra>",
    }
