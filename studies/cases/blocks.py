"""What the blocks of the document say: tables of results beside the paper's, and the figures drawn of them.

Each takes the results of one item by scene, the terms, the folder of the results and that of the figures, and
gives Markdown and the files that it drew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.reports.charts import save
from enfilade.reports.plots import walkthrough_figure
from studies.cases import charts as figures
from studies.cases import pictures as pictures_of
from studies.cases import placement, separation, shares, times
from studies.cases.terms import Terms

__all__ = ["BLOCKS", "FIGURES"]

Results = Mapping[str, Any]  # of one item, by scene
FIGURES = "figures"  # beside the document
WAYS = {"art": "ART", "rt": "RT", "ibr_rt": "IBR+RT (`paper`)", "decoupled": "`decoupled`"}
FILTERS = {
    "none": "none",
    "full": "11 frames, the mirror's own flow",
    "short": "3 frames, the mirror's own flow (the paper's)",
    "reflected": "11 frames, the flow of the reflection",
}


def _placement(found: Results, terms: Terms, _folder: Path, place: Path) -> tuple[str, list[Path]]:
    rows = []
    for scene, of in found.items():
        for row in of["placements"]:
            name = "equal flow" if row["adaptation"] is None else f"Eq. 6, A = {row['adaptation']:g}"
            is_plain = row["adaptation"] == 0.0
            paper = placement.PAPER_PERCENT if scene == "room" else {}
            papers = paper.get("uniform") if is_plain else paper.get("adapted")
            is_papers = row["adaptation"] in (0.0, placement.PAPER_A)
            said = f"{papers:.2f}" if papers is not None and is_papers else ""
            cells = (scene, "uniform" if is_plain else name, said, f"{row['mean']:.2f}")
            keyframes = 100.0 * len(row["keyframes"]) / len(of["numbers"])
            rows.append((*cells, len(row["keyframes"]), f"{row['mean'] + keyframes:.2f}"))
    answers = [_placement_answer(scene, of["placements"]) for scene, of in found.items()]
    file = figures.draw_placement(found, place / "placement.png")
    heads = ("scene", "placement", "paper, %", "ours, %", "keyframes", "with them, %")
    return _block(_size(terms), _table(heads, rows), *answers, figure=file), [file]


def _placement_answer(scene: str, rows: list[dict[str, Any]]) -> str:
    plain, half = (next(r for r in rows if r["adaptation"] == a) for a in (0.0, placement.PAPER_A))
    best = min(rows, key=lambda r: r["mean"])
    even = next(r for r in rows if r["adaptation"] is None)
    name = "equal flow" if best["adaptation"] is None else f"A = {best['adaptation']:g}"
    change = 100.0 * (half["mean"] / plain["mean"] - 1.0)
    return (
        f"**{scene.upper()}:** Eq. 6 with A = 0.5 changes the holes of uniform spacing by {change:+.0f} %, "
        f"equal flow by {100.0 * (even['mean'] / plain['mean'] - 1.0):+.0f} %; the least has {name}."
    )


def _statistics(found: Results, terms: Terms, _folder: Path, place: Path) -> tuple[str, list[Path]]:
    rows = []
    for scene, of in found.items():
        for name, p in ((f"{of['summary']['spp']} paths", of["predictions"]), ("no noise", of["plain"])):
            keys = ("before", "after", "split_before", "split_after", "before_still", "after_still")
            counts = (p["initial"], p["split"], p["remaining"], p["given_up"], p["split_not_seen_still"])
            rows.append((scene, name, *(_or_dash(p[key]) for key in keys), *counts))
    heads = (
        "scene", "light", "before, %", "after, %", "split ones before, %", "after, %",
        "all before, eye at rest", "after, eye at rest",
        "initial segments", "splits", "remaining", "still above 10 %", "split, below it with the eye at rest",
    )  # fmt: skip
    drawn = [
        save(walkthrough_figure(of["summary"]), place / f"walkthrough-{scene}.png")
        for scene, of in found.items()
    ]
    file = figures.draw_predictions(found, place / "predictions.png")
    pictures = "\n\n".join(f"![{f.stem}]({FIGURES}/{f.name})" for f in [file, *drawn])
    return _block(_size(terms), _table(heads, rows), pictures), [file, *drawn]


def _shares(found: Results, terms: Terms, _folder: Path, _place: Path) -> tuple[str, list[Path]]:
    keys = ("slow", "specular", "occlusion", "keyframes", "total")
    rows: list[tuple[Any, ...]] = []
    for scene, of in found.items():
        rows.append((scene, "paper", *(f"{shares.PAPER[scene][key]:.1f}" for key in keys)))
        rows.append((scene, "ours", *(f"{of['table1'][key]:.1f}" for key in keys)))
    notes = [
        f"**{scene.upper()}:** {of['frames']} frames, {of['keyframes']} keyframes; {of['slow_seen']:.1f} % "
        f"of the pixels are slower than 0.5 deg/s, {of['specular_seen']:.1f} % show glossy, mirroring or "
        "transparent surfaces."
        for scene, of in found.items()
    ]
    return _block(_size(terms), _table(("scene", "", *keys), rows), *notes), []


def _times(found: Results, terms: Terms, _folder: Path, place: Path) -> tuple[str, list[Path]]:
    heads = (
        "scene", "way", "paths", "paper, min", "CPU, s", "worth, paths", "over IBR+RT", "paper", "JND",
        "above 1 JND, %",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    for scene, of in found.items():
        ours, papers = of["ways"], times.PAPER_MINUTES[scene]
        for way, name in WAYS.items():
            one, minutes = ours[way], papers.get(way)
            bound = "at least " if way == "art" and of["art_is_bound"] else ""
            seen: tuple[str, ...] = ("", "")
            if one["frames"]:
                seen = tuple(
                    f"{_mean([f[key] for f in one['frames']]):.1f}" for key in ("score", "visible_percent")
                )
            rows.append(
                (
                    scene,
                    name,
                    f"{bound}{one['spp']}" if one["spp"] else "",
                    "" if minutes is None else f"{minutes:g}",
                    f"{bound}{one['cpu_s']:.2f}",
                    f"{bound}{one['worth_paths']:.2f}",
                    f"{bound}{one['worth_paths'] / ours['ibr_rt']['worth_paths']:.2f}",
                    "" if minutes is None else f"{minutes / papers['ibr_rt']:.2f}",
                    *seen,
                )
            )
    heads_equal = ("scene", "as good as", "ART takes, paths", "times as long", "paper")
    equal = _table(heads_equal, _equal_rows(found))
    stages = _table(("scene", "way", "stage", "CPU, s"), _stage_rows(found))
    series = _table(("scene", "ART, paths", "JND", "above 1 JND, %"), _series_rows(found))
    said = [
        f"**{scene.upper()}:** judged in frames {_listed(of['numbers'])}, {of['crop'][0]}x{of['crop'][1]} "
        f"pixels in their middle, against {of['reference_spp']} paths a pixel, whose noise is not counted. "
        f"While IBR+RT was rendered a path of ART took {of['path_us']['gaussian']['cpu']:.1f} µs of CPU, one "
        f"of RT {of['path_us']['centre']['cpu']:.1f} µs: a way is worth so many paths of ART a pixel as its "
        "CPU time would have traced in its own hours."
        for scene, of in found.items()
    ]
    file = figures.draw_times(found, place / "times.png")
    return _block(_size(terms), _table(heads, rows), *said, equal, stages, series, figure=file), [file]


def _equal_rows(found: Results) -> list[tuple[Any, ...]]:
    """ART with as many paths as make it as good by the metric, beside what it is compared with."""
    rows: list[tuple[Any, ...]] = []
    for scene, of in found.items():
        papers = times.PAPER_MINUTES[scene]
        for way in ("ibr_rt", "decoupled"):
            one = of["ways"][way]
            spp = times.equal_spp(of["art_series"], _mean([f["score"] for f in one["frames"]]))
            if spp is None:
                rows.append((scene, WAYS[way], "beyond the series", "–", ""))
                continue
            papers_ratio = f"{papers['art'] / papers['ibr_rt']:.1f}" if way == "ibr_rt" else ""
            rows.append((scene, WAYS[way], f"{spp:.0f}", f"{spp / one['worth_paths']:.1f}", papers_ratio))
    return rows


def _stage_rows(found: Results) -> list[tuple[Any, ...]]:
    return [
        (scene, WAYS[way], stage, f"{spent['cpu_s']:.3f}")
        for scene, of in found.items()
        for way in ("ibr_rt", "decoupled")
        for stage, spent in of["ways"][way]["stages"].items()
    ]


def _series_rows(found: Results) -> list[tuple[Any, ...]]:
    return [
        (
            scene,
            row["spp"],
            f"{_mean([f['score'] for f in row['frames']]):.2f}",
            f"{_mean([f['visible_percent'] for f in row['frames']]):.2f}",
        )
        for scene, of in found.items()
        for row in of["art_series"]
    ]


def _threshold(found: Results, terms: Terms, _folder: Path, place: Path) -> tuple[str, list[Path]]:
    named = {f"{s}, {_light(k, of[k])}": of[k] for s, of in found.items() for k in ("plain", "traced")}
    rows: list[tuple[Any, ...]] = []
    for name, of in named.items():
        at = {row["threshold_deg_s"]: row for row in of["curve"]}
        chosen = of["threshold_deg_s"]
        rows.append(
            (
                name,
                "none" if chosen is None else f"{chosen:g}",
                *(_or_dash(at[v]["reused_visible_percent"]) for v in (0.0, 0.5, 1.0, 2.0, 5.0)),
                _or_dash(at[0.5]["traced_percent"]),
                _or_dash(at[0.5]["removed_below_deg_s"]),
            )
        )
    heads = (
        "scene and light", "v_t found", "visible at v_t = 0, %", "0.5 (the paper's)", "1", "2", "5",
        "traced at 0.5, %", "what 0.5 removes is slower than",
    )  # fmt: skip
    classes = _table(("scene and light", "velocity, deg/s", "pixels", "above 1 JND, %"), _class_rows(named))
    file = figures.draw_threshold(named, place / "threshold.png")
    return _block(_windows(terms), _table(heads, rows), classes, figure=file), [file]


def _class_rows(named: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    return [
        (name, _class(row), f"{row['pixels']:,}", f"{row['visible_percent']:.1f}")
        for name, of in named.items()
        for row in of["by_velocity"]
    ]


def _supports(found: Results, terms: Terms, _folder: Path, place: Path) -> tuple[str, list[Path]]:
    named = {f"{s}, {_light(k)}": of[k] for s, of in found.items() for k in ("plain", "traced")}
    rows = [
        (
            name,
            _class(row),
            f"{row['paper_px']:.1f} px, {row['paper_frames']} frames",
            f"{row['paper_score']['paper']:.1f}",
            f"{row['best']['paper']['px']:g} px, {row['best']['paper']['frames']} frames",
            f"{row['best']['paper']['score']:.1f}",
            f"{row['best']['modern']['px']:g} px, {row['best']['modern']['frames']} frames",
        )
        for name, of in named.items()
        for row in of["classes"]
    ]
    heads = (
        "scene and light",
        "deg/s",
        "§5.2",
        "JND",
        "best by the paper's AQM",
        "JND",
        "by the modern mode",
    )
    file = figures.draw_supports(named, place / "supports.png")
    return _block(_windows(terms), _table(heads, rows), figure=file), [file]


def _separation(found: Results, terms: Terms, folder: Path, place: Path) -> tuple[str, list[Path]]:
    rows = [
        (
            scene,
            row["frame"],
            where,
            f"{row[where]['pixels']:.2f}",
            _or_dash(row[where]["deg_s"]),
            *(_or_dash(row[where]["effect"][how]["score"]) for how in ("motion", "still")),
            *(_or_dash(row[where][f"reference {kind}"]["motion"]["score"]) for kind in ("together", "apart")),
            _or_dash(row[where]["raw together"]["motion"]["visible_percent"]),
        )
        for scene, of in found.items()
        for row in of["frames"]
        for where in ("ghosts", "outlines")
        if row[where]["count"] >= separation.FEWEST
    ]
    heads = (
        "scene", "frame", "what", "pixels, %", "deg/s", "made by separation, JND in motion", "as stills",
        "error without separation, JND", "with it", "against unfiltered, above 1 JND, %",
    )  # fmt: skip
    drawn = []
    for scene in found:
        example = _arrays(folder / scene / "separation.npz")
        drawn.append(pictures_of.draw_ghosts(example, place / f"ghosts-{scene}.png"))
    pictures = "\n\n".join(f"![{f.stem}]({FIGURES}/{f.name})" for f in drawn)
    few = f"Where fewer than {separation.FEWEST} pixels are concerned, the row is left out."
    return _block(_plain_size(terms), _table(heads, rows), few, pictures), drawn


def _reflections(found: Results, terms: Terms, folder: Path, place: Path) -> tuple[str, list[Path]]:
    rows = [
        (
            scene,
            row["frame"],
            f"{row['surface_deg_s']:.1f} / {row['reflected_deg_s']:.1f}",
            FILTERS[name],
            *(f"{of_filter[how]['score']:.1f}" for how in ("motion", "still", "modern")),
        )
        for scene, of in found.items()
        for row in of["frames"]
        for name, of_filter in row["filters"].items()
    ]
    heads = (
        "scene", "frame", "mirror / reflection, deg/s", "temporal filter", "JND in motion", "as a still",
        "modern mode",
    )  # fmt: skip
    drawn = []
    for scene in (s for s, of in found.items() if of["frames"]):
        example = _arrays(folder / scene / "reflections.npz")
        drawn.append(pictures_of.draw_mirrors(example, place / f"mirrors-{scene}.png"))
    without = [scene.upper() for scene, of in found.items() if not of["frames"]]
    note = f"{' and '.join(without)} has no mirrors." if without else ""
    pictures = "\n\n".join(f"![{f.stem}]({FIGURES}/{f.name})" for f in drawn)
    return _block(_plain_size(terms), _table(heads, rows), note, pictures), drawn


BLOCKS: dict[str, Callable[[Any, Terms, Path, Path], tuple[str, list[Path]]]] = {
    "placement": _placement,
    "statistics": _statistics,
    "shares": _shares,
    "times": _times,
    "threshold": _threshold,
    "supports": _supports,
    "separation": _separation,
    "reflections": _reflections,
}


def _arrays(file: Path) -> dict[str, Any]:
    with np.load(file, allow_pickle=False) as held:
        return {name: held[name] for name in held.files}


def _block(*parts: str, figure: Path | None = None) -> str:
    shown = [part for part in parts if part]
    if figure is not None:
        shown.append(f"![{figure.stem}]({FIGURES}/{figure.name})")
    return "\n\n".join(shown)


def _table(heads: tuple[str, ...], rows: list[tuple[Any, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def _size(terms: Terms) -> str:
    return f"*{terms.size[0]}x{terms.size[1]} pixels, the {terms.preset} walks, {terms.spp} paths a pixel.*"


def _plain_size(terms: Terms) -> str:
    width, height = terms.size
    return f"*{terms.windows} frames of the {terms.preset} walks, {width}x{height} pixels, without noise.*"


def _windows(terms: Terms) -> str:
    (w, h), (ws, hs) = terms.size, terms.window_size
    return (
        f"*Frames of a walk with their neighbours, at even quantiles of its velocities: {terms.windows} "
        f"without noise at {w}x{h}, {terms.traced_windows} path traced at {ws}x{hs} with {terms.window_spp} "
        f"paths, references with {terms.window_reference_spp}; 28 pixels to a degree in both, so that "
        f"the same motion has {ws / w:.3g} times the angular velocity in the latter.*"
    )


def _light(kind: str, of: Mapping[str, Any] | None = None) -> str:
    if kind == "plain":
        return "no noise"
    return "path traced" if of is None else f"{of['spp']} paths"


def _class(row: Mapping[str, Any]) -> str:
    if row["to_deg_s"] is None:
        return f"{row['from_deg_s']:g} on"
    return f"{row['from_deg_s']:g} to {row['to_deg_s']:g}"


def _or_dash(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.2f}" if abs(value) < 10.0 else f"{value:.1f}"


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _listed(numbers: list[int]) -> str:
    *before, last = map(str, numbers)
    return f"{', '.join(before)} and {last}" if before else last
