"""Ledgers: whatever happens to the file, whole lines are read, and others are left out."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from enfilade.errors import NoSpaceError, RunFolderError
from enfilade.runs.ledger import Ledger, digest_line, plain
from support.toys import little_room

HEAD = {"format": 4, "identity": "abc"}


def line(frame, name="light", **facts):
    files = {f"{name}/{frame:04d}.exr": {"bytes": 1, "sha256": "0" * 64}}
    return {
        "pass": name,
        "frame": frame,
        **facts,
        "files": files,
        "cost": {"light": {"wall_s": 0.1, "cpu_s": 0.2}},
    }


@pytest.fixture
def file(tmp_path):
    """A ledger with a head and three lines."""
    ledger = Ledger(tmp_path / "ledger.jsonl")
    ledger.write_head(HEAD)
    for frame in (1, 2, 3):
        ledger.append(line(frame, text="Zimmer ü\r\n"))
    return tmp_path / "ledger.jsonl"


def frames(ledger):
    return [entry["frame"] for entry in ledger]


def test_lines_are_read_back(file):
    ledger = Ledger(file)
    assert (ledger.head, ledger.damaged, frames(ledger)) == (HEAD, [], [1, 2, 3])
    assert ledger.get(("light", 2)) == line(2, text="Zimmer ü\r\n")
    assert ledger.get(("mean", 2)) is None
    assert ledger.writer("light/0003.exr")["frame"] == 3
    assert ledger.writer("light/0004.exr") is None


def test_the_newest_line_of_a_task_counts_also_of_another_process(file):
    one, two = Ledger(file), Ledger(file)
    one.append(line(1, attempt=2))
    assert "attempt" not in two.get(("light", 1))
    two.refresh()
    assert two.get(("light", 1)) == line(1, attempt=2)
    two.append(line(4))
    one.append(line(5))  # reads the lines that were appended before
    assert frames(one) == [2, 3, 1, 4, 5]


def test_several_writers_at_once(file):
    def write(first):
        ledger = Ledger(file)
        for frame in range(first, first + 20):
            ledger.append(line(frame))

    with ThreadPoolExecutor() as pool:
        list(pool.map(write, (100, 200, 300, 400)))
    ledger = Ledger(file)
    assert len(frames(ledger)) == 83
    assert not ledger.damaged


def test_a_line_torn_anywhere_is_cut_off(file):
    data = file.read_bytes()
    last = data.rindex(b"\n", 0, len(data) - 1) + 1
    for size in range(last, len(data)):
        file.write_bytes(data[:size])
        ledger = Ledger(file)
        assert (frames(ledger), ledger.damaged) == ([1, 2], [])
        ledger.append(line(3, text="Zimmer ü\r\n"))
        assert file.read_bytes() == data


def test_every_flipped_bit_is_found(file):
    data = file.read_bytes()
    whole = {entry["frame"]: digest_line(entry) for entry in Ledger(file)}
    for place in range(0, len(data), 3):
        flipped = bytearray(data)
        flipped[place] ^= 1 << place % 8
        file.write_bytes(flipped)
        ledger = Ledger(file)
        assert ledger.head in (HEAD, {})
        assert all(digest_line(entry) == whole[entry["frame"]] for entry in ledger)
        assert ledger.head == {} or len(frames(ledger)) < 3


@pytest.mark.parametrize("bad", [b"", b"{", b"[" * 9999, b"\0" * 40, b"\xff", b'{"pass": "light"}'])
def test_a_damaged_line_is_left_out(file, bad):
    lines = file.read_bytes().splitlines()
    file.write_bytes(b"\n".join([*lines[:2], bad, lines[3], b""]))
    ledger = Ledger(file)
    assert (frames(ledger), ledger.damaged) == ([1, 3], [3])
    ledger.append(line(2))
    assert frames(Ledger(file)) == [1, 3, 2]


def test_a_damaged_head_is_written_again(file):
    lines = file.read_bytes().splitlines()
    file.write_bytes(b"\n".join([b"?", *lines[1:], b""]))
    ledger = Ledger(file)
    assert (ledger.head, ledger.damaged) == ({}, [1])
    ledger.write_head(HEAD)
    ledger.write_head({"format": 9})  # there is one
    assert Ledger(file).head == HEAD


def test_a_full_disk_leaves_the_ledger_as_it_was(file):
    ledger, before = Ledger(file), file.read_bytes()
    for room in (0, 1, 40):
        with little_room(len(before) + room), pytest.raises(NoSpaceError, match=r"ledger\.jsonl"):
            ledger.append(line(4))
        assert file.read_bytes() == before
    ledger.append(line(4))
    assert frames(Ledger(file)) == [1, 2, 3, 4]


def test_a_disk_that_can_not_flush_leaves_the_ledger_as_it_was(file, monkeypatch):
    def fail(_handle):
        raise OSError(5, "Input/output error")

    ledger, before = Ledger(file), file.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(RunFolderError, match="Input/output error"):
            ledger.append(line(4))
    assert file.read_bytes() == before
    assert frames(ledger) == [1, 2, 3]


def test_links_and_folders_are_no_ledger(tmp_path):
    (tmp_path / "precious").write_text("keep me")
    (tmp_path / "ledger.jsonl").symlink_to(tmp_path / "precious")
    with pytest.raises(RunFolderError, match="symbolic links"):
        Ledger(tmp_path / "ledger.jsonl").append(line(1))
    assert (tmp_path / "precious").read_text() == "keep me"
    with pytest.raises(RunFolderError, match="can't read"):
        Ledger(tmp_path)


def test_lines_are_fit_for_json():
    made = plain({"spp": np.int64(64), "mean": np.float32(0.5), "counts": (np.uint8(1), 2)})
    assert json.dumps(made) == '{"spp": 64, "mean": 0.5, "counts": [1, 2]}'
    for value in (float("nan"), float("inf"), {1}, np.zeros(3)):
        with pytest.raises((ValueError, TypeError)):
            plain({"x": value})


def test_the_digest_leaves_out_times():
    one, two = line(1), line(1)
    two["cost"] = {}
    assert digest_line(one) == digest_line(two) != digest_line(line(1, mean=1.0))
