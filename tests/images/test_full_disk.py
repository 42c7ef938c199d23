"""A disk that is full is told from one that can't be written, and leaves nothing behind."""

import contextlib
import resource

import numpy as np
import pytest

from enfilade.errors import NoSpaceError
from enfilade.files import write_json
from enfilade.images import write_arrays, write_exr

ROOM = 20_000  # bytes that a file may have


@contextlib.contextmanager
def little_room(size=ROOM):
    """Let no file grow beyond a bound: what the kernel answers is what a full disk's quota does."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
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


@pytest.mark.parametrize("is_portable", [False, True])
def test_wherever_the_disk_ends_images_are_whole_or_not_there(tmp_path, is_portable):
    # so small that OpenEXR would write all of it when it closes the file, where it can't fail
    file, layers = tmp_path / "file.exr", {"RGB": NOISE[:8, :8]}
    write_exr(file, layers, is_portable=is_portable)
    size = file.stat().st_size
    file.unlink()
    for room in range(0, size, 5):
        with little_room(room), pytest.raises(NoSpaceError, match="no room on the disk"):
            write_exr(file, layers, is_portable=is_portable)
        assert not list(tmp_path.iterdir())
    with little_room(size):
        write_exr(file, layers, is_portable=is_portable)
    assert file.stat().st_size == size
