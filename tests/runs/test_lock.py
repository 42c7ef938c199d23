"""The lock of a run folder."""

from __future__ import annotations

import json
import os
import socket

import pytest

from enfilade.errors import NoSpaceError, RunFolderError
from enfilade.runs.lock import LOCK_FILE, Lock, holder_of

GONE = {"host": socket.gethostname(), "pid": 2**22 + 1, "started": "2026-01-01T00:00:00+00:00", "ticks": 1}


def test_a_second_command_is_refused_and_the_first_is_named(tmp_path):
    lock = Lock(tmp_path)
    for is_shared in (False, True):
        with pytest.raises(
            RunFolderError, match=rf"another command is writing .*: process {os.getpid()} on "
        ):
            Lock(tmp_path, is_shared=is_shared)
    lock.sign()
    assert holder_of(tmp_path)["pid"] == os.getpid()
    lock.release()
    lock.release()
    assert holder_of(tmp_path) is None
    one, two = Lock(tmp_path, is_shared=True), Lock(tmp_path, is_shared=True)
    with pytest.raises(RunFolderError, match="another command is writing"):
        Lock(tmp_path)
    one.release()
    two.release()
    Lock(tmp_path).release()


def test_a_killed_holder_is_gone_but_one_on_another_host_may_live(tmp_path):
    (tmp_path / LOCK_FILE).write_text(json.dumps(GONE))
    assert holder_of(tmp_path) is None
    (tmp_path / LOCK_FILE).write_text(json.dumps({**GONE, "host": "another"}))
    assert holder_of(tmp_path) == {
        name: {**GONE, "host": "another"}[name] for name in ("host", "pid", "started")
    }
    (tmp_path / LOCK_FILE).write_text(json.dumps({**GONE, "pid": os.getpid()}))  # its number was given again
    assert holder_of(tmp_path) is None
    for text in ("", "[]", '{"pid": "x"}', "{"):
        (tmp_path / LOCK_FILE).write_text(text)
        assert holder_of(tmp_path) is None
    Lock(tmp_path).release()  # the kernel knows that it is free


def test_links_are_not_followed(tmp_path):
    (tmp_path / "precious").write_text("keep me")
    (tmp_path / LOCK_FILE).symlink_to(tmp_path / "precious")
    with pytest.raises(RunFolderError, match="symbolic links"):
        Lock(tmp_path)
    assert (tmp_path / "precious").read_text() == "keep me"


def test_on_a_full_disk_a_lock_without_a_name_holds(tmp_path, monkeypatch):
    def full(*_arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", full)
        lock = Lock(tmp_path)
    with pytest.raises(RunFolderError, match=f"writing {tmp_path}; wait for it"):
        Lock(tmp_path)
    lock.release()
    monkeypatch.setattr(os, "open", full)
    with pytest.raises(NoSpaceError, match=r"run\.lock"):
        Lock(tmp_path)
