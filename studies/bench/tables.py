"""Tables of a bench for a terminal: costs and scores, and CPU time at equal quality."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

SIGNS = {"equal": "", "at least": "≥ ", "at most": "≤ ", None: "bounds in both directions, "}


def bench_tables(found: Mapping[str, Any]) -> list[Table]:
    """Configurations of ``bench.json`` with cost and scores; then the ratios, where there are any."""
    return [_configurations(found), *_ratios(found)]


def _configurations(found: Mapping[str, Any]) -> Table:
    size, measures = "x".join(map(str, found["size"])), found["measures"]
    headings = ("CPU\ns", "wall\ns", *(f"{of['title']}\n{of['unit']}" for of in measures.values()))
    table = _table(f"{found['scene']}, {len(found['frames'])} frames of {size}", "configuration", *headings)
    family = None
    for row in found["configurations"]:
        if family not in (None, row["family"]):
            table.add_section()
        family = row["family"]
        cells = [_number_text(row["cost"][key]) for key in ("cpu_s", "wall_s")]
        scores = {name: score_text(row["scores"][name]) for name in measures}
        marked = (f"{text} *" if name in row["undecided"] else text for name, text in scores.items())
        table.add_row(row["name"], *cells, *marked)
    table.add_section()
    for kind, floor in found["reference"]["noise_floor"].items():
        scores = {name: score_text(score) for name, score in floor.items()}
        table.add_row(f"noise floor, {kind}", "", "", *(scores.get(name, "") for name in measures))
    table.caption = (
        f"references of {found['reference']['spp']} paths a pixel in two halves; floor: one half against the "
        "other; *: nearer to it than a third, not decided"
    )
    return table


def _ratios(found: Mapping[str, Any]) -> list[Table]:
    ratios, measures = found["ratios"], found["measures"]
    tables = []
    if ratios["traced"] or ratios["denoised"]:
        headings = ("than", *(of["title"] for of in measures.values()))
        table = _table("decoupled: times less CPU at equal quality", *headings)
        for baseline, by_measure in ratios["traced"].items():
            table.add_row(baseline, *(ratio_text(by_measure[name]) for name in measures))
        if denoised := ratios["denoised"]:
            table.add_section()
            table.add_row("denoised", *(ratio_text(denoised["by_measure"][name]) for name in measures))
            mean = f"{SIGNS[denoised['kind']]}{denoised['geometric_mean']:.2f}"
            table.caption = f"denoised: geometric mean over the measures {mean}"
        tables.append(table)
    if ratios["paper"]:
        table = _table("decoupled: better by every measure at less cost", "than", "configurations")
        for baseline, names in ratios["paper"].items():
            table.add_row(baseline, ", ".join(names) or "none")
        tables.append(table)
    return tables


def ratio_text(ratio: Mapping[str, Any]) -> str:
    """A ratio with its kind: ``≥ 3.12``."""
    return SIGNS[ratio["kind"]] + _number_text(ratio["times"])


def score_text(score: float | None) -> str:
    """A score in about three digits."""
    return "identical" if score is None else _number_text(score)


def _number_text(value: float) -> str:
    """A positive number in three digits, without an exponent."""
    digits = 0 if value >= 100.0 else 1 if value >= 10.0 else 2 if value >= 1.0 else 3 if value >= 0.1 else 4
    return f"{value:.{digits}f}"


def _table(title: str, first: str, *others: str) -> Table:
    text = Text(title, style="table.title")  # a scene's name may contain markup characters
    table = Table(title=text, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD)
    table.min_width = len(title)
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name, justify="right", no_wrap=True)
    return table
