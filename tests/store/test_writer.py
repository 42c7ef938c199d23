"""Who writes in a run folder is told without touching the lock."""

import json
import os
import socket

from enfilade.store.lock import LOCK_NAME, Lock, writer_of


def test_the_holder_is_named_until_it_lets_go(tmp_path):
    assert writer_of(tmp_path) is None
    lock = Lock(tmp_path)
    assert writer_of(tmp_path)["pid"] == os.getpid()
    lock.release()
    assert writer_of(tmp_path) is None


def test_a_holder_that_was_killed_is_gone(tmp_path):
    name = {"host": socket.gethostname(), "pid": 2**22 + 1, "started": "2026-01-01T00:00:00+00:00"}
    (tmp_path / LOCK_NAME).write_text(json.dumps(name))
    assert writer_of(tmp_path) is None
    (tmp_path / LOCK_NAME).write_text(json.dumps({**name, "host": "another"}))
    assert writer_of(tmp_path)["host"] == "another"


def test_what_cannot_be_read_names_nobody(tmp_path):
    for text in ("", "[]", '{"pid": "x"}', "{"):
        (tmp_path / LOCK_NAME).write_text(text)
        assert writer_of(tmp_path) is None
