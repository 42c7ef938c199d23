"""Sequences of images, opened from a folder, a file name pattern, a video or a run."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import fnmatchcase
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

from enfilade.errors import ImageError
from enfilade.files import read_json
from enfilade.images.container import DEMUXERS
from enfilade.images.decode import VideoFile
from enfilade.images.imagefiles import SUFFIXES, ImageFiles
from enfilade.settings import VideoSettings

RUN_FILE, JOB_FILE = "run.json", "job.json"
FRAMES = "frames"  # folder of a run's images
NUMBER_FIELD = re.compile(r"%0?\d*d|#+")  # of a pattern: frame.%04d.exr, frame.####.exr
NUMBER = re.compile(r"(^-?[0-9]+|[0-9]+)")  # in a name; one at the beginning may be negative
MAX_LISTED = 6  # patterns of a folder, in a message

Sequence: TypeAlias = ImageFiles | VideoFile


def open_sequence(source: Path | str, *, layer: str | None = None) -> Sequence:
    """Open an image sequence for reading.

    Parameters
    ----------
    source
        A folder of images of one kind (OpenEXR, PNG, JPEG, TIFF, TGA, WebP, BMP), in natural order of their
        names, which may differ in one number; a run folder, whose frames are read; one image;
        a pattern (``f.%04d.exr``, ``f.####.png``, ``f*.jpg``); or a video.
    layer
        Of OpenEXR files, the layer or part to read; ignored for others.

    Raises
    ------
    ImageError
        There is no such file, no image in the folder, more than one sequence in it, or the first image
        can't be read.
    """
    path = Path(source)
    if path.is_dir():
        return _from_folder(path, layer)
    suffix = path.suffix.lower()
    if path.is_file() and suffix in DEMUXERS:
        return VideoFile(path)
    if path.is_file() and suffix not in SUFFIXES:
        known = ", ".join(sorted({*SUFFIXES, *DEMUXERS}))
        raise ImageError(f"{path}: unknown format {suffix or 'without suffix'}; supported are: {known}")
    files = files_of(path)
    if not files:
        raise ImageError(f"there is no file, folder or pattern with files {path}")
    _check_one_kind(path, files)
    return _of_run(files, None if path.is_file() else _numbers(files), layer)


def files_of(source: Path | str) -> list[Path]:
    """Files that :func:`open_sequence` would read, found by name without opening any; may be none."""
    path = Path(source)
    if path.is_dir():
        folder = _image_folder(path)
        # The frames of a run are OpenEXR files; a heatmap may be written beside them.
        return _images(folder.glob("*.exr" if (_home(folder) / RUN_FILE).is_file() else "*"))
    if path.is_file():
        return [path]
    if not path.parent.is_dir():
        return []
    if NUMBER_FIELD.search(path.name):
        wanted = re.compile(r"(-?\d+)".join(map(re.escape, NUMBER_FIELD.split(path.name))))
        return _images(f for f in path.parent.iterdir() if wanted.fullmatch(f.name))
    return _images(f for f in path.parent.iterdir() if fnmatchcase(f.name, path.name))


def _image_folder(folder: Path) -> Path:
    """The folder of the images: a run keeps its frames in a subfolder."""
    return folder / FRAMES if (folder / RUN_FILE).is_file() else folder


def _home(images: Path) -> Path:
    """The folder of the run, if the images of a folder are of one."""
    images = images.absolute()
    return images.parent if images.name == FRAMES else images


def _from_folder(folder: Path, layer: str | None) -> ImageFiles:
    files = files_of(folder)
    if not files:
        raise ImageError(f"{_image_folder(folder)} has no images of {', '.join(sorted(SUFFIXES))} in it")
    _check_one_sequence(files)
    return _of_run(files, _numbers(files), layer)


def _of_run(files: list[Path], numbers: tuple[int, ...] | None, layer: str | None) -> ImageFiles:
    """Images with the frame rate, exposure, shots and identity of their run, if they are of one."""
    home = _home(files[0].parent)
    run, job_file = home / RUN_FILE, home / JOB_FILE
    identity = value_at(read_json(run), "identity") if run.is_file() else None
    job = read_json(job_file) if run.is_file() and job_file.is_file() else None
    return ImageFiles(
        files,
        fps=value_at(identity, "path", "fps"),
        exposure_ev=value_at(job, "settings", "viewing", "exposure_ev"),
        numbers=numbers,
        starts=None if numbers is None else _starts(numbers, value_at(identity, "path")),
        identity=None if numbers is None else identity,
        view=_view(job),
        layer=layer,
    )


def _check_one_sequence(files: list[Path]) -> None:
    folder, column = files[0].parent, _number_column(files)
    patterns = sorted({_pattern(file, column) for file in files})
    if len(patterns) > 1:
        listed = ", ".join(patterns[:MAX_LISTED]) + (", ..." if len(patterns) > MAX_LISTED else "")
        raise ImageError(
            f"{folder} has images whose names differ in more than a number ({listed}); give a pattern of one "
            f"sequence, such as {folder}/{patterns[0]} or {folder}/*{files[0].suffix}"
        )


def _check_one_kind(pattern: Path, files: list[Path]) -> None:
    kinds = {file.suffix.lower() == ".exr": file.name for file in files}
    if len(kinds) > 1:
        raise ImageError(
            f"{pattern} matches OpenEXR files ({kinds[True]}) and others ({kinds[False]}), which are not one "
            "sequence; give a pattern with the suffix of one kind"
        )


def _images(files: Iterable[Path]) -> list[Path]:
    chosen = [f for f in files if f.suffix.lower() in SUFFIXES and not f.name.startswith(".") and f.is_file()]
    return sorted(chosen, key=_natural)


def _natural(file: Path) -> tuple[list[int | str], str]:
    """Sort key with numbers by value."""
    return [int(p) if index % 2 else p.lower() for index, p in enumerate(_parts(file))], file.name


def _parts(file: Path) -> list[str]:
    """Text and numbers of a name in turn, beginning and ending with text."""
    return NUMBER.split(file.stem)


def _number_column(files: list[Path]) -> int:
    """Index in the parts of the one number that varies between the names; else of the last number."""
    names = [_parts(file) for file in files]
    if len({len(parts) for parts in names}) == 1:
        varying = [column for column, values in enumerate(zip(*names, strict=True)) if len(set(values)) > 1]
        if len(varying) == 1 and varying[0] % 2:
            return varying[0]
    return -2


def _pattern(file: Path, column: int) -> str:
    parts = _parts(file)
    if len(parts) > 1:
        parts[column] = "#"
    return "".join(parts) + file.suffix


def _numbers(files: list[Path]) -> tuple[int, ...] | None:
    """Numbers of the frames by their names; None unless all have one and they rise."""
    column = _number_column(files)
    found = tuple(int(parts[column]) for parts in map(_parts, files) if len(parts) > 1)
    rises = len(found) == len(files) and all(before < now for before, now in pairwise(found))
    return found if rises else None


def _starts(numbers: tuple[int, ...], path: Any) -> frozenset[int] | None:
    """Indices of a run's finished frames that begin a shot or follow an unfinished frame."""
    selected, cuts = value_at(path, "frames"), value_at(path, "cuts")
    if selected is None or cuts is None:
        return None
    following = dict(pairwise(selected))
    steps = enumerate(pairwise(numbers), 1)
    return frozenset(i for i, (before, now) in steps if following.get(before) != now or now in cuts)


def _view(job: Any) -> VideoSettings | None:
    """The view transform of a run's video, by its job."""
    table = {name: value_at(job, "settings", "video", name) for name in ("ocio", "view", "look", "display")}
    known = {name: value for name, value in table.items() if isinstance(value, str)}
    return VideoSettings.from_table(known) if known else None


def value_at(table: Any, *keys: str) -> Any:
    """A value of nested tables; None where there is none."""
    for key in keys:
        table = table.get(key) if isinstance(table, dict) else None
    return table
