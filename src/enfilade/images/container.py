"""Video files opened with FFmpeg for reading and for writing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import av

from enfilade.errors import ImageError, RunFolderError
from enfilade.files import is_full, unwritable, whole_file

# The demuxer is chosen by suffix: FFmpeg would otherwise detect it, and a playlist opens other files.
DEMUXERS = {
    ".mp4": "mov", ".m4v": "mov", ".mov": "mov", ".mkv": "matroska", ".webm": "matroska", ".avi": "avi",
    ".y4m": "yuv4mpegpipe",
}  # fmt: skip


def open_container(file: Path, options: dict[str, str] | None = None) -> Any:
    """Open a video file of a suffix in :data:`DEMUXERS` for reading, inside :func:`reading`."""
    demuxer = DEMUXERS[file.suffix.lower()]
    return av.open(_name(file), format=demuxer, options=options or {}, metadata_errors="replace")


@contextmanager
def reading(file: Path, remedy: str = "write or copy it again") -> Iterator[None]:
    """Raise errors of FFmpeg as an ImageError that names the file, the reason and the remedy."""
    try:
        yield
    except (av.FFmpegError, OSError) as error:
        raise ImageError(f"can't decode {file}: {error.strerror or error}; {remedy}") from error


@contextmanager
def written_container(file: Path) -> Iterator[Any]:
    """Write a video file as :func:`~enfilade.files.whole_file` does; its suffix determines the container."""
    # bitexact: Matroska would otherwise contain a random number, MP4 the version of the muxer
    options = {"fflags": "+bitexact"}
    if DEMUXERS[file.suffix.lower()] == "mov":
        options["movflags"] = "+faststart+write_colr"
    with whole_file(file) as temporary:
        temporary.touch()
        try:
            with av.open(_name(temporary), "w", container_options=options) as container:
                yield container
        except MemoryError:  # one of FFmpeg's errors, too
            raise
        except av.FFmpegError as error:
            reason = OSError(error.errno, error.strerror)
            if is_full(reason):
                raise unwritable(file, reason) from error
            raise RunFolderError(f"can't write {file}: {error}; choose another folder or codec") from error


def _name(file: Path) -> str:
    # absolute: FFmpeg takes the part of a relative name before a colon as a protocol
    return str(file.absolute())
