"""All results of a bench as a page of Markdown: means over scenes, then a table of each scene and size."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from enfilade.camera import ranges
from studies.bench.measures import QUALITIES
from studies.bench.tables import cost_text, ratio_text, score_text

INTRODUCTION = """# Results of the bench, {date}

Written by `make bench`; the [bench's README](../README.md) defines baselines, costs and measures, and
[scenes.toml](../scenes.toml) lists the splits. "times": CPU time of the best baseline at equal quality over
that of the configuration, with a bootstrap interval of 90 % over windows and seeds; `≥`: no baseline is as
good; `≤`: the cheapest one is as good; `~`: a mean of bounds of both kinds. `*`: within the noise of the
references. `†`: kernels were compiled in the run, so that its CPU time is too high."""


def results_page(benches: Sequence[Mapping[str, Any]], means: Sequence[Mapping[str, Any]], date: str) -> str:
    """The page.

    Parameters
    ----------
    benches
        Contents of ``bench.json`` of each scene and size, with ``split``.
    means
        Ratios over scenes, as `suite.summary`.
    date
        For its title.
    """
    blocks = [INTRODUCTION.format(date=date)]
    if means:
        names = [name for name in QUALITIES if all(name in one["ratios"] for one in means)]
        headings = ["size", "split", "scenes", "configuration", *(QUALITIES[name].title for name in names)]
        rows = [
            [
                one["size"], one["split"], str(len(one["scenes"])), f"`{one['configuration']}`",
                *(ratio_text(one["ratios"][name]) for name in names),
            ]
            for one in means
        ]  # fmt: skip
        blocks += ["## Times, geometric means over scenes", _table(headings, rows)]
    for found in benches:
        size = "x".join(map(str, found["size"]))
        blocks += [f"## {found['scene']}, {size} ({found['split']})", _circumstances(found)]
        headings = ["configuration", "CPU s a frame", "peak, MiB"]
        headings += [f"{of['title']}, {of['unit']}".removesuffix(", ") for of in found["measures"].values()]
        blocks.append(_table(headings, _rows(found)))
    return "\n\n".join(blocks) + "\n"


def _circumstances(found: Mapping[str, Any]) -> str:
    """One line on frames, references, software and machines."""
    origins = [run["origin"] for row in found["configurations"] for run in row["seeds"]]
    code = ", ".join(sorted({f"{of['date']} ({of['commit']})" for of in origins}))
    machines = ", ".join(
        sorted({f"{of['machine']['cores']} cores, {of['machine']['processor']}" for of in origins})
    )
    return (
        f"{found['walkthrough_frames']} frames, {ranges(found['frames'])} measured in "
        f"{len(found['windows'])} windows of {found['windows'][0]['side']} pixels; "
        f"references of {found['reference']['spp']} paths; "
        f"rendered on {code}; {machines}."
    )


def _rows(found: Mapping[str, Any]) -> Iterator[list[str]]:
    names, frames = list(found["measures"]), found["walkthrough_frames"]
    for row in found["configurations"]:
        scores = (
            score_text(name, row["values"][name]) + (" *" if name in row["undecided"] else "")
            for name in names
        )
        cost = row["cost"]
        yield [f"`{row['name']}`", cost_text(cost, frames), f"{cost['peak_mib']:.0f}", *scores]
    for configuration, by_measure in found["ratios"].items():
        yield [f"times, `{configuration}`", "", "", *(ratio_text(by_measure[name]) for name in names)]
    floor = found["reference"]["noise_floor"]
    yield ["noise floor", "", "", *(score_text(name, floor[name]) if name in floor else "" for name in names)]


def _table(headings: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    headings = list(headings)
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
