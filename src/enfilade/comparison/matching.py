"""Checks that compared sequences match: length, size, frames, camera path, frame rate and exposure."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from enfilade.errors import ImageError
from enfilade.images import Sequence
from enfilade.images.sequence import value_at

DEFAULT_FPS = 30.0  # where neither sequence says its own: the paper's (§6)
SEED = ("settings", "trace", "seed")  # in the identity of a run
FPS_TOLERANCE = 2e-3  # relative: 30 and 29.97 are shown as the same


@dataclass(frozen=True)
class Side:
    """A sequence of a comparison.

    Attributes
    ----------
    role : str
        ``test``, ``reference`` or ``second reference``.
    source : Path or str
        As given.
    sequence : Sequence
    """

    role: str
    source: Path | str
    sequence: Sequence


def check_alike(one: Side, other: Side) -> None:
    """Refuse sequences of other frames, lengths or sizes.

    Raises
    ------
    ImageError
        The message names both, and a frame that one lacks.
    """
    a, b = one.sequence, other.sequence
    if a.starts is not None and b.starts is not None:
        _check_same_frames(one, other)
    if len(a) != len(b):
        raise ImageError(
            f"the {one.role} has {len(a)} frames (first {a.name(0)}) and the {other.role} {len(b)} "
            f"(first {b.name(0)}); give equal ones"
        )
    sizes = [f"{s.width}x{s.height}" for s in (a, b)]
    if sizes[0] != sizes[1]:
        raise ImageError(
            f"the {one.role}'s images are {sizes[0]} ({a.name(0)}) and the {other.role}'s {sizes[1]} "
            f"({b.name(0)}); give equal ones"
        )


def _check_same_frames(one: Side, other: Side) -> None:
    numbers = one.sequence.numbers or (), other.sequence.numbers or ()
    differing = set(numbers[0]) ^ set(numbers[1])
    if not differing:
        return
    number = min(differing)
    has, lacks = (one, other) if number in numbers[0] else (other, one)
    name = has.sequence.name((has.sequence.numbers or ()).index(number))
    raise ImageError(
        f"the {has.role}'s run has the frame {number} ({name}), and the {lacks.role}'s "
        f"(first {lacks.sequence.name(0)}) does not: give runs of the same --frames, finish the one that "
        "lacks it, or give patterns of frames that both have"
    )


def note_on_paths(one: Side, other: Side) -> str:
    """Remark on two runs of different camera paths; empty where they are not."""
    paths = [value_at(side.sequence.identity, "path") for side in (one, other)]
    poses, frames = ([value_at(path, key) for path in paths] for key in ("poses", "frames"))
    # Of all frames that were selected, so that those of others can't be compared. That is no reason to refuse
    # them: another host may round the same poses otherwise.
    if None in poses or poses[0] == poses[1] or frames[0] != frames[1]:
        return ""
    return (
        f"camera: {one.source} and {other.source} are of different camera paths (other poses in run.json): "
        "frames of one number may show different views"
    )


def note_on_seeds(one: Side, other: Side) -> str:
    """Remark on runs of one method and seed, whose noise is not independent; else empty."""
    methods, seeds = (
        [value_at(side.sequence.identity, *keys) for side in (one, other)]
        for keys in (("method", "name"), SEED)
    )
    if None in seeds or methods[0] != methods[1] or seeds[0] != seeds[1] or one.source == other.source:
        return ""
    return (
        f"noise: {one.source} and {other.source} are of one method and --seed {seeds[0]}: their noise is "
        "correlated, and they look more alike than they are; render one with another --seed"
    )


def note_on_numbers(one: Side, other: Side) -> str:
    """Remark on frames of different numbers, which are paired in order; empty where there are none."""
    a, b = one.sequence, other.sequence
    if a.numbers is None or b.numbers is None or a.numbers == b.numbers:
        return ""
    pairs = enumerate(zip(a.numbers, b.numbers, strict=True))
    index = next(i for i, (first, second) in pairs if first != second)
    return (
        f"frames: their numbers differ, so they are paired in order: {a.name(index)} with "
        f"{b.name(index)}, and so on"
    )


def common_fps(one: Side, other: Side) -> float | None:
    """Frames per second of both, the other's first; None where neither has its own.

    Raises
    ------
    ImageError
        They differ.
    """
    a, b = one.sequence, other.sequence
    if a.fps and b.fps and abs(a.fps / b.fps - 1.0) > FPS_TOLERANCE:
        raise ImageError(
            f"the {one.role} plays at {a.fps:g} frames per second ({a.name(0)}) and the {other.role} at "
            f"{b.fps:g} ({b.name(0)}); say with --fps at which both are shown"
        )
    return b.fps or a.fps


def common_exposure_ev(one: Side, other: Side) -> float | None:
    """Exposure of both, stops; None where neither is a run that has its own.

    Raises
    ------
    ImageError
        They differ.
    """
    a, b = one.sequence, other.sequence
    if a.exposure_ev is not None and b.exposure_ev is not None and a.exposure_ev != b.exposure_ev:
        raise ImageError(
            f"the {one.role}'s run is shown at {a.exposure_ev:+g} stops ({a.name(0)}) and the "
            f"{other.role}'s at {b.exposure_ev:+g} ({b.name(0)}); say with --exposure-ev at which both are "
            "shown"
        )
    return b.exposure_ev if a.exposure_ev is None else a.exposure_ev


def is_exr(sequence: Sequence) -> bool:
    """Whether the frames are OpenEXR files."""
    return sequence.name(0).lower().endswith(".exr")
