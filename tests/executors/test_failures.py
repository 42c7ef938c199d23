"""What an exception means: what may pass is tried again, what would be the same again is not."""

import errno
from pathlib import Path

import pytest

from enfilade.errors import DeviceError, ImageError, NoSpaceError, RunFolderError
from enfilade.executors import Failure, FailureKind
from enfilade.files import read_json, write_json
from enfilade.store.checksum import checksum
from toy_worker import unit


def raised(error, cause):
    try:
        raise error from cause
    except type(error) as seen:
        return seen


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.EAGAIN, errno.ENOTCONN])
@pytest.mark.parametrize("kind", [RunFolderError, ImageError])
def test_a_disk_that_did_not_answer_may_answer_next_time(number, kind):
    failure = Failure.of(raised(kind("can't read it"), OSError(number, "it said so")))
    assert failure.kind is FailureKind.IO
    assert Failure.of(OSError(number, "it said so")).kind is FailureKind.IO
    assert Failure.from_json(failure.to_json()).kind is FailureKind.IO
    deep = raised(kind("the scene"), raised(kind("can't read it"), OSError(number, "it said so")))
    assert Failure.of(deep).kind is FailureKind.IO


@pytest.mark.parametrize(
    "number", [errno.ENOENT, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, None]
)
def test_what_is_forbidden_or_missing_stays_so(number):
    cause = OSError("no image") if number is None else OSError(number, "it said so")
    assert Failure.of(raised(RunFolderError("can't read it"), cause)).kind is FailureKind.REFUSED
    assert Failure.of(cause).kind is FailureKind.ERROR
    assert Failure.of(RunFolderError("another run")).kind is FailureKind.REFUSED


def test_others_have_their_own_way():
    full = raised(NoSpaceError("no room"), OSError(errno.ENOSPC, "No space left on device"))
    assert Failure.of(full).kind is FailureKind.SPACE
    assert Failure.of(OSError(errno.ENOMEM, "Cannot allocate memory")).kind is FailureKind.MEMORY
    failure = Failure.of(DeviceError("no GPU"))
    assert failure.kind is FailureKind.DEVICE
    assert isinstance(Failure.from_json(failure.to_json()).error, DeviceError)


@pytest.fixture
def stale(monkeypatch):
    """Have no file be opened: its server has forgotten it."""

    def refuse(*_, **__):
        raise OSError(errno.ESTALE, "Stale file handle")

    monkeypatch.setattr(Path, "open", refuse)


@pytest.mark.parametrize("act", [checksum, read_json, lambda file: write_json(file, {})])
def test_our_own_files(tmp_path, stale, act):
    with pytest.raises(RunFolderError, match="Stale file handle") as seen:
        act(tmp_path / "file.json")
    assert Failure.of(seen.value).kind is FailureKind.IO
    assert "make room" not in str(seen.value)


@pytest.mark.parametrize("name", ["in-process", "processes"])
def test_one_bad_moment_of_a_disk_ends_nothing(work, name):
    ending, _, failures = work(name, [unit("s", "stale", times=1), unit("a"), unit("b", needs=("s",))])
    assert ending.stopped is None
    assert not ending.aside
    assert [failure[:3] for failure in failures] == [("s", FailureKind.IO, 1)]
    assert (work.folder / "b").exists()


def test_a_device_that_one_worker_does_not_find_ends_nothing(work):
    ending, _, _ = work("processes", [unit("d", "deviceless", times=1), unit("a")], workers=1)
    assert ending.stopped is None
    assert (work.folder / "d").exists()


def test_a_device_that_no_worker_finds_ends_it(work):
    ending, _, failures = work("processes", [unit("d", "deviceless"), unit("e", "deviceless")])
    assert isinstance(ending.stopped.error, DeviceError)
    assert len(failures) == 1


def test_where_the_device_has_worked_it_is_the_unit(work):
    units = [unit("a"), unit("d", "deviceless", needs=("a",))]
    ending, _, _ = work("processes", units)
    assert ending.stopped is None
    assert [aside.name for aside, _ in ending.aside] == ["d"]


def test_a_disk_that_has_a_bad_moment_when_a_worker_is_begun(work, monkeypatch):
    really, errors = Path.open, [OSError(errno.ETIMEDOUT, "Connection timed out")]

    def once(self, *how, **more):
        if self.name.startswith("worker-") and errors:
            raise errors.pop()
        return really(self, *how, **more)

    monkeypatch.setattr(Path, "open", once)
    ending, _, failures = work("processes", [unit("a")], workers=1)
    assert not ending.aside
    assert failures[0][1] is FailureKind.IO
    assert (work.folder / "a").exists()


def test_too_little_memory_is_told_also_while_a_kernel_is_recorded():
    """Dr.Jit says so in the cause alone."""
    recording = RuntimeError("record(): error encountered while recording a frozen function (see above).")
    assert Failure.of(recording).kind is FailureKind.ERROR
    for words in ("jit_malloc(): out of memory!", "Tried to free the allocation cache while recording"):
        error = RuntimeError(str(recording))
        error.__cause__ = RuntimeError(words)
        assert Failure.of(error).kind is FailureKind.MEMORY
