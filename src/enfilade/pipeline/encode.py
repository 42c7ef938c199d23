"""The video of a run once more: its finished frames with another exposure, view, codec or quality."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from enfilade.errors import RunFolderError, SettingsError, UnfinishedError
from enfilade.images import check_encodable, encode_video, read_exr, video_suffix
from enfilade.images.codecs import odd_size_note
from enfilade.monitor import Monitor
from enfilade.pipeline.job import Job
from enfilade.records import F32
from enfilade.settings import VideoSettings, ViewingSettings
from enfilade.store import Run

NAME = "encoded"  # of the video where none is given
OWN = "video"  # ... and of the run's
SHOWN_RANGES = 5  # of missing frames in a message


def encode(
    folder: Path,
    changes: Mapping[str, Mapping[str, Any]],
    monitor: Monitor,
    *,
    file: Path | None = None,
    is_partial: bool = False,
    is_replaced: bool = False,
) -> Path:
    """Encode the frames of a run, which stays what it is. Nothing is rendered.

    Parameters
    ----------
    folder
        The run; it may be running.
    changes
        Tables of settings that are not those of the run: of ``video``, and of ``viewing`` the exposure, whose
        other settings say nothing here. With another ``ocio``, view and display of the run are left.
    monitor
    file
        The video; by default ``encoded`` with the codec's suffix, in the run folder.
    is_partial
        Leave out frames that are not finished.
    is_replaced
        Replace a file that is there; never one of the run's own.

    Returns
    -------
    Path
        The video.

    Raises
    ------
    RunFolderError
        It is no run, the file is there, or it can't be written.
    DamagedFileError
        A frame is missing or isn't what was written.
    SettingsError
        A view, a quality or a size that can't be encoded, or a file of another suffix.
    UnfinishedError
        Frames are not finished.
    """
    run = Run.existing(folder)
    try:
        path, settings = run.identity["path"], run.identity.get("settings", {})
        (width, height), fps, frames = path["size"], path["fps"], path["frames"]
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(f"{folder} can't be encoded: its run.json is of another version") from error
    video = _video(_known(settings.get("video", {})), changes.get("video", {}))
    exposure_ev = _exposure_ev(settings.get("viewing", {}), changes.get("viewing", {}))
    check_encodable(video, width=width, height=height, exposure_ev=exposure_ev)
    suffix = video_suffix(video.codec)
    file = folder / f"{NAME}{suffix}" if file is None else file
    _check_free(run, file, suffix, is_replaced=is_replaced)
    numbers = _finished(run, frames, is_partial=is_partial)
    if note := odd_size_note(video.codec, width, height):
        monitor.say(note)
    monitor.stage("video", len(numbers))
    encode_video(
        file,
        _images(run, numbers, monitor),
        fps=fps,
        width=width,
        height=height,
        settings=video,
        exposure_ev=exposure_ev,
    )
    return file


def encode_instead(job: Job, folder: Path, keys: Sequence[str]) -> str:
    """Say how to encode the frames of another run as a job asks, where they differ in nothing else.

    Parameters
    ----------
    job
    folder
        The other run's.
    keys
        In which its identity differs, such as ``settings.video.codec``.

    Returns
    -------
    str
        A line; empty where something else differs.
    """
    if not all(is_of_video(key) or key == "settings.viewing.exposure_ev" for key in keys):
        return ""
    tables, words = job.settings.to_tables(), ["enfilade", "encode", str(folder)]
    for key in keys:
        if key.startswith("settings."):
            _, section, name = key.split(".")
            words += [f"--{section}-{name}".replace("_", "-"), str(tables[section][name])]
    return f"To encode its frames so, without rendering: `{shlex.join(words)}`\n"


def is_of_video(key: str) -> bool:
    """Whether a key of a run's identity is about its video alone."""
    return key.startswith(("settings.video.", "view.")) or key in ("versions.opencolorio", "versions.av")


def _known(table: Mapping[str, Any]) -> dict[str, Any]:
    """What this version knows of a run's settings of the video, which another may have made."""
    names = {f.name for f in fields(VideoSettings)}
    return {name: value for name, value in table.items() if name in names}


def _video(own: Mapping[str, Any], changes: Mapping[str, Any]) -> VideoSettings:
    if changes.get("ocio", own.get("ocio")) != own.get("ocio"):
        own = {name: value for name, value in own.items() if name not in ("view", "display")}
    return VideoSettings.from_table({**own, **changes})


def _exposure_ev(own: Mapping[str, Any], changes: Mapping[str, Any]) -> float:
    tables = {**own, **changes}
    return ViewingSettings.from_table({k: v for k, v in tables.items() if k == "exposure_ev"}).exposure_ev


def _check_free(run: Run, file: Path, suffix: str, *, is_replaced: bool) -> None:
    if file.suffix != suffix:
        raise SettingsError(f"{file}: files of this codec end in {suffix}; name it so, or choose another")
    folder, place = run.folder.resolve(), file.resolve()
    is_own = (place.parent == folder and place.stem == OWN) or place.parent == folder / "clips"
    if is_own or any(place == folder / name for line in run.lines() for name in line["files"]):
        raise RunFolderError(f"{file} is the run's own, which stays as it is; choose another --out")
    if file.exists() and not is_replaced:
        raise RunFolderError(f"{file} is there already; choose another --out, or add --overwrite")


def _finished(run: Run, numbers: Sequence[int], *, is_partial: bool) -> list[int]:
    there = [number for number in numbers if run.done(f"frame {number}") is not None]
    if len(there) == len(numbers) or (there and is_partial):
        return there
    missing = [number for number in numbers if number not in set(there)]
    advice = f"`enfilade work {shlex.quote(str(run.folder))}` makes the rest"
    advice += ", --unfinished encodes those that are there" if there else ""
    raise UnfinishedError(
        f"{run.folder} has {len(there)} of {len(numbers)} frames, {_ranges(missing)} are missing; {advice}",
        tuple(f"frame {number}" for number in missing),
    )


def _ranges(numbers: Sequence[int]) -> str:
    """Rising numbers as ``1-3, 7``."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    shown = [str(a) if a == b else f"{a}-{b}" for a, b in spans[:SHOWN_RANGES]]
    more = len(numbers) - sum(b - a + 1 for a, b in spans[:SHOWN_RANGES])
    return ", ".join(shown) + (f" and {more} more" if more else "")


def _images(run: Run, numbers: Sequence[int], monitor: Monitor) -> Iterator[F32]:
    for number in numbers:
        file = run.file("frames", number)
        run.check(file)
        yield read_exr(file)["RGB"].astype(np.float32)
        monitor.advance()
