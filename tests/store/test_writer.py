"""Who writes in a run folder is told without touching the lock."""

import json
import os
import socket

from enfilade.store.lock import LOCK_NAME, Lock, writers_of


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
