"""Crops, slices through time, and videos of the contestants of a bench beside its reference."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.images import encode_video, read_exr
from enfilade.kernels.tone import srgb_decode, srgb_encode
from enfilade.records import F32
from enfilade.reports.charts import INK, Figure, save
from enfilade.settings import VideoSettings
from studies.bench.charts import STYLES
from studies.bench.tables import score_text

__all__ = ["plot_crops", "plot_slices", "write_differences"]

DPI = 130
AMPLIFIED = 4.0  # how much larger differences are shown than they are
CROP_PX = 72  # side of a crop
CENTRED: dict[str, Any] = {"ha": "center", "va": "center"}
SHOWN_FRAMES = 3
SHOWN_A_FAMILY = 3  # contestants of one family among the pictures: cheapest, middle, dearest


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
            name: _shown(found, folder / "references" / f"reference-{name}", number)
            for name in found["reference"]["filters"]
        }
        images = {name: _shown(found, folder / "contestants" / name, number) for name in shown}
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


def plot_slices(found: Mapping[str, Any], folder: Path, file: Path) -> Path:
    """Put slices through time, one line of pixels of all frames, below each other: reference and contestants.

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
    Time goes down. What rests draws upright lines, what moves slanted ones; flicker shows as streaks across,
    popping as a step at one height. The line is that where the contestants' flicker differs most.
    """
    shown, numbers = _selected(found["contestants"]), found["frames"]
    line = _most_flickering(shown.values(), found, folder)
    references = {f"reference, {name}": f"reference-{name}" for name in found["reference"]["filters"]}
    strips = {name: folder / "references" / held for name, held in references.items()}
    strips |= {name: folder / "contestants" / name for name in shown}
    figure = Figure(figsize=(9.0, 0.75 * len(strips) + 0.3), dpi=DPI, layout="constrained")
    axes = figure.subplots(len(strips), 1, squeeze=False)[:, 0]
    for ax, (name, frames) in zip(axes, strips.items(), strict=True):
        strip = np.stack([_shown(found, frames, number)[line] for number in numbers])
        ax.imshow(strip, interpolation="nearest", aspect="auto")
        ax.set_xticks([])
        ax.set_yticks([])
        ax.set_ylabel(name, fontsize=7, color=INK, rotation=0, ha="right", va="center")
    axes[0].set_title(
        f"line {line} of frames {numbers[0]} to {numbers[-1]}, time downwards", fontsize=8, color=INK
    )
    return save(figure, file)


def _most_flickering(shown: Iterable[Mapping[str, Any]], found: Mapping[str, Any], folder: Path) -> int:
    """The line of pixels whose errors change most from frame to frame, each contestant counting the same."""
    height = found["size"][1]
    total = np.zeros(height)
    for one in shown:
        changes, last = np.zeros(height), None
        for number in found["frames"]:
            test, reference = _pair(found, one, folder, number)
            error = test - reference
            if last is not None:
                changes += np.square(error - last).sum(axis=(1, 2))
            last = error
        total += changes / max(float(changes.mean()), 1e-12)
    return int(total.argmax())


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
            _side_by_side(found, one, folder),
            fps=found["fps"],
            width=2 * width,
            height=height,
            settings=VideoSettings(),
            exposure_ev=0.0,
        )
    return files


def _side_by_side(found: Mapping[str, Any], one: Mapping[str, Any], folder: Path) -> Iterator[F32]:
    for number in found["frames"]:
        test, reference = _pair(found, one, folder, number)
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


def _pair(found: Mapping[str, Any], one: Mapping[str, Any], folder: Path, number: int) -> tuple[F32, F32]:
    """A frame of a contestant, and that of the reference of its pixel filter."""
    reference = folder / "references" / f"reference-{one['pixel_filter']}"
    return _shown(found, folder / "contestants" / one["name"], number), _shown(found, reference, number)


def _shown(found: Mapping[str, Any], folder: Path, number: int) -> F32:
    """A frame as the judges see it: after exposure and clipping, encoded; older benches say no exposure."""
    sign = "-" if number < 0 else ""
    linear = read_exr(folder / "frames" / f"{sign}{abs(number):04d}.exr")["RGB"].astype(np.float32)
    exposed = linear * np.float32(2.0 ** found.get("exposure_ev", 0.0))
    return srgb_encode(np.clip(exposed, 0.0, 1.0)).astype(np.float32)


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
