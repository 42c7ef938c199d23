"""Atomic writes, the sweeping of what killed processes leave, and errors of the disk."""

import errno
import os
import socket
import stat
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from enfilade import files
from enfilade.errors import NoSpaceError, RunFolderError
from enfilade.files import json_bytes, read_json, sweep, unwritable, whole_file, whole_folder, write_json
from enfilade.images import write_exr
from support.toys import little_room

ROOM = 20_000  # bytes
NOISE = np.random.default_rng(1).random((120, 160, 3), np.float32)


def test_a_file_is_replaced_when_the_block_ends_and_not_after_an_error(tmp_path):
    file = tmp_path / "deep" / "a.json"
    write_json(file, {"b": 1, "a": [None, "ü"]})
    assert read_json(file) == {"b": 1, "a": [None, "ü"]}
    assert file.read_bytes() == json_bytes({"b": 1, "a": [None, "ü"]})
    with pytest.raises(ZeroDivisionError), whole_file(file) as temporary:
        temporary.write_text(str(1 / 0))
    start = f".a.writing-{socket.gethostname()}-{os.getpid()}-"
    assert (temporary.name.startswith(start), temporary.suffix) == (True, ".json")
    assert [f.name for f in file.parent.iterdir()] == ["a.json"]
    with pytest.raises(ValueError, match="JSON"):
        write_json(file, float("nan"))
    assert read_json(file)["b"] == 1


@pytest.mark.parametrize("data", [None, b"{", b"[" * 9999])
def test_json_that_can_not_be_read(tmp_path, data):
    if data is not None:
        (tmp_path / "a.json").write_bytes(data)
    with pytest.raises(RunFolderError, match=r"can't read .*a\.json|a\.json is damaged .*made it again"):
        read_json(tmp_path / "a.json")


def test_temporary_files_are_swept_when_their_writer_is_gone_or_they_are_a_day_old(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    here, old = socket.gethostname(), time.time() - 90_000
    writers = {
        f"{here}-{os.getpid()}": (False, True),  # removed when new, when a day old
        f"{here}-{ended.pid}": (True, True),
        f"far-off.example-{ended.pid}": (False, True),
    }
    removed = set()
    for writer, when in writers.items():
        for is_old, is_removed in enumerate(when):
            file = tmp_path / "sub" / f".{is_old}.writing-{writer}-0123abcd.exr"
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(b"x")
            if is_old:
                os.utime(file, (old, old))
            removed |= {file} if is_removed else set()
    (tmp_path / "sub" / "0001.exr").write_bytes(b"x")
    with whole_file(tmp_path / "a.json") as temporary:
        temporary.write_text("1")
        assert sweep(tmp_path) == sorted(removed)
    assert sweep(tmp_path) == []
    assert len(list((tmp_path / "sub").iterdir())) == 3
    assert read_json(tmp_path / "a.json") == 1


@pytest.mark.parametrize(
    "write",
    [lambda file: write_exr(file, {"RGB": NOISE}), lambda file: write_json(file, NOISE.tolist())],
    ids=["exr", "json"],
)
def test_a_full_disk(tmp_path, write):
    file = tmp_path / "deep" / "file.exr"
    with little_room(ROOM), pytest.raises(NoSpaceError, match=r"file\.exr: no room on the disk"):
        write(file)
    assert not list(file.parent.iterdir())
    write(file)
    assert file.stat().st_size > ROOM


@pytest.mark.parametrize("is_portable", [False, True])
def test_wherever_the_disk_ends_images_are_complete_or_absent(tmp_path, is_portable):
    # so small that OpenEXR would write all of it when it closes the file, where it can't fail
    file, layers = tmp_path / "file.exr", {"RGB": NOISE[:8, :8]}
    write_exr(file, layers, is_portable=is_portable)
    size = file.stat().st_size
    file.unlink()
    for room in range(0, size, 9):
        with little_room(room), pytest.raises(NoSpaceError, match="no room on the disk"):
            write_exr(file, layers, is_portable=is_portable)
        assert not list(tmp_path.iterdir())
    with little_room(size):
        write_exr(file, layers, is_portable=is_portable)
    assert file.stat().st_size == size


@pytest.mark.parametrize("place", ["flat/a.json", "/dev/full/a.json"])
def test_a_place_that_can_not_be_written(tmp_path, place):
    (tmp_path / "flat").write_text("")
    with pytest.raises(RunFolderError, match=r"can't write .*another folder, then run the same command"):
        write_json(tmp_path / place, 1)


@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.ETIMEDOUT])
def test_errors_that_may_pass(tmp_path, number):
    error = OSError(number, os.strerror(number))
    assert files.is_passing(error)
    text = str(unwritable(tmp_path / "file", error))
    assert f"{os.strerror(number)}; check its disk" in text


