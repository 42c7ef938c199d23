"""The contents of a report: state, charts, tables, settings, and the data of its player."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from enfilade.reports.charts import SVG_AXES, Panel, svg
from enfilade.reports.film import Film
from enfilade.reports.panels import marked_keyframes, quality_panel, run_panels, time_panel
from enfilade.reports.run import ReportedRun
from enfilade.reports.tables import percent, psnr_text, rays_columns, seconds, time_rows, traced_columns
from enfilade.scene.blender.imported import ImportedScene
from enfilade.scene.blender.notes import TITLES, NoteGroup, grouped
from enfilade.settings import SECTIONS, Section

SYMBOLS = {"bar": "■", "line": "━", "dashed": "╌", "triangle": "▼", "square": "□", "circle": "●"}  # of series
SIGNIFICANCE = {  # of the noise floor
    "above": "above it",
    "undecided": "undecided",
    "below": "below it; without any error it would be a third to two thirds of it",
}
REASONS = (
    "Slow pixels move slowly, so that errors would be noticed; specular pixels show a glossy, mirroring or "
    "transparent surface; disoccluded pixels are visible in no keyframe; keyframe pixels belong to a "
    "keyframe; all others are reused from keyframes."
)


def contents(run: ReportedRun, film: Film, reference: Mapping[str, Any] | None) -> dict[str, Any]:
    """Gather the variables of the template.

    Parameters
    ----------
    run
    film
    reference
        Summary of the reference, where it is a run.
    """
    summary = run.summary
    # Above so many visible pixels a run of `paper` splits segments; other methods have no such setting.
    split_percent = run.identity["settings"].get("masks", {}).get("split_percent")
    panels = run_panels(summary, split_percent)
    if film.difference is not None:
        panels.append(quality_panel(film.difference))
    charted = [panel for panel in [*panels, time_panel(run.lines, summary["rays"])] if panel.series]
    span = (run.numbers[0] - 0.5, run.numbers[-1] + 0.5)
    left, bottom, width, height = SVG_AXES
    return {
        "name": run.folder.resolve().name,
        "state": _state(run),
        "glance": _glance(run),
        "layers": film.layers,
        "charts": [(panel, svg(panel, span)) for panel in charted],
        "span": span,
        "edges": {"left": left, "right": left + width, "top": 1.0 - bottom - height, "bottom": bottom},
        "symbols": SYMBOLS,
        "effort": _effort(summary),
        "difference": _difference(film.difference, summary, reference),
        "noise_note": "" if film.difference is None else _sentence(film.difference["noise_note"]),
        "stages": _stages(run),
        "imported": run.imported,
        "import_notes": [] if run.imported is None else _import_notes(run.imported),
        "settings": _settings(run),
        "identity": _identity(run),
        "columns": panels,
        "numbers": run.numbers,
        "data": _data(run, film, charted),
        "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    }


def _state(run: ReportedRun) -> dict[str, str]:
    count = f"{len(run.there)} of {len(run.numbers)} frames"
    if run.is_finished and run.holder is None:
        return {"word": "finished", "text": f"all {len(run.numbers)} frames and the video"}
    last = f"last result {run.last_result:%Y-%m-%d %H:%M} UTC"
    if run.holder is None:
        return {"word": "unfinished", "text": f"{count}, {last}; the same command continues the run"}
    process = f"process {run.holder['pid']} on {run.holder['host']}, since {run.holder['started']}"
    return {"word": "running", "text": f"{count}, {last}; {process}"}


def _glance(run: ReportedRun) -> list[tuple[str, str, str]]:
    """The main figures: name, value, unit."""
    summary = run.summary
    width, height = summary["size"]
    rows = [("method", summary["method"], ""), ("image", f"{width}×{height}", f"{summary['fps']:g} fps")]
    if summary["rays"]:
        name = "rays per pixel" if run.is_finished else "rays per pixel so far"
        rows.append((name, f"{sum(summary['rays'].values()):.1f}", ""))
    elif summary["per_frame"]:
        rows.append(("pixels traced", percent(summary["traced_percent"]["total"]), "%"))
    if run.is_finished:
        value, unit = seconds(summary["time_s"]["cpu_s"] / summary["frames"]).split()
        rows.append(("CPU time per frame", value, unit))
    return rows


def _effort(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Tables of rays by kind, where the method counts them, and of pixels by provenance (Table 1)."""
    tables, rays = [], summary["rays"]
    if rays:
        text = "Rays of all tasks so far, divided by the number of pixels of the whole path."
        title = "Rays per pixel and frame"
        tables.append({"title": title, "columns": rays_columns(summary), "text": text})
    if summary["per_frame"]:
        columns = traced_columns(summary)
        if rays:
            columns[-1] = ("reused", percent(100.0 - summary["traced_percent"]["total"]))
        title = "Pixels by provenance, %" if rays else "Pixels traced, %"
        text = f"Mean of {len(summary['per_frame'])} frames (Table 1 of the paper). {REASONS}"
        tables.append({"title": title, "columns": columns, "text": text})
    return tables


