"""A sequence of images, wherever it comes from: a folder, a pattern, a video, a run."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

from enfilade.errors import ImageError
from enfilade.files import read_json
from enfilade.images.decode import DEMUXERS, VideoFile
from enfilade.images.stored import SUFFIXES, ImageFiles
from enfilade.records import F32

__all__ = ["Sequence", "files_of", "open_sequence"]

RUN_FILE = "run.json"
NUMBER_FIELD = re.compile(r"%0?\d*d|#+")  # of a pattern: frame.%04d.exr, frame.####.exr
NUMBER = re.compile(r"^-?\d+|\d+")  # in a name; one that begins it may be negative
MOST_LISTED = 6  # patterns of a folder, in a message


class Sequence(Protocol):
    """Images of one size, in order, read one at a time: memory doesn't grow with their number."""

    width: int
    height: int
    fps: float | None
    exposure_ev: float | None  # of a run, whose frames are scene-linear
    numbers: tuple[int, ...] | None  # by which the user knows the frames, rising
    starts: frozenset[int] | None  # of a run: indices of frames that do not follow the one before
    note: str  # what to know of how it is read; empty where there is nothing

    def __len__(self) -> int:
        """Count the frames."""
        ...

    def __iter__(self) -> Iterator[F32]:
        """Frames as (H, W, 3) float32 linear Rec.709; a second iteration begins anew.

        Raises ``ImageError``, naming the frame, where one can't be read or has another size.
        """
        ...

    def name(self, index: int) -> str:
        """Name of a frame, for messages."""
        ...

    def layers(self, index: int) -> dict[str, Any]:
        """All layers of an OpenEXR frame; ``ImageError`` for anything else."""
        ...


def open_sequence(source: Path | str, *, layer: str | None = None) -> Sequence:
    """Open an image sequence to be read.

    Parameters
    ----------
    source
        A folder of images of one kind (OpenEXR, PNG, JPEG, TIFF, TGA, WebP, BMP, PPM), in natural order of
        their names, which may differ in one number; a run folder, of which the finished frames are taken;
        one image; a pattern (``f.%04d.exr``, ``f.####.png``, ``f*.jpg``); or a video.
    layer
        Of OpenEXR files, the layer or part that is the picture; of others it says nothing.

    Returns
    -------
    Sequence

    Raises
    ------
    ImageError
        There is no such file, no image in the folder, more than one sequence in it, or the first image
        can't be read.
    """
    path = Path(source)
    if path.is_dir():
        return _from_folder(path, layer)
    if path.is_file():
        suffix = path.suffix.lower()
        if suffix in DEMUXERS:
            return VideoFile(path)
        if suffix in SUFFIXES:
            return ImageFiles([path], layer=layer)
        known = ", ".join(sorted(SUFFIXES | set(DEMUXERS)))
        raise ImageError(f"{path}: can't tell what a {suffix or 'file without suffix'} is; read are: {known}")
    files = _matching(path)
    if not files:
        raise ImageError(f"there is no file, folder or pattern with files {path}")
    return ImageFiles(files, numbers=_numbers(files), layer=layer)


def files_of(source: Path | str) -> list[Path]:
    """Files from which :func:`open_sequence` takes the frames, by their names alone: none is opened.

    Parameters
    ----------
    source
        See there. Where it leads to nothing, there are no files.
    """
    path = Path(source)
    if path.is_dir():
        place = _place(path)
        return _images(place.iterdir()) if place.is_dir() else []
    return [path] if path.is_file() else _matching(path)


def _place(folder: Path) -> Path:
    """Where a folder has its frames: a run keeps them in one of its own."""
    return folder / "frames" if (folder / RUN_FILE).is_file() else folder


def _from_folder(folder: Path, layer: str | None) -> ImageFiles:
    run, place, files = folder / RUN_FILE, _place(folder), files_of(folder)
    identity = read_json(run) if run.is_file() else None
    if not files:
        raise ImageError(f"{place} has no images in it; read are: {', '.join(sorted(SUFFIXES))}")
    _check_one_sequence(place, files)
    numbers = _numbers(files)
    fps = _number_at(identity, "identity", "path", "fps")
    return ImageFiles(
        files,
        fps if fps is not None and fps > 0 else None,
        _number_at(identity, "identity", "settings", "viewing", "exposure_ev"),
        numbers=numbers,
        starts=None if numbers is None else _starts(numbers, _at(identity, "identity", "path")),
        layer=layer,
    )


