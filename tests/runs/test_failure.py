"""The classes of failures."""

from __future__ import annotations

import errno
import pickle

import pytest

from enfilade.errors import DamagedFileError, DeviceError, NoSpaceError, RunFolderError, SettingsError
from enfilade.runs.failure import Failure, FailureKind


def raised(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.ENOTCONN])
def test_a_disk_that_did_not_answer_may_answer_the_next_time(number):
    cause = OSError(number, "no answer")
    for error in (cause, raised(RunFolderError("can't read it"), cause)):
        assert Failure.of(error).kind is FailureKind.ERROR


@pytest.mark.parametrize("number", [errno.ENOENT, errno.EACCES, errno.EROFS, errno.EISDIR])
def test_missing_and_forbidden_files_stay_so(number):
    assert Failure.of(raised(RunFolderError("no"), OSError(number, "no"))).kind is FailureKind.FATAL
    assert Failure.of(OSError(number, "no")).kind is FailureKind.ERROR


@pytest.mark.parametrize("error", [SettingsError("no"), DeviceError("no GPU"), NoSpaceError("no room")])
def test_errors_of_the_input_and_full_disks_end_the_run(error):
    assert (Failure.of(error).kind, Failure.of(error).error) == (FailureKind.FATAL, error)


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("jit_malloc(): out of memory!"),
        raised(RuntimeError("recording"), RuntimeError("Tried to free the allocation cache")),
        raised(RunFolderError("can't read it"), MemoryError()),
    ],
)
def test_too_little_memory(error):
    assert Failure.of(error).kind is FailureKind.MEMORY


def test_other_exceptions_are_errors_and_all_travel_between_processes():
    assert Failure.of(ZeroDivisionError("by nought")).text == "ZeroDivisionError: by nought"
    assert Failure.of(RuntimeError("recording")).kind is FailureKind.ERROR
    failure = Failure.of(DamagedFileError("it is damaged", "light/0001.exr"), "log")
    again = pickle.loads(pickle.dumps(failure))  # noqa: S301
    assert (again.error.file, str(again.error), again.log) == ("light/0001.exr", "it is damaged", "log")
