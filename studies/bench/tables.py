"""Tables of a bench for a terminal: costs and scores, and CPU time at equal quality."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from studies.bench.measures import LEAST_ERROR, QUALITIES

SIGNS = {"equal": "", "at least": "≥ ", "at most": "≤ ", None: "~ "}

WIDTH = 180  # columns: narrower terminals wrap lines, and files have them whole


def print_table(table: Table) -> None:
    """Print a table, none of whose columns is shortened."""
    Console(width=max(Console().width, WIDTH)).print(table)


def bench_tables(found: Mapping[str, Any]) -> list[Table]:
    """Configurations of ``bench.json`` with cost and scores; then the ratios, where there are any."""
    return [_configurations(found), *_ratios(found)]


def _configurations(found: Mapping[str, Any]) -> Table:
    size, measures = "x".join(map(str, found["size"])), found["measures"]
    frames = found["walkthrough_frames"]
    headings = ("CPU s\na frame", "start\nCPU s", "wall s\na frame", "peak\nMiB")
    table = _table(
        f"{found['scene']}, {len(found['frames'])} of {frames} frames of {size}", "configuration", *headings,
        *(f"{of['title']}\n{of['unit']}" for of in measures.values()),
    )  # fmt: skip
    family = None
    for row in found["configurations"]:
        if family not in (None, row["family"]):
            table.add_section()
        family, cost = row["family"], row["cost"]
        times = [cost["start_cpu_s"], cost["wall_s"] / frames, cost["peak_mib"]]
        cells = [cost_text(cost, frames), *map(number_text, times)]
        scores = (score_text(name, row["values"][name]) for name in measures)
        marked = (
            f"{text} *" if name in row["undecided"] else text
            for name, text in zip(measures, scores, strict=True)
        )
        table.add_row(row["name"], *cells, *marked)
    table.add_section()
    floor = found["reference"]["noise_floor"]
    texts = (score_text(name, floor[name]) if name in floor else "" for name in measures)
    table.add_row("noise floor", "", "", "", "", *texts)
    table.caption = (
        f"means of {len(found['windows'])} windows; references of {found['reference']['spp']} paths in two "
        "halves; floor: one half against the other; *: error less than a third above it, not decided; "
        "†: kernels were compiled in the run"
    )
    return table


def _ratios(found: Mapping[str, Any]) -> list[Table]:
    if not found["ratios"]:
        return []
    table = _table(
        "CPU time of the strongest baseline over ours, at equal quality", "configuration",
        *(of["title"] for of in found["measures"].values()),
    )  # fmt: skip
    for name, by_measure in found["ratios"].items():
        table.add_row(name, *(ratio_text(by_measure[measure]) for measure in found["measures"]))
    table.caption = (
        "in brackets bootstrap intervals of 90 % over the windows and seeds; ≥: better than every baseline; "
        "≤: no better than the cheapest baseline; *: within the noise of the references"
    )
    return [table]


def ratio_text(ratio: Mapping[str, Any]) -> str:
    """A ratio with its kind and interval: ``≥ 3.12 [2.90, 3.40]``; an asterisk where it is not decided."""
    low, high = number_text(ratio["low"]), number_text(ratio["high"])
    mark = "" if ratio["is_decided"] else " *"
    return f"{SIGNS[ratio['kind']]}{number_text(ratio['times'])} [{low}, {high}]{mark}"


def cost_text(cost: Mapping[str, Any], frames: int) -> str:
    """CPU seconds a frame; a dagger where they contain the compilation of kernels."""
    return number_text(cost["cpu_s"] / frames) + (" †" if cost["kernels"] else "")


def score_text(measure: str, values: list[float]) -> str:
    """The score of windows together in about three digits."""
    quality = QUALITIES[measure]
    if quality.error(values) <= LEAST_ERROR:
        return "below noise"
    return number_text(quality.score(values))


def number_text(value: float) -> str:
    """A number in three digits, without an exponent."""
    size = abs(value)
    digits = 0 if size >= 100.0 else 1 if size >= 10.0 else 2 if size >= 1.0 else 3 if size >= 0.1 else 4
    return f"{value:.{digits}f}"


def _table(title: str, first: str, *others: str) -> Table:
    text = Text(title, style="table.title")  # a scene's name may contain markup characters
    table = Table(title=text, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD)
    table.min_width = len(title)
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name, justify="right", no_wrap=True)
    return table
