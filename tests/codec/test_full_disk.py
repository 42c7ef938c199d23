"""A disk that is full is told from one that can't be written, and leaves nothing behind."""

import contextlib
import resource

import numpy as np
import pytest

from enfilade.codec import write_arrays, write_exr, write_json
from enfilade.errors import NoSpaceError, RunFolderError

ROOM = 20_000  # bytes that a file may have


@contextlib.contextmanager
def little_room():
    """Let no file grow beyond a bound: what the kernel answers is what a full disk's quota does."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


NOISE = np.random.default_rng(1).random((120, 160, 3), np.float32)


@pytest.mark.parametrize(
    "write",
    [
        lambda file: write_exr(file, {"RGB": NOISE}),
        lambda file: write_arrays(file, {"noise": NOISE}),
        lambda file: write_json(file, NOISE.tolist()),
    ],
    ids=["exr", "arrays", "json"],
)
def test_no_room(tmp_path, write):
    file = tmp_path / "deep" / "file.exr"
    with little_room(), pytest.raises(NoSpaceError, match=r"file\.exr: no room on the disk"):
        write(file)
    assert not list(file.parent.iterdir())
    write(file)
    assert file.stat().st_size > ROOM


def test_what_fails_for_another_reason_is_no_full_disk(tmp_path, monkeypatch):
    def broken(*arguments):
        raise RuntimeError("who knows")

    monkeypatch.setattr("enfilade.codec.exr.OpenEXR.File", broken)
    with pytest.raises(RunFolderError, match="who knows"):
        write_exr(tmp_path / "file.exr", {"RGB": NOISE})
    assert not list(tmp_path.iterdir())