@pytest.mark.parametrize("number", [errno.ENOENT, errno.EACCES, errno.EROFS, errno.ENOSPC, None])
def test_errors_that_last(number):
    assert not files.is_passing(OSError("no reason") if number is None else OSError(number, "reason"))


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOTSUP, errno.EIO])
def test_only_folders_need_not_be_flushed_where_the_file_system_can_not(tmp_path, monkeypatch, number):
    really, refused = os.fsync, [stat.S_ISDIR]

    def fsync(handle):
        if refused[0](os.fstat(handle).st_mode):
            raise OSError(number, os.strerror(number))
        really(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    with nullcontext() if number != errno.EIO else pytest.raises(RunFolderError, match="error"):
        write_json(tmp_path / "file.json", {})
    refused[0] = stat.S_ISREG
    with pytest.raises(RunFolderError, match=os.strerror(number)):
        write_json(tmp_path / "other.json", {})
    assert not Path(tmp_path / "other.json").exists()


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    out = tmp_path / "parts" / "scene"
    with whole_folder(out) as beside:
        (beside / "meshes").mkdir()
        (beside / "meshes" / "a.ply").touch()
        assert not out.exists()
    assert (out / "meshes" / "a.ply").exists()
    with pytest.raises(ZeroDivisionError), whole_folder(out) as beside:
        (beside / f"{1 // 0}").touch()
    assert [entry.name for entry in out.iterdir()] == ["meshes"]
    with whole_folder(out):
        pass
    assert list(out.iterdir()) == []
    assert [entry.name for entry in out.parent.iterdir()] == ["scene"]


def test_a_link_to_a_folder_stays(tmp_path):
    (tmp_path / "disk").mkdir()
    link = tmp_path / "scene"
    link.symlink_to(tmp_path / "disk")
    with whole_folder(link) as beside:
        (beside / "a.ply").touch()
    assert link.is_symlink()
    assert [entry.name for entry in (tmp_path / "disk").iterdir()] == ["a.ply"]
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["disk", "scene"]


def test_an_interrupted_replacement_leaves_the_older_folder(tmp_path, monkeypatch):
    out, rename = tmp_path / "scene", Path.rename
    with whole_folder(out) as beside:
        (beside / "a.ply").touch()

    def interrupted(place, target):
        if target == out and place.name.startswith(".scene.writing-") and not (place / "a.ply").exists():
            raise KeyboardInterrupt
        return rename(place, target)

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt), whole_folder(out) as beside:
        (beside / "b.ply").touch()
    assert [entry.name for entry in out.iterdir()] == ["a.ply"]
    assert [entry.name for entry in tmp_path.iterdir()] == ["scene"]


def test_folders_of_killed_processes_are_swept(tmp_path):
    left = tmp_path / f".scene.writing-{socket.gethostname()}-4194400-00000000"
    (left / "meshes").mkdir(parents=True)
    (left / "meshes" / "a.ply").touch()
    assert sweep(tmp_path) == [left]
    assert list(tmp_path.iterdir()) == []
