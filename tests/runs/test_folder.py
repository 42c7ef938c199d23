"""Run folders: continued if they hold the same run, refused if not, recovered if damaged."""

from __future__ import annotations

import json
import os
import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from enfilade.errors import DamagedFileError, NoSpaceError, RunFolderError
from enfilade.runs import folder as module
from enfilade.runs.folder import RunFolder
from support.toys import flip

IDENTITY = {
    "scene": "abc",
    "path": {"frames": [1, 2, 3], "fps": 24.0},
    "settings": {"trace": {"spp": 64, "seed": 0}},
}


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "deep" / "run"


def finish(run, name, number, data=b"pixels", **facts):
    """Finish a task that writes one file."""
    file = run.stem(name, number).with_suffix(".exr")
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(data)
    run.finish({"pass": name, "frame": number, **facts, "files": run.record_of([file]), "cost": {}})
    return file


def finished(run):
    return [(line["pass"], line["frame"]) for line in run.lines()]


def other(**trace):
    return {**IDENTITY, "settings": {"trace": {**IDENTITY["settings"]["trace"], **trace}}}


def test_a_run_is_continued(folder):
    with RunFolder.create(folder, IDENTITY) as run:
        assert run.line("light", 1) is None
        finish(run, "light", 1, mean=0.5)
    with RunFolder.create(folder, IDENTITY) as run:
        assert run.notes == []
        assert run.line("light", 1)["mean"] == 0.5
        assert run.file_of("light", 1) == folder / "light" / "0001.exr"
    assert json.loads((folder / "run.json").read_text())["identity"] == IDENTITY


def test_reading_changes_nothing_and_sees_a_running_run(folder):
    with RunFolder.create(folder, IDENTITY) as writer:
        finish(writer, "light", 1)
        with (folder / "ledger.jsonl").open("a") as ledger:
            ledger.write('{"pass": "half')
        before = (folder / "ledger.jsonl").read_bytes()
        with RunFolder.read(folder) as run:
            assert (finished(run), run.identity, run.notes) == ([("light", 1)], IDENTITY, [])
        assert (folder / "ledger.jsonl").read_bytes() == before


def test_files_are_named_by_pass_and_frame(folder):
    with RunFolder.create(folder, IDENTITY) as run:
        for number, name in ((0, "0000"), (7, "0007"), (12345, "12345"), (-5, "-0005")):
            assert run.stem("light", number) == folder / "light" / name


def test_another_run_is_refused_with_its_differences(folder):
    RunFolder.create(folder, IDENTITY).close()
    many = {f"k{i}": i for i in range(50)}
    with pytest.raises(RunFolderError) as refused:
        RunFolder.create(folder, {**other(spp=128, depth=list(range(1000))), "path": {"fps": 24}, **many})
    text = str(refused.value)
    assert "settings.trace.spp: 64 there, 128 now" in text
    assert "settings.trace.depth: nothing there, [0, 1, 2" in text
    assert "path.frames: [1, 2, 3] there, nothing now" in text
    assert "and 41 more" in text
    assert len(text) < 1500
    assert "seed" not in text
    assert "fps" not in text
    RunFolder.create(folder, {**IDENTITY, "path": {"frames": [1, 2, 3], "fps": 24}}).close()


def test_results_of_an_unknown_run_are_not_taken(folder):
    with RunFolder.create(folder, IDENTITY) as run:
        run.finish({"pass": "frames", "frame": 1, "files": {}})
    (folder / "run.json").unlink()
    RunFolder.create(folder, IDENTITY).close()  # the ledger names it, too
    (folder / "run.json").unlink()
    head, *lines = (folder / "ledger.jsonl").read_text().splitlines(keepends=True)
    assert "identity" in head
    (folder / "ledger.jsonl").write_text("".join(lines))
    with pytest.raises(RunFolderError, match="results of a run that is not named"):
        RunFolder.create(folder, IDENTITY)


