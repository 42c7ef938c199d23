"""Blocks of the document: tables of results beside the paper's, and figures.

Each function takes the results of one item by scene, the terms, the folder of the results and that of the
figures, and returns Markdown and the files that it drew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from studies.cases import charts, pictures, placement, separation, statistics, times
from studies.cases.charts import velocity_class
from studies.cases.terms import Terms

Values = Mapping[str, Any]  # of one item, by scene
Block = tuple[str, list[Path]]
FIGURES = "figures"  # beside the document
WAYS = {"art": "ART", "rt": "RT", "ibr_rt": "IBR+RT (`paper`)", "decoupled": "`decoupled`"}
REUSING = ("ibr_rt", "decoupled")
FILTERS = {
    "none": "none",
    "full": "11 frames, the mirror's own flow",
    "short": "3 frames, the mirror's own flow (the paper's)",
    "reflected": "11 frames, the flow of the reflection",
}


def _placement(found: Values, terms: Terms, _folder: Path, place: Path) -> Block:
    rows, answers = [], []
    for scene, of in found.items():
        by_a = {row["adaptation"]: row for row in of["placements"]}
        for a, row in by_a.items():
            paper = placement.PAPER_PERCENT.get(a) if scene == "room" else None
            share = 100.0 * len(row["keyframes"]) / len(of["numbers"])
            cells = (f"{row['mean']:.2f}", len(row["keyframes"]), f"{row['mean'] + share:.2f}")
            rows.append((scene, _placement_name(a), "" if paper is None else f"{paper:.2f}", *cells))
        half, even = (100.0 * (by_a[a]["mean"] / by_a[0.0]["mean"] - 1.0) for a in (placement.PAPER_A, None))
        best = min(by_a, key=lambda a: by_a[a]["mean"])
        answers.append(
            f"**{scene.upper()}:** Eq. 6 with A = 0.5 changes the disocclusions of uniform spacing by "
            f"{half:+.0f} %, equal flow by {even:+.0f} %; the least has {_placement_name(best)}."
        )
    heads = ("scene", "placement", "paper, %", "ours, %", "keyframes", "with them, %")
    file = charts.draw_placement(found, place / "placement.png")
    return _block([_size(terms), _table(heads, rows), *answers], [file])


def _placement_name(adaptation: float | None) -> str:
    if adaptation is None:
        return "equal flow"
    return f"Eq. 6, A = {adaptation:g}" if adaptation else "uniform"


def _statistics(found: Values, terms: Terms, _folder: Path, place: Path) -> Block:
    means = ("before", "after", "split_before", "split_after", "before_still", "after_still")
    counts = ("initial", "split", "remaining", "given_up", "split_not_seen_still")
    rows = [
        (scene, name, *(_or_dash(of[kind][key]) for key in means), *(of[kind][key] for key in counts))
        for scene, of in found.items()
        for kind, name in (("predictions", f"{terms.spp} paths"), ("plain", "no noise"))
    ]
    heads = (
        "scene", "light", "before, %", "after, %", "split ones before, %", "after, %",
        "all before, eye at rest", "after, eye at rest",
        "initial segments", "splits", "remaining", "still above 10 %", "split, below it with the eye at rest",
    )  # fmt: skip
    drawn = [charts.draw_walk(of, scene, place / f"walkthrough-{scene}.png") for scene, of in found.items()]
    return _block([_size(terms), _table(heads, rows)], drawn)


def _shares(found: Values, terms: Terms, _folder: Path, _place: Path) -> Block:
    keys = ("slow", "specular", "occlusion", "keyframes", "total")
    rows = [
        (scene, whose, *(f"{table[key]:.1f}" for key in keys))
        for scene, of in found.items()
        for whose, table in (("paper", statistics.PAPER_SHARES[scene]), ("ours", of["table1"]))
    ]
    notes = [
        f"**{scene.upper()}:** {of['frames']} frames, {of['keyframes']} keyframes; {of['slow_seen']:.1f} % "
        f"of the pixels are slower than 0.5 deg/s, {of['specular_seen']:.1f} % show glossy, mirroring or "
        "transparent surfaces."
        for scene, of in found.items()
    ]
    return _block([_size(terms), _table(("scene", "", *keys), rows), *notes], [])


def _times(found: Values, terms: Terms, _folder: Path, _place: Path) -> Block:
    heads = (
        "scene", "way", "paths", "paper, min", "CPU, s", "worth, paths", "over IBR+RT", "paper", "JND",
        "above 1 JND, %",
    )  # fmt: skip
    rows = [_time_row(scene, way, of) for scene, of in found.items() for way in WAYS]
    stages = [
        (scene, WAYS[way], stage, f"{spent['cpu_s']:.3f}")
        for scene, of in found.items()
        for way in REUSING
        for stage, spent in of["ways"][way]["stages"].items()
    ]
    series = [
        (scene, row["spp"], *(f"{_mean(row['frames'], key):.2f}" for key in ("score", "visible_percent")))
        for scene, of in found.items()
        for row in of["art_series"]
    ]
    notes = [
        f"**{scene.upper()}:** measured in frames {_listed(of['numbers'])}, {of['crop'][0]}x{of['crop'][1]} "
        f"pixels in their middle, against {of['reference_spp']} paths a pixel, whose noise is not counted. "
        f"While IBR+RT was rendered, a path of ART took {of['path_us']['gaussian']['cpu']:.1f} µs of CPU, "
        f"one of RT {of['path_us']['centre']['cpu']:.1f} µs: a way is worth so many paths of ART a pixel as "
        "its CPU time would have traced in its own hours."
        for scene, of in found.items()
    ]
    tables = (
        _table(("scene", "as good as", "ART takes, paths", "times as long", "paper"), _equal_rows(found)),
        _table(("scene", "way", "stage", "CPU, s"), stages),
        _table(("scene", "ART, paths", "JND", "above 1 JND, %"), series),
    )
    return _block([_size(terms), _table(heads, rows), *notes, *tables], [])


def _time_row(scene: str, way: str, of: Values) -> tuple[Any, ...]:
    one, papers = of["ways"][way], times.PAPER_MINUTES[scene]
    minutes = papers.get(way)
    bound = "at least " if way == "art" and of["art_is_bound"] else ""
    worth = one["worth_paths"]
    return (
        scene,
        WAYS[way],
        f"{bound}{one['spp']}" if one["spp"] else "",
        "" if minutes is None else f"{minutes:g}",
        f"{bound}{one['cpu_s']:.2f}",
        f"{bound}{worth:.2f}",
        f"{bound}{worth / of['ways']['ibr_rt']['worth_paths']:.2f}",
        "" if minutes is None else f"{minutes / papers['ibr_rt']:.2f}",
        *(f"{_mean(one['frames'], k):.1f}" if one["frames"] else "" for k in ("score", "visible_percent")),
    )


def _equal_rows(found: Values) -> list[tuple[Any, ...]]:
    """ART with as many paths as make it as good by the metric as a method that reuses pixels."""
    rows: list[tuple[Any, ...]] = []
    for scene, of in found.items():
        papers = times.PAPER_MINUTES[scene]
        for way in REUSING:
            one = of["ways"][way]
            spp = times.equal_spp(of["art_series"], _mean(one["frames"], "score"))
            if spp is None:
                rows.append((scene, WAYS[way], "beyond the series", "–", ""))
                continue
            ratio = f"{papers['art'] / papers['ibr_rt']:.1f}" if way == "ibr_rt" else ""
            rows.append((scene, WAYS[way], f"{spp:.0f}", f"{spp / one['worth_paths']:.1f}", ratio))
    return rows


def _threshold(found: Values, terms: Terms, _folder: Path, place: Path) -> Block:
    lights = {"plain": "no noise", "traced": f"{terms.window_spp} paths"}
    named = {f"{scene}, {lights[kind]}": of[kind] for scene, of in found.items() for kind in lights}
    rows = []
    for name, of in named.items():
        at = {row["threshold_deg_s"]: row for row in of["curve"]}
        cells = [at[v]["reused_visible_percent"] for v in (0.0, 0.5, 1.0, 2.0, 5.0)]
        cells += [at[0.5]["traced_percent"], at[0.5]["removed_below_deg_s"]]
        chosen = "none" if of["threshold_deg_s"] is None else f"{of['threshold_deg_s']:g}"
        rows.append((name, chosen, *map(_or_dash, cells)))
    heads = (
        "scene and light", "v_t found", "visible at v_t = 0, %", "0.5 (the paper's)", "1", "2", "5",
        "traced at 0.5, %", "what 0.5 removes is slower than",
    )  # fmt: skip
    classes = [
        (name, velocity_class(row), f"{row['pixels']:,}", f"{row['visible_percent']:.1f}")
        for name, of in named.items()
        for row in of["by_velocity"]
    ]
    by_velocity = _table(("scene and light", "velocity, deg/s", "pixels", "above 1 JND, %"), classes)
    file = charts.draw_threshold(named, place / "threshold.png")
    return _block([_windows(terms), _table(heads, rows), by_velocity], [file])


def _supports(found: Values, terms: Terms, _folder: Path, _place: Path) -> Block:
    lights = {"plain": "no noise", "traced": "path traced"}
    named = {f"{scene}, {lights[kind]}": of[kind] for scene, of in found.items() for kind in lights}
    rows = []
    for name, of in named.items():
        for row in of["classes"]:
            paper, modern = (row["best"][mode] for mode in ("paper", "modern"))
            cells = (
                f"{row['paper_px']:.1f} px, {row['paper_frames']} frames",
                f"{row['paper_score']['paper']:.1f}",
                f"{paper['px']:g} px, {paper['frames']} frames",
                f"{paper['score']:.1f}",
                f"{modern['px']:g} px, {modern['frames']} frames",
            )
            rows.append((name, velocity_class(row), *cells))
    heads = (
        "scene and light", "deg/s", "§5.2", "JND", "best by the paper's AQM", "JND", "by the modern mode",
    )  # fmt: skip
    return _block([_windows(terms), _table(heads, rows)], [])


def _separation(found: Values, terms: Terms, folder: Path, place: Path) -> Block:
    rows = []
    for scene, of in found.items():
        for row in of["frames"]:
            for name in ("ghosts", "outlines"):
                at = row[name]
                if at["count"] < separation.FEWEST:
                    continue
                cells = [at["deg_s"], *(at["effect"][how]["score"] for how in ("motion", "still"))]
                cells += [at[f"reference {kind}"]["motion"]["score"] for kind in ("together", "apart")]
                cells.append(at["raw together"]["motion"]["visible_percent"])
                rows.append((scene, row["frame"], name, f"{at['pixels']:.2f}", *map(_or_dash, cells)))
    heads = (
        "scene", "frame", "what", "pixels, %", "deg/s", "made by separation, JND in motion", "as stills",
        "error without separation, JND", "with it", "against unfiltered, above 1 JND, %",
    )  # fmt: skip
    few = f"Where fewer than {separation.FEWEST} pixels are concerned, the row is left out."
    drawn = [
        pictures.draw_ghosts(folder / scene / "separation.npz", place / f"ghosts-{scene}.png")
        for scene in found
    ]
    return _block([_plain_size(terms), _table(heads, rows), few], drawn)


def _reflections(found: Values, terms: Terms, _folder: Path, _place: Path) -> Block:
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
    without = [scene.upper() for scene, of in found.items() if not of["frames"]]
    note = f"{' and '.join(without)} has no mirrors." if without else ""
    return _block([_plain_size(terms), _table(heads, rows), note], [])


BLOCKS: dict[str, Callable[[Values, Terms, Path, Path], Block]] = {
    "placement": _placement,
    "statistics": _statistics,
    "shares": _shares,
    "times": _times,
    "threshold": _threshold,
    "supports": _supports,
    "separation": _separation,
    "reflections": _reflections,
}


def _block(parts: list[str], drawn: list[Path]) -> Block:
    links = [f"![{file.stem}]({FIGURES}/{file.name})" for file in drawn]
    return "\n\n".join(part for part in (*parts, *links) if part), drawn


def _table(heads: tuple[str, ...], rows: Iterable[tuple[Any, ...]]) -> str:
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


def _or_dash(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.2f}" if abs(value) < 10.0 else f"{value:.1f}"


def _mean(frames: list[dict[str, float]], key: str) -> float:
    return sum(of[key] for of in frames) / len(frames)


def _listed(numbers: list[int]) -> str:
    *before, last = map(str, numbers)
    return f"{', '.join(before)} and {last}" if before else last
