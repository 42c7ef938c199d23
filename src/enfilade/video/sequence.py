"""A sequence of images, wherever it comes from: a folder, a pattern, a video, a run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

from enfilade.codec import read_json
from enfilade.errors import ImageError
from enfilade.records import F32
from enfilade.video.decode import DEMUXERS, VideoFile
from enfilade.video.images import SUFFIXES, ImageFiles

__all__ = ["Sequence", "open_sequence"]

NUMBER_FIELD = re.compile(r"%0?\d*d|#+")  # of a pattern: frame.%04d.exr, frame.####.exr


class Sequence(Protocol):
    """Images of one size, in order, read one at a time: memory doesn't grow with their number."""

    width: int
    height: int
    fps: float | None
    exposure_ev: float | None  # of a run, whose frames are scene-linear
    numbers: tuple[int, ...] | None  # by which the user knows the frames, rising
    starts: frozenset[int] | None  # of a run: indices of frames that do not follow the one before

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


def open_sequence(source: Path | str) -> Sequence:
    """Open an image sequence to be read.

    Parameters
    ----------
    source
        A folder of images of one kind (OpenEXR, PNG, JPEG), in natural order of their names; a run folder,
        of which the finished frames are taken; one image; a pattern (``f.%04d.exr``, ``f.####.png``,
        ``f*.jpg``); or a video.

    Returns
    -------
    Sequence

    Raises
    ------
    ImageError
        There is no such file, no image in the folder, or the first one can't be read.
    """
    path = Path(source)
    if path.is_dir():
        return _from_folder(path)
    if path.is_file():
        suffix = path.suffix.lower()
        if suffix in DEMUXERS:
            return VideoFile(path)
        if suffix in SUFFIXES:
            return ImageFiles([path])
        known = ", ".join(sorted(SUFFIXES | set(DEMUXERS)))
        raise ImageError(f"{path}: can't tell what a {suffix or 'file without suffix'} is; read are: {known}")
    files = _matching(path)
    if not files:
        raise ImageError(f"there is no file, folder or pattern with files {path}")
    return ImageFiles(files, numbers=_numbers(files))


def _from_folder(folder: Path) -> ImageFiles:
    run = folder / "run.json"
    identity = read_json(run) if run.is_file() else None
    place = folder / "frames" if run.is_file() else folder
    files = _images(place.iterdir()) if place.is_dir() else []
    if not files:
        raise ImageError(f"{place} has no images in it; read are: {', '.join(sorted(SUFFIXES))}")
    kinds = {file.suffix.lower() for file in files}
    if len(kinds) > 1:
        raise ImageError(
            f"{place} has images of several kinds ({', '.join(sorted(kinds))}); give a pattern such as "
            f"{place}/*{min(kinds)}"
        )
    numbers = _numbers(files)
    fps = _number_at(identity, "identity", "path", "fps")
    return ImageFiles(
        files,
        fps if fps is not None and fps > 0 else None,
        _number_at(identity, "identity", "settings", "viewing", "exposure_ev"),
        numbers=numbers,
        starts=None if numbers is None else _starts(numbers, _at(identity, "identity", "path")),
    )


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
    """Last number of each name; None unless all have one and they rise."""
    found = [re.findall(r"^-?\d+|\d+", file.stem) for file in files]
    numbers = tuple(int(of_name[-1]) for of_name in found if of_name)
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
