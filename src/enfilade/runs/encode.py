"""The video of a run encoded once more: with another exposure, view, codec or quality."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from enfilade.camera.frames import ranges
from enfilade.errors import RunFolderError, SettingsError, UnfinishedError
from enfilade.images import check_encodable, encode_video, video_suffix
from enfilade.images.codecs import odd_size_note
from enfilade.methods.base import FRAMES
from enfilade.monitor import Monitor
from enfilade.records import F32
from enfilade.runs.delivery import images_of
from enfilade.runs.folder import RunFolder
from enfilade.runs.job import read_job
from enfilade.runs.scheduler import shortened
from enfilade.settings import VideoSettings, ViewingSettings

STEM = "encoded"  # of the video where none is given


def encode(
    folder: Path,
    changes: Mapping[str, Mapping[str, Any]],
    monitor: Monitor,
    *,
    file: Path | None = None,
    is_partial: bool = False,
    is_replaced: bool = False,
) -> Path:
    """Encode the frames of a run, which stays as it is. Nothing is rendered.

    Parameters
    ----------
    folder
        The run; it may be running.
    changes
        Settings that differ from those of the run: of ``video``, and the exposure of ``viewing``. With
        another ``ocio``, view, look and display of the run are dropped, with another ``view`` the look.
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
        A frame is missing or damaged.
    SettingsError
        A view, a quality or a size that can't be encoded, or a file of another suffix.
    UnfinishedError
        Frames are not finished.
    """
    run, job = RunFolder.read(folder), read_job(folder)
    path = job.path
    video = _video(job.settings[VideoSettings], changes.get("video", {}))
    viewing = job.settings[ViewingSettings].to_table() | dict(changes.get("viewing", {}))
    exposure_ev = ViewingSettings.from_table(viewing).exposure_ev
    check_encodable(video, fps=path.fps, width=path.width, height=path.height, exposure_ev=exposure_ev)
    suffix = video_suffix(video.codec)
    file = folder / f"{STEM}{suffix}" if file is None else file
    _check_free(run, file, suffix, is_replaced=is_replaced)
    numbers = _finished(run, path.numbers, is_partial=is_partial)
    if note := odd_size_note(video.codec, path.width, path.height):
        monitor.message(note)
    encode_video(
        file,
        _images(run, numbers, monitor),
        fps=path.fps,
        width=path.width,
        height=path.height,
        settings=video,
        exposure_ev=exposure_ev,
    )
    return file


def _video(own: VideoSettings, changes: Mapping[str, Any]) -> VideoSettings:
    table = own.to_table()
    if changes.get("ocio", own.ocio) != own.ocio:
        del table["view"], table["look"], table["display"]
    elif changes.get("view", own.view) != own.view:
        del table["look"]
    return VideoSettings.from_table(table | dict(changes))


def _check_free(run: RunFolder, file: Path, suffix: str, *, is_replaced: bool) -> None:
    if file.suffix != suffix:
        raise SettingsError(
            f"{file}: files of this codec end in {suffix}; name it so, or choose another codec"
        )
    folder, place = run.folder.resolve(), file.resolve()
    own = {(folder / name).resolve() for line in run.lines() for name in line["files"]}
    if place in own or place == folder / f"video{suffix}" or place.parent == folder / "clips":
        raise RunFolderError(f"{file} is the run's own, which stays as it is; choose another --out")
    if file.exists() and not is_replaced:
        raise RunFolderError(f"{file} is there already; choose another --out, or add --overwrite")


def _finished(run: RunFolder, numbers: Sequence[int], *, is_partial: bool) -> list[int]:
    there = [number for number in numbers if run.line(FRAMES, number) is not None]
    if len(there) == len(numbers) or (there and is_partial):
        return there
    missing = sorted(set(numbers) - set(there))
    advice = f"`enfilade work {shlex.quote(str(run.folder))}` renders the rest"
    advice += ", --unfinished encodes those that are there" if there else ""
    listed = shortened(ranges(missing).split(","))
    raise UnfinishedError(
        f"{run.folder} has {len(there)} of {len(numbers)} frames, {listed} are missing; {advice}",
        tuple(f"{FRAMES} {number}" for number in missing),
    )


def _images(run: RunFolder, numbers: Sequence[int], monitor: Monitor) -> Iterator[F32]:
    for count, image in enumerate(images_of(run, numbers), 1):
        yield image
        monitor.progress("video", count, len(numbers))
