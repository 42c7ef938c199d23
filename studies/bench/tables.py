"""Tables of a bench, for a terminal: who took part, and CPU time at equal quality."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

SIGNS = {"equal": "", "at least": "≥ ", "at most": "≤ "}


def bench_tables(found: Mapping[str, Any]) -> list[Table]:
    """Contestants with cost and scores; then the ratios, where there are any.

    Parameters
    ----------
    found
        What ``bench.json`` holds.
    """
    return [_contestants(found), *_ratios(found)]


def _contestants(found: Mapping[str, Any]) -> Table:
    width, height = found["size"]
    judges = found["judges"]
    table = _table(f"{found['scene']}, {len(found['frames'])} frames of {width}x{height}", "contestant")
    for heading in ("CPU\ns", "wall\ns", "MiB", *(f"{of['title']}\n{of['unit']}" for of in judges.values())):
        table.add_column(heading, justify="right", no_wrap=True)
    family = None
    for row in found["contestants"]:
        if family not in (None, row["family"]):
            table.add_section()
        family = row["family"]
        cost = row["cost"]
        cells = [number_text(cost[key]) for key in ("cpu_s", "wall_s", "peak_mib")]
        table.add_row(row["name"], *cells, *(score_text(row["scores"][judge]) for judge in judges))
    if floor := found["reference"]["floor"]:
        table.add_section()
        table.add_row("noise of reference", "", "", "", *(score_text(floor[judge]) for judge in judges))
    filters = " and ".join(found["reference"]["filters"])
    table.caption = f"references of {found['reference']['spp']} paths a pixel, filter {filters}"
    return table


def _ratios(found: Mapping[str, Any]) -> list[Table]:
    verdict, judges = found["verdict"], found["judges"]
    tables = []
    if verdict["traced"] or verdict["denoised"]:
        table = _table(
            "decoupled: times less CPU at equal quality", "than", *(of["title"] for of in judges.values())
        )
        for rival, by_judge in verdict["traced"].items():
            table.add_row(rival, *(ratio_text(by_judge[judge]) for judge in judges))
        if denoised := verdict["denoised"]:
            table.add_section()
            table.add_row("denoised", *(ratio_text(denoised["by_judge"][judge]) for judge in judges))
            table.caption = f"denoised: geometric mean over the judges {_mean_text(denoised)}"
        tables.append(table)
    if verdict["paper"]:
        table = _table("decoupled, better by every judge at less cost", "than")
        table.add_column("which")
        for rival, names in verdict["paper"].items():
            table.add_row(rival, ", ".join(names) or "none")
        tables.append(table)
    return tables


def ratio_text(ratio: Mapping[str, Any]) -> str:
    """A ratio for people: ``≥ 3.12``."""
    return SIGNS[ratio["kind"]] + number_text(ratio["times"])


def _mean_text(denoised: Mapping[str, Any]) -> str:
    """The mean over the judges with its sign; older files do not say its kind."""
    kind = denoised.get("kind", "equal")
    text = f"{denoised['geometric_mean']:.2f}"
    return f"{text}, of bounds both ways" if kind is None else SIGNS[kind] + text


def number_text(value: float) -> str:
    """A positive number in three digits, without an exponent."""
    if value >= 100.0:
        return f"{value:.0f}"
    digits = 1 if value >= 10.0 else 2 if value >= 1.0 else 3 if value >= 0.1 else 4
    return f"{value:.{digits}f}"


def score_text(score: float | None) -> str:
    """A score in about three digits."""
    if score is None:
        return "identical"
    return number_text(score)


def _table(title: str, first: str, *others: str) -> Table:
    shown = Text(title, style="table.title")  # a scene's name may hold what looks like markup
    table = Table(title=shown, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD)
    table.min_width = len(title)
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name, justify="right", no_wrap=True)
    return table
