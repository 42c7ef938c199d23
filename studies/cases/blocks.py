"""Generated blocks of the document: tables of results beside those of the paper, and figures.

Each function takes the results of one item by scene, the extent, the folder of the results and that of the
figures, and returns Markdown and the files of the figures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from studies.cases import charts, pictures, placement, refinement, separation, statistics, times
from studies.cases.charts import velocity_class
from studies.cases.extent import Extent

Values = Mapping[str, Any]  # of one item, by scene
Block = tuple[str, list[Path]]
FIGURES = "figures"  # beside the document
METHODS = {"art": "ART", "rt": "RT", "ibr_rt": "IBR+RT (`paper`)", "decoupled": "`decoupled`"}
REUSING = ("ibr_rt", "decoupled")
FILTERS = {
    "none": "none",
    "full": "11 frames, motion of the mirror",
    "short": "3 frames, motion of the mirror (the paper's)",
    "reflected": "11 frames, motion of the reflection",
}


def _placement(results: Values, extent: Extent, _folder: Path, figures: Path) -> Block:
    rows, answers = [], []
    for scene, result in results.items():
        by_a = {row["adaptation"]: row for row in result["placements"]}
        for a, row in by_a.items():
            paper = placement.PAPER_PERCENT.get(a) if scene == "room" else None
            share = 100.0 * len(row["keyframes"]) / len(result["numbers"])
            cells = (f"{row['mean']:.2f}", len(row["keyframes"]), f"{row['mean'] + share:.2f}")
            rows.append((scene, _placement_name(a), "" if paper is None else f"{paper:.2f}", *cells))
        half, even = (100.0 * (by_a[a]["mean"] / by_a[0.0]["mean"] - 1.0) for a in (placement.PAPER_A, None))
        best = min(by_a, key=lambda a: by_a[a]["mean"])
        answers.append(
            f"**{scene.upper()}:** Eq. 6 with A = 0.5 changes the disocclusions of uniform spacing by "
            f"{half:+.0f} %, equal flow by {even:+.0f} %; the least has {_placement_name(best)}."
        )
    heads = ("scene", "placement", "paper, %", "enfilade, %", "keyframes", "with keyframes, %")
    file = charts.draw_placement(results, figures / "placement.png")
    return _block([_size(extent), _table(heads, rows), *answers], [file])


def _placement_name(adaptation: float | None) -> str:
    if adaptation is None:
        return "equal flow"
    return f"Eq. 6, A = {adaptation:g}" if adaptation else "uniform"


def _statistics(results: Values, extent: Extent, _folder: Path, figures: Path) -> Block:
    means = ("before", "after", "split_before", "split_after", "before_still", "after_still")
    counts = ("initial", "split", "remaining", "remaining_above_limit", "split_only_by_pursuit")
    rows = [
        (scene, name, *(_or_dash(result[kind][key]) for key in means), *(result[kind][key] for key in counts))
        for scene, result in results.items()
        for kind, name in (("predictions", f"{extent.spp} paths"), ("plain", "no noise"))
    ]
    heads = (
        "scene", "light", "before, %", "after, %", "split segments: before, %", "after, %",
        "eye at rest: before, %", "after, %",
        "initial segments", "splits", "remaining segments", "remaining above 10 %", "split only by pursuit",
    )  # fmt: skip
    drawn = [
        charts.draw_walk(result, scene, figures / f"walkthrough-{scene}.png")
        for scene, result in results.items()
    ]
    return _block([_size(extent), _table(heads, rows)], drawn)


def _refinement(results: Values, extent: Extent, _folder: Path, _figures: Path) -> Block:
    rows = []
    for scene, result in results.items():
        for light, of in result.items():
            told = of["predictions"]
            most = str(max(refinement.SPPS))
            same, count = refinement.agreement(of["segments"], result[most]["segments"])
            name = light if light == "no noise" else f"{light} paths"
            percents = (told[key] for key in ("before", "after", "split_before", "split_after"))
            counts = (told[key] for key in ("split", "remaining"))
            rows.append((scene, name, *map(_or_dash, percents), *counts, f"{same} of {count}"))
    heads = (
        "scene", "light", "before, %", "after, %", "split segments: before, %", "after, %", "splits",
        "remaining segments", "initial segments decided as with the most paths",
    )  # fmt: skip
    return _block([_size(extent), _table(heads, rows)], [])


def _shares(results: Values, extent: Extent, _folder: Path, _figures: Path) -> Block:
    keys = ("slow", "specular", "disoccluded", "keyframe", "total")
    rows = [
        (scene, source, *(f"{table[key]:.1f}" for key in keys))
        for scene, result in results.items()
        for source, table in (
            ("paper", statistics.PAPER_SHARES[scene]),
            ("enfilade", result["traced_percent"]),
        )
    ]
    notes = [
        f"**{scene.upper()}:** {result['frames']} frames, {result['keyframes']} keyframes; "
        f"{result['slow_percent']:.1f} % of the pixels are slower than 0.5 deg/s, "
        f"{result['specular_percent']:.1f} % show glossy, mirroring or transparent surfaces."
        for scene, result in results.items()
    ]
    return _block([_size(extent), _table(("scene", "", *keys), rows), *notes], [])


def _times(results: Values, extent: Extent, _folder: Path, _figures: Path) -> Block:
    heads = (
        "scene", "method", "paths", "paper, min", "CPU, s", "equivalent paths", "over IBR+RT", "paper", "JND",
        "above 1 JND, %",
    )  # fmt: skip
    rows = [_time_row(scene, method, result) for scene, result in results.items() for method in METHODS]
    series = [
        (scene, row["spp"], *(f"{_mean(row['frames'], key):.2f}" for key in ("score", "visible_percent")))
        for scene, result in results.items()
        for row in result["art_series"]
    ]
    notes = [
        f"**{scene.upper()}:** measured in frames {_listed(result['numbers'])}, "
        f"{result['crop'][0]}x{result['crop'][1]} pixels at their centre, against {result['reference_spp']} "
        "paths a pixel, whose noise is not counted. While IBR+RT was rendered, a path of ART took "
        f"{result['path_us']['gaussian']['cpu']:.1f} µs of CPU, one of RT "
        f"{result['path_us']['centre']['cpu']:.1f} µs. Equivalent paths are the paths of ART a pixel that "
        " the same CPU time would have traced during the same run."
        for scene, result in results.items()
    ]
    tables = (
        _table(("scene", "equal quality to", "ART, paths", "time ratio", "paper"), _equal_rows(results)),
        _table(("scene", "ART, paths", "JND", "above 1 JND, %"), series),
    )
    return _block([_size(extent), _table(heads, rows), *notes, *tables], [])


def _time_row(scene: str, method: str, result: Values) -> tuple[Any, ...]:
    one, paper_minutes = result["methods"][method], times.PAPER_MINUTES[scene]
    minutes = paper_minutes.get(method)
    bound = "at least " if method == "art" and result["art_is_bound"] else ""
    equivalent = one["equivalent_paths"]
    return (
        scene,
        METHODS[method],
        f"{bound}{one['spp']}" if one["spp"] else "",
        "" if minutes is None else f"{minutes:g}",
        f"{bound}{one['cpu_s']:.2f}",
        f"{bound}{equivalent:.2f}",
        f"{bound}{equivalent / result['methods']['ibr_rt']['equivalent_paths']:.2f}",
        "" if minutes is None else f"{minutes / paper_minutes['ibr_rt']:.2f}",
        *(f"{_mean(one['frames'], k):.1f}" if one["frames"] else "" for k in ("score", "visible_percent")),
    )


def _equal_rows(results: Values) -> list[tuple[Any, ...]]:
    """Paths of ART at equal quality by the metric to methods that reuse pixels, and the ratio of times."""
    rows: list[tuple[Any, ...]] = []
    for scene, result in results.items():
        paper_minutes = times.PAPER_MINUTES[scene]
        for method in REUSING:
            one = result["methods"][method]
            spp = times.equal_spp(result["art_series"], _mean(one["frames"], "score"))
            if spp is None:
                rows.append((scene, METHODS[method], "beyond the series", "–", ""))
                continue
            ratio = f"{paper_minutes['art'] / paper_minutes['ibr_rt']:.1f}" if method == "ibr_rt" else ""
            rows.append((scene, METHODS[method], f"{spp:.0f}", f"{spp / one['equivalent_paths']:.1f}", ratio))
    return rows


def _threshold(results: Values, extent: Extent, _folder: Path, figures: Path) -> Block:
    lights = {"plain": "no noise", "traced": f"{extent.window_spp} paths"}
    named = {f"{scene}, {lights[kind]}": result[kind] for scene, result in results.items() for kind in lights}
    rows = []
    for name, result in named.items():
        at = {row["threshold_deg_s"]: row for row in result["curve"]}
        cells = [at[v]["reused_visible_percent"] for v in (0.0, 0.5, 1.0, 2.0, 5.0)]
        cells += [at[0.5]["traced_percent"], at[0.5]["removed_below_deg_s"]]
        chosen = "none" if result["threshold_deg_s"] is None else f"{result['threshold_deg_s']:g}"
        rows.append((name, chosen, *map(_or_dash, cells)))
    heads = (
        "scene and light", "v_t", "visible at v_t = 0, %", "0.5 (the paper's)", "1", "2", "5",
        "traced at 0.5, %", "removed at 0.5: 95th percentile, deg/s",
    )  # fmt: skip
    classes = [
        (name, velocity_class(row), f"{row['pixels']:,}", f"{row['visible_percent']:.1f}")
        for name, result in named.items()
        for row in result["by_velocity"]
    ]
    by_velocity = _table(("scene and light", "velocity, deg/s", "pixels", "above 1 JND, %"), classes)
    file = charts.draw_threshold(named, figures / "threshold.png")
    return _block([_windows(extent), _table(heads, rows), by_velocity], [file])


def _supports(results: Values, extent: Extent, _folder: Path, _figures: Path) -> Block:
    lights = {"plain": "no noise", "traced": "path traced"}
    named = {f"{scene}, {lights[kind]}": result[kind] for scene, result in results.items() for kind in lights}
    rows = []
    for name, result in named.items():
        for row in result["classes"]:
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
    return _block([_windows(extent), _table(heads, rows)], [])


def _separation(results: Values, extent: Extent, folder: Path, figures: Path) -> Block:
    rows = []
    for scene, result in results.items():
        for row in result["frames"]:
            for name in ("ghosts", "outlines"):
                at = row[name]
                if at["count"] < separation.MIN_PIXELS:
                    continue
                cells = [at["deg_s"], *(at["effect"][how]["score"] for how in ("motion", "still"))]
                cells += [
                    at[f"{kind} against reference"]["motion"]["score"]
                    for kind in ("unseparated", "separated")
                ]
                cells.append(at["unseparated against unfiltered"]["motion"]["visible_percent"])
                rows.append((scene, row["frame"], name, f"{at['pixels']:.2f}", *map(_or_dash, cells)))
    heads = (
        "scene", "frame", "pixels", "share, %", "deg/s", "effect of separation, JND in motion", "as stills",
        "error without separation, JND", "with separation, JND", "against unfiltered, above 1 JND, %",
    )  # fmt: skip
    few = f"Rows of fewer than {separation.MIN_PIXELS} pixels are left out."
    drawn = [
        pictures.draw_ghosts(folder / scene / "separation.npz", figures / f"ghosts-{scene}.png")
        for scene in results
    ]
    return _block([_plain_size(extent), _table(heads, rows), few], drawn)


def _reflections(results: Values, extent: Extent, _folder: Path, _figures: Path) -> Block:
    rows = [
        (
            scene,
            row["frame"],
            f"{row['surface_deg_s']:.1f} / {row['reflected_deg_s']:.1f}",
            FILTERS[name],
            *(f"{filtered[how]['score']:.1f}" for how in ("motion", "still", "modern")),
        )
        for scene, result in results.items()
        for row in result["frames"]
        for name, filtered in row["filters"].items()
    ]
    heads = (
        "scene", "frame", "mirror / reflection, deg/s", "temporal filter", "JND in motion", "as a still",
        "modern mode",
    )  # fmt: skip
    without = [scene.upper() for scene, result in results.items() if not result["frames"]]
    note = f"{' and '.join(without)} has no mirrors." if without else ""
    return _block([_plain_size(extent), _table(heads, rows), note], [])


BLOCKS: dict[str, Callable[[Values, Extent, Path, Path], Block]] = {
    "placement": _placement,
    "statistics": _statistics,
    "refinement": _refinement,
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


def _size(extent: Extent) -> str:
    return (
        f"*{extent.size[0]}x{extent.size[1]} pixels, the {extent.preset} walks, {extent.spp} paths a pixel.*"
    )


def _plain_size(extent: Extent) -> str:
    width, height = extent.size
    return f"*{extent.windows} frames of the {extent.preset} walks, {width}x{height} pixels, without noise.*"


def _windows(extent: Extent) -> str:
    (w, h), (ws, hs) = extent.size, extent.window_size
    return (
        f"*Frames of a walk with their neighbours, at even quantiles of its velocities: {extent.windows} "
        f"without noise at {w}x{h}, {extent.traced_windows} path traced at {ws}x{hs} with "
        f"{extent.window_spp} paths, references with {extent.window_reference_spp}; 28 pixels per degree "
        f"in both, so that the same motion has {ws / w:.3g} times the angular velocity in the latter.*"
    )


def _or_dash(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.2f}" if abs(value) < 10.0 else f"{value:.1f}"


def _mean(frames: list[dict[str, float]], key: str) -> float:
    return sum(result[key] for result in frames) / len(frames)


def _listed(numbers: list[int]) -> str:
    *before, last = map(str, numbers)
    return f"{', '.join(before)} and {last}" if before else last