def _check_one_sequence(folder: Path, files: list[Path]) -> None:
    kinds = {file.suffix.lower() for file in files}
    if len(kinds) > 1:
        raise ImageError(
            f"{folder} has images of several kinds ({', '.join(sorted(kinds))}); give a pattern such as "
            f"{folder}/*{min(kinds)}"
        )
    patterns = _patterns(files)
    if len(patterns) > 1:
        listed = [f"{pattern} ({count})" for pattern, count in patterns.most_common(MOST_LISTED)]
        more = f" and {len(patterns) - MOST_LISTED} more" if len(patterns) > MOST_LISTED else ""
        raise ImageError(
            f"{folder} has images whose names differ in more than a number: {', '.join(listed)}{more}; give "
            f"one pattern, such as {folder}/{max(patterns, key=lambda p: patterns[p])}, or "
            f"{folder}/*{min(kinds)} for all of them as one sequence"
        )


def _patterns(files: list[Path]) -> Counter[str]:
    """Files by their names with the number that counts as #; one pattern where only one number varies."""
    column = _column(files)
    names: dict[tuple[str, ...], str] = {}
    counts: Counter[str] = Counter()
    for file in files:
        found = list(NUMBER.finditer(file.stem))
        chosen = found[-1 if column is None else column] if found else None
        begin, end = chosen.span() if chosen else (len(file.stem), len(file.stem))
        around = file.stem[:begin], file.stem[end:], "#" if chosen else "", file.suffix.lower()
        digits = "#" * len(file.stem[begin:end].lstrip("-"))
        counts[names.setdefault(around, f"{file.stem[:begin]}{digits}{file.stem[end:]}{file.suffix}")] += 1
    return counts


def _column(files: list[Path]) -> int | None:
    """Which number of the names varies, from 0; None where none, several or anything else does."""
    if len({tuple(NUMBER.split(file.stem)) for file in files}) > 1:
        return None
    columns = enumerate(zip(*(NUMBER.findall(file.stem) for file in files), strict=True))
    varying = [column for column, numbers in columns if len(set(numbers)) > 1]
    return varying[0] if len(varying) == 1 else None


def _matching(pattern: Path) -> list[Path]:
    name = pattern.name
    if not pattern.parent.is_dir():
        return []
    if NUMBER_FIELD.search(name):
        parts = [re.escape(part) for part in NUMBER_FIELD.split(name)]
        wanted = re.compile(r"(-?\d+)".join(parts))
        return _images(f for f in pattern.parent.iterdir() if wanted.fullmatch(f.name))
    return _images(pattern.parent.glob(name)) if any(c in name for c in "*?[") else []


def _images(files: Iterator[Path]) -> list[Path]:
    chosen = [f for f in files if f.suffix.lower() in SUFFIXES and not f.name.startswith(".") and f.is_file()]
    return sorted(chosen, key=_natural)


def _natural(file: Path) -> tuple[list[tuple[int, int, str]], str]:
    # numbers by value; one that begins the name may be negative
    parts = re.findall(r"^-?\d+|\d+|\D+", file.stem)
    key = [(0, int(p), "") if p.lstrip("-").isdecimal() else (1, 0, p.lower()) for p in parts]
    return key, file.name


def _numbers(files: list[Path]) -> tuple[int, ...] | None:
    """The number that varies in the names, else the last; None unless all have one and they rise."""
    column = _column(files)
    found = [NUMBER.findall(file.stem) for file in files]
    numbers = tuple(int(of_name[-1 if column is None else column]) for of_name in found if of_name)
    rises = len(numbers) == len(files) and all(before < now for before, now in pairwise(numbers))
    return numbers if rises else None


def _starts(numbers: tuple[int, ...], path: Any) -> frozenset[int] | None:
    """Where a run's finished frames begin a shot, or follow one that is not finished."""
    selected, cuts = _at(path, "frames"), _at(path, "cuts")
    if not (_are_whole(selected) and _are_whole(cuts)):
        return None
    following = dict(pairwise(selected))
    steps = enumerate(pairwise(numbers), 1)
    return frozenset(i for i, (before, now) in steps if following.get(before) != now or now in cuts)


def _are_whole(values: Any) -> bool:
    return isinstance(values, list) and all(isinstance(value, int) for value in values)


def _number_at(value: Any, *keys: str) -> float | None:
    found = _at(value, *keys)
    return float(found) if isinstance(found, int | float) else None


def _at(value: Any, *keys: str) -> Any:
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value
