"""The chart of a bench, quality over CPU time; crops and videos of every contestant beside the reference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from enfilade.codec import read_exr
from enfilade.pixels.tone import srgb_decode, srgb_encode
from enfilade.records import F32
from enfilade.report.bench_tables import score_text
from enfilade.report.charts import BLUE, GREEN, INK, ORANGE, VERMILION, Figure, save
from enfilade.settings import VideoSettings
from enfilade.video import encode_video

__all__ = ["plot_bench", "plot_crops", "write_differences"]

DPI = 130
PANEL_IN = (5.6, 4.1)
GREY = "#7A7A7A"
STYLES: dict[str, dict[str, Any]] = {  # by family: told apart by marker and line as well as by colour
    "traced": {"color": GREY, "marker": "o", "linestyle": "--", "label": "path tracing every frame"},
    "denoised": {
        "color": ORANGE,
        "marker": "s",
        "linestyle": "-.",
        "label": "path tracing + Open Image Denoise",
    },
    "interpolated": {
        "color": VERMILION,
        "marker": "X",
        "linestyle": "none",
        "label": "keyframes + minterpolate",
    },
    "paper": {"color": GREEN, "marker": "^", "linestyle": ":", "label": "enfilade, paper (2000)"},
    "decoupled": {"color": BLUE, "marker": "D", "linestyle": "-", "label": "enfilade, decoupled"},
}
OURS = "decoupled"
BELOW = ("traced", "denoised")  # families whose labels stand below their points, out of the others' way
LABELLED = ("", "high")  # variants that are labelled: the others lie beside them
TICKS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
AMPLIFIED = 4.0  # how much larger differences are shown than they are
CROP_PX = 72  # side of a crop
CENTRED: dict[str, Any] = {"ha": "center", "va": "center"}
SHOWN_FRAMES = 3
SHOWN_A_FAMILY = 3  # contestants of one family among the crops: cheapest, middle, dearest


def plot_bench(found: Mapping[str, Any], file: Path) -> Path:
    """Draw a panel for each judge, CPU time to the right, quality upwards.

    Parameters
    ----------
    found
        What ``bench.json`` holds.
    file
        Where the PNG goes.
    """
    judges = found["judges"]
    columns = 2 if len(judges) > 1 else 1
    rows = -(-len(judges) // columns)
    figure = Figure(figsize=(PANEL_IN[0] * columns, PANEL_IN[1] * rows + 0.9), dpi=DPI, layout="constrained")
    width, height = found["size"]
    machine, spp = found["machine"], found["reference"]["spp"]
    figure.suptitle(
        f"{found['scene']}, {len(found['frames'])} frames of {width}x{height}\n"
        f"references of {spp} paths a pixel; {machine['processor']}, cores: {machine['cores']}; "
        f"{found['date'][:10]}",
        fontsize=11,
        color=INK,
    )
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (judge, of) in zip(axes, judges.items(), strict=False):
        _panel(ax, found, judge, of)
    for ax in axes[len(judges) :]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9.5, frameon=False)
    return save(figure, file)


def _panel(ax: Any, found: Mapping[str, Any], judge: str, of: Mapping[str, Any]) -> None:
    ax.set_title(f"{of['title']}, {of['unit']}", loc="left", fontsize=11, color=INK)
    ax.set_title("better ↑", loc="right", fontsize=9, color=INK)
    for family, style in STYLES.items():
        points = [
            (c["cost"]["cpu_s"], c["scores"][judge], c)
            for c in found["contestants"]
            if c["family"] == family and c["scores"][judge] is not None
        ]
        if points:
            _curve(ax, points, family, style, is_more_better=of["is_more_better"])
    floor = found["reference"]["floor"].get(judge)
    if floor is not None:
        ax.axhline(
            floor, color=GREY, linewidth=1.0, linestyle=(0, (1, 3)), label="noise of the reference", zorder=2
        )
    ax.set_xscale("log")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_locator(NullLocator())
    if not of["is_more_better"]:
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=TICKS))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.invert_yaxis()
    ax.set_xlabel("CPU time of all frames, s", fontsize=9.5, color=INK)
    ax.grid(color="#E4E4E4", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(colors=INK, labelsize=8.5)
    ax.margins(x=0.08, y=0.1)


def _curve(
    ax: Any,
    points: Sequence[tuple[float, float, Any]],
    family: str,
    style: Mapping[str, Any],
    *,
    is_more_better: bool,
) -> None:
    """A curve through the contestants that no cheaper one of the family beats; the others beside it, open."""
    is_ours = family == OURS
    best = _front(points, is_more_better=is_more_better)
    look = {"color": style["color"], "marker": style["marker"], "markersize": 8 if is_ours else 6.5}
    ax.plot(
        [p[0] for p in best],
        [p[1] for p in best],
        **(look | {"linestyle": style["linestyle"], "label": style["label"]}),
        linewidth=2.6 if is_ours else 1.5,
        markeredgecolor="white",
        markeredgewidth=0.8,
        zorder=4 if is_ours else 3,
    )
    for point in points:
        if point not in best:
            ax.plot(*point[:2], **look, linestyle="none", markerfacecolor="white", zorder=3)
        if point[2]["variant"] not in LABELLED:
            continue
        ax.annotate(
            _short(point[2]),
            point[:2],
            xytext=(0, -7 if family in BELOW else 7),
            textcoords="offset points",
            ha="center",
            va="top" if family in BELOW else "bottom",
            fontsize=7,
            color=style["color"],
            zorder=5,
        )


def _front(
    points: Sequence[tuple[float, float, Any]], *, is_more_better: bool
) -> list[tuple[float, float, Any]]:
    kept: list[tuple[float, float, Any]] = []
    for point in sorted(points, key=lambda p: p[0]):
        if not kept or (point[1] > kept[-1][1] if is_more_better else point[1] < kept[-1][1]):
            kept.append(point)
    return kept


def _short(contestant: Mapping[str, Any]) -> str:
    """What tells a point from its neighbours on the curve: paths a pixel, or the end of its name."""
    if contestant["family"] in (OURS, "paper"):
        return str(contestant["name"]).rpartition("-")[2]
    return str(contestant["spp"])


def plot_crops(found: Mapping[str, Any], folder: Path, file: Path) -> Path:
    """Put crops of the contestants beside those of the reference, where they differ most.

    Parameters
    ----------
    found
        What ``bench.json`` holds.
    folder
        Of the bench.
    file
        Where the PNG goes.

    Notes
    -----
    Two rows for each of up to three frames: the crop, and four times its difference to the reference
    around mid-grey.
    """
    shown = _selected(found["contestants"])
    numbers = found["frames"]
    frames = sorted(
        {numbers[round((i + 0.5) * len(numbers) / SHOWN_FRAMES - 0.5)] for i in range(SHOWN_FRAMES)}
    )
    columns = ["reference", *shown]
    figure = Figure(figsize=(1.25 * len(columns), 1.3 * 2 * len(frames) + 0.4), dpi=DPI, layout="constrained")
    axes = figure.subplots(2 * len(frames), len(columns), squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    for row, number in enumerate(frames):
        references = {
            name: _shown(folder / "references" / f"reference-{name}", number)
            for name in found["reference"]["filters"]
        }
        images = {c["name"]: _shown(folder / "contestants" / c["name"], number) for c in shown.values()}
        against = {c["name"]: references[c["pixel_filter"]] for c in shown.values()}
        place = _most_different(images, against)
        reference = references.get("gaussian", next(iter(references.values()), None))
        if reference is None:
            continue
        axes[2 * row, 0].imshow(reference[place], interpolation="nearest")
        axes[2 * row + 1, 0].text(0.5, 0.9, f"↑ frame {number}", fontsize=8, color=INK, **CENTRED)
        axes[2 * row + 1, 0].text(0.5, 0.5, "4 × difference →", fontsize=7, color=INK, **CENTRED)
        for column, name in enumerate(shown, start=1):
            axes[2 * row, column].imshow(images[name][place], interpolation="nearest")
            off = _difference(images[name][place], against[name][place])
            axes[2 * row + 1, column].imshow(off, interpolation="nearest")
    first = next(iter(found["judges"]), None)
    for column, name in enumerate(columns):
        text = name if not column or first is None else f"{name}\n{score_text(shown[name]['scores'][first])}"
        axes[0, column].set_title(text, fontsize=7, color=INK)
    return save(figure, file)


def write_differences(found: Mapping[str, Any], folder: Path) -> list[Path]:
    """Encode a video of each contestant: its frames, and beside them four times their difference.

    Parameters
    ----------
    found
        What ``bench.json`` holds.
    folder
        Of the bench; the videos go into ``differences/`` there.
    """
    width, height = found["size"]
    files = []
    for one in found["contestants"]:
        files.append(folder / "differences" / f"{one['name']}.mp4")
        encode_video(
            files[-1],
            _side_by_side(one, found["frames"], folder),
            fps=found["fps"],
            width=2 * width,
            height=height,
            settings=VideoSettings(),
            exposure_ev=0.0,
        )
    return files


def _side_by_side(one: Mapping[str, Any], numbers: Sequence[int], folder: Path) -> Iterator[F32]:
    for number in numbers:
        test = _shown(folder / "contestants" / one["name"], number)
        reference = _shown(folder / "references" / f"reference-{one['pixel_filter']}", number)
        yield srgb_decode(np.concatenate([test, _difference(test, reference)], axis=1)).astype(np.float32)


def _difference(test: F32, reference: F32) -> F32:
    """Four times the difference around mid-grey, 0..1."""
    shown = 0.5 + np.float32(AMPLIFIED) * (test - reference)
    return np.asarray(np.clip(shown, 0.0, 1.0), np.float32)


def _selected(contestants: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    chosen: dict[str, Mapping[str, Any]] = {}
    for family in STYLES:
        members = [c for c in contestants if c["family"] == family]
        count = min(SHOWN_A_FAMILY, len(members))
        for index in range(count):
            one = members[round(index * (len(members) - 1) / max(count - 1, 1))]
            chosen[one["name"]] = one
    return chosen


def _shown(folder: Path, number: int) -> F32:
    sign = "-" if number < 0 else ""
    linear = read_exr(folder / "frames" / f"{sign}{abs(number):04d}.exr")["RGB"].astype(np.float32)
    return srgb_encode(np.clip(linear, 0.0, 1.0)).astype(np.float32)


def _most_different(images: Mapping[str, F32], against: Mapping[str, F32]) -> tuple[slice, slice]:
    """The square where the contestants together are farthest from their references."""
    first = next(iter(against.values()), None)
    if first is None:
        return slice(0, CROP_PX), slice(0, CROP_PX)
    height, width = first.shape[:2]
    # Each contestant counts by where it errs, not by how much: the worst one would else decide alone.
    total = np.zeros((height, width))
    for name, image in images.items():
        error = np.square(image - against[name]).sum(axis=-1)
        total += error / max(float(error.mean()), 1e-12)
    side_y, side_x = min(CROP_PX, height), min(CROP_PX, width)
    sums = np.pad(total.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    inside: npt.NDArray[np.float64] = (
        sums[side_y:, side_x:] - sums[:-side_y, side_x:] - sums[side_y:, :-side_x] + sums[:-side_y, :-side_x]
    )
    top, left = np.unravel_index(int(inside.argmax()), inside.shape)
    return slice(int(top), int(top) + side_y), slice(int(left), int(left) + side_x)