def _stages(run: ReportedRun) -> list[dict[str, str]]:
    """Rows of Table 2, with the number of tasks of the stages that are passes."""
    tasks = Counter(line["pass"] for line in run.lines)
    counts = [*(tasks.get(name, "") for name in run.summary["time_s"]["stages"]), tasks.total()]
    rows = time_rows(run.summary)
    return [{**row, "tasks": str(count)} for row, count in zip(rows, counts, strict=True)]


def _difference(
    found: Mapping[str, Any] | None, summary: Mapping[str, Any], reference: Mapping[str, Any] | None
) -> list[tuple[str, str, str]]:
    """Rows of the comparison with the reference: name, value, comment."""
    if found is None:
        return []
    without = ", without the noise of the references" if found["noise_floor"] else ""
    rows = [
        ("frames compared", str(found["frames"]), "noise of the reference counts as a difference"),
        ("visible difference", f"{found['score_jnd']:.2f} JND", found["meaning"]),
        ("pixels above 1 JND", f"{percent(found['percent_visible']['mean'])} %", "mean over the frames"),
        ("PSNR", psnr_text(found), f"sRGB-encoded values{without}"),
        ("absolute difference", f"{found['scores']['absolute']:.2f} %", "of white, sRGB-encoded values"),
    ]
    if floor := found["noise_floor"]:
        rows[0] = ("frames compared", str(found["frames"]), "with the mean of two references")
        visible = f"{percent(floor['percent_visible'])} % of pixels above 1 JND"
        comment = f"{visible}; the score is {SIGNIFICANCE[floor['significance']]}"
        rows.insert(2, ("noise floor", f"{floor['score_jnd']:.2f} JND", comment))
    if reference is not None and summary["video"] and reference["video"]:
        own, other = (of["time_s"]["cpu_s"] / of["frames"] for of in (summary, reference))
        rows += [
            ("CPU time per frame", seconds(own), f"{100.0 * own / max(other, 1e-9):.0f} % of the reference"),
            ("", seconds(other), "the reference; comparable on the same machine"),
        ]
    return rows


def _import_notes(imported: ImportedScene) -> list[tuple[str, list[NoteGroup]]]:
    """Parts of the imported file that are not as they were, under the titles of their kinds."""
    groups = grouped(imported.notes)
    titled = [(title, [group for group in groups if group.kind is kind]) for kind, title in TITLES.items()]
    return [(title, found) for title, found in titled if found]


def _sentence(note: str) -> str:
    return note[:1].upper() + note[1:]


def _settings(run: ReportedRun) -> list[dict[str, Any]]:
    """Settings by section; those of built-in sections with their defaults and help."""
    also = {"viewing": run.viewing_settings.to_table(), "video": run.video.to_table()}
    shown = {**run.identity["settings"], **also}
    known: dict[str, Section] = {kind.table: kind() for kind in SECTIONS}
    return [{"name": name, "rows": _section(table, known.get(name))} for name, table in shown.items()]


def _section(table: Mapping[str, Any], default: Section | None) -> list[dict[str, Any]]:
    defaults = {} if default is None else default.to_table()
    fields = getattr(default, "__dataclass_fields__", {})
    return [
        {
            "name": name,
            "value": _value(value),
            "default": _value(defaults[name]) if defaults.get(name, value) != value else None,
            "help": fields[name].metadata["help"] if name in fields else "",
        }
        for name, value in table.items()
    ]


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value) or "none"


def _identity(run: ReportedRun) -> list[tuple[str, str]]:
    """Folder, frames, screen, and everything in the identity but frames and settings."""
    of, numbers = run.viewing, run.numbers
    size = f"{of.diagonal_m:g} m diagonal at {of.distance_m:g} m"
    rows = [
        ("folder", str(run.folder.resolve())),
        ("frames", f"{len(numbers)}, numbered {numbers[0]} to {numbers[-1]}"),
        ("screen", f"{size}: {of.pixels_per_degree:.1f} pixels per degree"),
    ]
    for name, value in run.identity.items():
        parts = value if isinstance(value, dict) else {"": value}
        if name != "settings":
            rows += [
                (f"{name} {key}".strip(), _value(part)) for key, part in parts.items() if key != "frames"
            ]
    return rows


def _data(run: ReportedRun, film: Film, panels: Sequence[Panel]) -> dict[str, Any]:
    """Data of the player: pictures, and the values of all charts at their frames."""
    numbers = [frame["number"] for frame in film.frames]
    keyframes = set(marked_keyframes(run.summary["per_frame"]))
    return {
        "fps": run.identity["path"]["fps"],
        "size": film.size,
        "last": run.numbers[-1],
        "frames": [{**f, "kind": "keyframe" if f["number"] in keyframes else ""} for f in film.frames],
        "layers": [
            {"name": layer.name, "title": layer.title, "isOverlay": layer.is_overlay} for layer in film.layers
        ],
        "values": [[[_rounded(s.values.get(n)) for n in numbers] for s in panel.series] for panel in panels],
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
