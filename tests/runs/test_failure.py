"""The classes of failures."""

from __future__ import annotations

import errno
import pickle

import pytest

from enfilade.errors import (
    DamagedFileError,
    DeviceError,
    ImageError,
    NoSpaceError,
    RunFolderError,
    SettingsError,
)
from enfilade.runs.failure import Failure, FailureKind


def raised(error, cause):
    try:
        raise error from cause
    except type(error) as seen:
        return seen


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.ENOTCONN])
def test_a_disk_that_did_not_answer_may_answer_the_next_time(number):
    cause = OSError(number, "no answer")
    for error in (
        cause,
        raised(RunFolderError("can't read it"), cause),
        raised(ImageError("no image"), cause),
    ):
        assert Failure.of(error).kind is FailureKind.ERROR


@pytest.mark.parametrize("number", [errno.ENOENT, errno.EACCES, errno.EROFS, errno.EISDIR, None])
def test_missing_and_forbidden_files_stay_so(number):
    cause = OSError("no image") if number is None else OSError(number, "no")
    failure = Failure.of(raised(RunFolderError("can't read it"), cause))
    assert failure.kind is FailureKind.FATAL
    assert isinstance(failure.error, RunFolderError)
    assert Failure.of(cause).kind is FailureKind.ERROR


@pytest.mark.parametrize("error", [SettingsError("no"), DeviceError("no GPU"), NoSpaceError("no room")])
def test_errors_of_the_input_and_full_disks_end_the_run(error):
    assert Failure.of(error).kind is FailureKind.FATAL
    assert Failure.of(error).error is error


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("jit_malloc(): out of memory!"),
        raised(RuntimeError("error encountered while recording"), RuntimeError("Tried to free the allocation cache")),
        raised(RunFolderError("can't read it"), MemoryError()),
    ],
)  # fmt: skip
def test_too_little_memory(error):
    assert Failure.of(error).kind is FailureKind.MEMORY


def test_other_exceptions_are_errors():
    failure = Failure.of(ZeroDivisionError("by nought"), "Traceback ...")
    assert (failure.kind, failure.text) == (FailureKind.ERROR, "ZeroDivisionError: by nought")
    assert Failure.of(RuntimeError("while recording")).kind is FailureKind.ERROR


def test_failures_travel_between_processes():
    failure = pickle.loads(
        pickle.dumps(Failure.of(DamagedFileError("it is damaged", "light/0001.exr"), "log"))
    )
    assert (failure.error.file, str(failure.error), failure.log) == ("light/0001.exr", "it is damaged", "log")