def test_a_folder_that_was_deleted_or_replaced_gets_no_results(folder):
    line = {"pass": "frames", "frame": 1, "files": {}}
    with RunFolder.create(folder, IDENTITY) as first:
        shutil.rmtree(folder)
        with pytest.raises(RunFolderError, match="was deleted or replaced"):
            first.finish(line)
        with RunFolder.create(folder, {**IDENTITY, "seed": 5}) as second:
            with pytest.raises(RunFolderError, match="was deleted or replaced"):
                first.finish(line)
            second.finish(line)
        assert [found["frame"] for found in RunFolder.read(folder).lines()] == [1]


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(RunFolderError, match=r"not empty and holds no run \(it has thesis\.tex\)"):
        RunFolder.create(tmp_path, IDENTITY)
    for opening in (RunFolder.read, RunFolder.share):
        with pytest.raises(RunFolderError, match="no run folder"):
            opening(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.tex"]


def test_places_that_can_not_be_written(tmp_path, folder, monkeypatch):
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file", tmp_path / "file" / "run", Path("/proc/enfilade")):
        with pytest.raises(RunFolderError, match="can't make a run in"):
            RunFolder.create(place, IDENTITY)

    def refuse(*_arguments):
        raise PermissionError(13, "Permission denied")

    RunFolder.create(folder, IDENTITY).close()
    monkeypatch.setattr(os, "open", refuse)
    for opening in (lambda: RunFolder.create(folder, IDENTITY), lambda: RunFolder.share(folder)):
        with pytest.raises(RunFolderError, match=r"can't write .*run\.lock: Permission denied"):
            opening()
    assert RunFolder.read(folder).identity == IDENTITY


@pytest.mark.parametrize("where", ["pathlib.Path.mkdir", "os.fsync"])
def test_a_full_disk_is_no_wrong_input(folder, monkeypatch, where):
    def full(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(where, full)
        with pytest.raises(NoSpaceError, match="no room"):
            RunFolder.create(folder, IDENTITY)
    RunFolder.create(folder, IDENTITY).close()  # the lock was released


@pytest.mark.parametrize(
    "text",
    [None, "", "{", "[]", '{"format": 4}', '{"format": 4, "identity": 3}', '{"format": 9, "identity": {}}'],
)
def test_a_damaged_identity_is_written_again_by_the_same_run_alone(folder, text):
    with RunFolder.create(folder, IDENTITY) as run:
        finish(run, "light", 1)
    whole = (folder / "run.json").read_bytes()
    (folder / "run.json").unlink()
    if text is not None:
        (folder / "run.json").write_text(text)
    for opening in (RunFolder.read, RunFolder.share, lambda place: RunFolder.create(place, other(spp=1))):
        with pytest.raises(RunFolderError, match=r"run\.json"):
            opening(folder)
    with RunFolder.create(folder, IDENTITY) as run:
        assert finished(run) == [("light", 1)]
    assert (folder / "run.json").read_bytes() == whole


def test_a_flipped_bit_of_the_identity_is_no_other_run(folder):
    RunFolder.create(folder, IDENTITY).close()
    text = (folder / "run.json").read_text()
    (folder / "run.json").write_text(text.replace("64", "65"))
    for opening in (RunFolder.read, RunFolder.share):
        with pytest.raises(RunFolderError, match=r"run\.json is damaged"):
            opening(folder)
    RunFolder.create(folder, IDENTITY).close()
    assert (folder / "run.json").read_text() == text


def test_a_damaged_head_of_the_ledger_is_written_again(folder):
    with RunFolder.create(folder, IDENTITY) as run:
        finish(run, "light", 1)
    flip(folder / "ledger.jsonl", 5)
    with pytest.raises(RunFolderError, match=r"spp: 64 there, 1 now"):
        RunFolder.create(folder, other(spp=1))
    for _ in range(2):
        with RunFolder.create(folder, IDENTITY) as run:
            assert run.notes == ["ledger.jsonl: line 1 is damaged and left out"]
            assert finished(run) == [("light", 1)]
    (folder / "run.json").unlink()  # the head is there again
    with pytest.raises(RunFolderError, match=r"run\.json"):
        RunFolder.create(folder, other(spp=1))
    RunFolder.create(folder, IDENTITY).close()


def test_files_are_checked_before_they_are_used(folder):
    with RunFolder.create(folder, IDENTITY) as run:
        file = finish(run, "light", 1)
        finish(run, "light", 2)
        assert run.damaged() == []
        file.write_bytes(b"short")
        assert run.line("light", 1) is None
        assert run.recorded("light", 1) is not None
        assert run.recorded("light", 3) is None
        file.write_bytes(b"pixelz")
        assert run.line("light", 1) is not None  # its size is right
        (folder / "light" / "0002.exr").unlink()
        assert run.damaged() == ["light/0001.exr", "light/0002.exr"]
        for number in (1, 2):
            with pytest.raises(DamagedFileError, match=rf"000{number}\.exr is missing or damaged") as error:
                run.file_of("light", number)
            run.forget(error.value.file)
            assert run.line("light", number) is None
        finish(run, "light", 1, b"new")
        assert run.file_of("light", 1) == file
        with pytest.raises(KeyError, match="no finished task has written"):
            run.file_of("light", 3)


def test_a_file_that_can_not_be_read_is_damaged_only_if_all_are_verified(folder, monkeypatch):
    def fail(*_arguments):
        raise OSError(5, "Input/output error")

    with RunFolder.create(folder, IDENTITY) as run:
        finish(run, "light", 1)
        with monkeypatch.context() as patch:
            patch.setattr(module.hashlib, "file_digest", fail)
            with pytest.raises(RunFolderError, match=r"can't read .*Input/output error") as error:
                run.file_of("light", 1)
            assert not isinstance(error.value, DamagedFileError)
            assert run.damaged() == ["light/0001.exr"]


def test_a_file_that_another_host_has_written_may_come_late(folder, monkeypatch):
    monkeypatch.setattr(module, "LATE_S", 600.0)
    monkeypatch.setattr(module, "LOOK_S", 0.01)
    with RunFolder.create(folder, IDENTITY) as run, ThreadPoolExecutor() as pool:
        file = finish(run, "light", 1)
        file.unlink()
        waiting = pool.submit(run.file_of, "light", 1)
        written = folder / "written"
        written.write_bytes(b"pixels")
        written.rename(file)  # whole at once, as tasks publish their files
        assert waiting.result() == file


def test_commands_that_share_a_run_see_what_others_finish(folder):
    RunFolder.create(folder, IDENTITY).close()
    with RunFolder.share(folder) as one, RunFolder.share(folder) as two:
        file = finish(one, "light", 1)
        assert two.file_of("light", 1) == file  # of a line that it has not read
        assert finished(two) == [("light", 1)]
        with pytest.raises(RunFolderError, match="another command is writing"):
            RunFolder.create(folder, IDENTITY)
    with RunFolder.create(folder, IDENTITY) as run:
        assert finished(run) == [("light", 1)]
        with pytest.raises(RunFolderError, match="another command is writing"):
            RunFolder.share(folder)


def test_a_file_that_was_made_again_meanwhile_is_not_forgotten(folder):
    RunFolder.create(folder, IDENTITY).close()
    with RunFolder.share(folder) as one, RunFolder.share(folder) as two:
        file = finish(one, "light", 1)
        two.refresh()
        file.write_bytes(b"damaged")
        for run in (one, two):
            with pytest.raises(DamagedFileError):
                run.file_of("light", 1)
        one.forget("light/0001.exr")
        finish(one, "light", 1, b"other pixels")
        two.forget("light/0001.exr")
        assert two.file_of("light", 1).read_bytes() == b"other pixels"


def test_unfinished_files_are_removed(folder):
    with RunFolder.create(folder, IDENTITY) as run:
        finish(run, "light", 1)
        left = folder / "light" / f".0002.writing-{os.uname().nodename}-{2**22 + 1}-0123abcd.exr"
        left.write_bytes(b"half")
        os.utime(left, (0.0, time.time() - 1e6))
    with RunFolder.create(folder, IDENTITY) as run:
        assert run.notes == ["removed 1 unfinished files of a run that was interrupted"]
    assert [file.name for file in (folder / "light").iterdir()] == ["0001.exr"]


def test_the_digest_leaves_out_times_and_order(tmp_path):
    digests = []
    for place, numbers in (("a", (1, 2, 3)), ("b", (3, 1, 2))):
        with RunFolder.create(tmp_path / place, IDENTITY) as run:
            for number in numbers:
                finish(run, "light", number, bytes(number))
            digests.append(run.digest())
            finish(run, "light", 1, b"other")
            digests.append(run.digest())
    assert digests[0] == digests[2] != digests[1] == digests[3]


def test_nothing_outside_the_folder_is_removed(folder, tmp_path):
    with RunFolder.create(folder, IDENTITY) as run:
        finish(run, "light", 1)
        (folder / "light").rename(tmp_path / "elsewhere")
        (folder / "light").symlink_to(tmp_path / "elsewhere")
        (tmp_path / "elsewhere" / "0001.exr").write_bytes(b"precious")
        assert run.damaged() == ["light/0001.exr"]
        with pytest.raises(RunFolderError, match="outside of the run folder"):
            run.forget("light/0001.exr")
    assert (tmp_path / "elsewhere" / "0001.exr").exists()
