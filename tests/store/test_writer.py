"""Who writes in a run folder is told without touching the lock."""

import errno
import json
import os
import socket
from pathlib import Path

import pytest

from enfilade.errors import RunFolderError
from enfilade.store.lock import LOCK_NAME, Lock, sign_workers, writers_of

GONE = {"host": "another", "pid": 7, "started": "2026-01-01T00:00:00+00:00"}


@pytest.fixture
def shared(tmp_path):
    (tmp_path / "parts").mkdir()
    return tmp_path


def test_the_holder_is_named_until_it_lets_go(tmp_path):
    assert writers_of(tmp_path) == []
    lock = Lock(tmp_path)
    assert [w["pid"] for w in writers_of(tmp_path)] == [os.getpid()]
    lock.release()
    assert writers_of(tmp_path) == []


def test_a_holder_that_was_killed_is_gone(tmp_path):
    name = {"host": socket.gethostname(), "pid": 2**22 + 1, "started": "2026-01-01T00:00:00+00:00"}
    (tmp_path / LOCK_NAME).write_text(json.dumps(name))
    assert writers_of(tmp_path) == []
    (tmp_path / LOCK_NAME).write_text(json.dumps({**name, "host": "another"}))
    assert [w["host"] for w in writers_of(tmp_path)] == ["another"]


def test_what_cannot_be_read_names_nobody(tmp_path):
    for text in ("", "[]", '{"pid": "x"}', "{"):
        (tmp_path / LOCK_NAME).write_text(text)
        assert writers_of(tmp_path) == []


def test_who_shares_a_run_is_named_and_who_had_it_before_is_not(shared):
    (shared / LOCK_NAME).write_text(json.dumps(GONE))
    one, two = Lock(shared, part="one"), Lock(shared, part="two")
    sign_workers(shared, 3)
    assert (shared / LOCK_NAME).read_text() == ""
    assert [(w["host"], w["pid"]) for w in writers_of(shared)] == [(socket.gethostname(), os.getpid())] * 2
    assert [w["workers"] for w in writers_of(shared)] == [3, 1]
    with pytest.raises(RunFolderError, match=rf"process {os.getpid()} on .*; process {os.getpid()} on "):
        Lock(shared)
    one.release()
    two.release()
    assert writers_of(shared) == []


def test_a_part_that_was_killed_elsewhere_is_not_named_beside_who_has_the_folder_to_itself(shared):
    (shared / "parts" / "one.lock").write_text(json.dumps(GONE))
    assert [w["pid"] for w in writers_of(shared)] == [7]
    lock = Lock(shared)
    assert [w["pid"] for w in writers_of(shared)] == [os.getpid()]
    with pytest.raises(RunFolderError, match=f"{shared}: process {os.getpid()} on [^;]*; wait"):
        Lock(shared, part="two")
    lock.release()


def test_a_full_disk_leaves_a_lock_without_a_name(tmp_path, monkeypatch):
    def full(*_arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    (tmp_path / LOCK_NAME).write_text(json.dumps(GONE))
    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", full)
        lock = Lock(tmp_path)
    assert (tmp_path / LOCK_NAME).read_text() == ""
    with pytest.raises(RunFolderError, match="hasn't given its name"):
        Lock(tmp_path)
    lock.release()


def test_a_lock_is_waited_for_as_long_as_it_is_said(shared):
    holder, told = Lock(shared, part="one"), []

    def wait(text):
        told.append(text)
        if len(told) == 3:
            holder.release()

    Lock(shared, part="one", wait=wait).release()
    assert len(told) == 3
    assert f"another command is writing {shared / 'parts'}: process {os.getpid()} on " in told[0]
    holder = Lock(shared)
    with pytest.raises(TimeoutError):
        Lock(shared, part="one", wait=give_up)
    holder.release()
    Lock(shared, part="one").release()  # and what was opened to wait is closed


def give_up(_text):
    raise TimeoutError


def test_who_knows_its_part_looks_through_no_other_lock(shared, monkeypatch):
    one, two = Lock(shared, part="one"), Lock(shared, part="two")
    read, really = [], Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda file: (read.append(file.name), really(file))[1])
    sign_workers(shared, 5, "two")
    assert read == ["two.lock"]
    assert [w["workers"] for w in writers_of(shared)] == [1, 5]
    one.release()
    two.release()
