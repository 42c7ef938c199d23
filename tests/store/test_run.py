"""Run folders: continued where they are the same run, refused where not, recovered where torn."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from enfilade.errors import DamagedFileError, NoSpaceError, RunFolderError
from enfilade.store import KINDS, Run
from enfilade.store.parts import part_files

IDENTITY = {
    "scene": {"fingerprint": "abc"},
    "path": {"frames": [1, 2, 3], "fps": 24.0},
    "settings": {"trace": {"spp": 64, "seed": 0}},
}


def other(**trace):
    return {**IDENTITY, "settings": {"trace": {**IDENTITY["settings"]["trace"], **trace}}}


def write(run, kind, number, data=b"pixels"):
    file = run.file(kind, number)
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(data)
    return file


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "deep" / "run"


def recorded(folder):
    """Lines of units, as they stand in the file."""
    lines = [json.loads(text) for text in (folder / "ledger.jsonl").read_text().splitlines()]
    assert all(len(line.pop("sum")) == 16 for line in lines)
    assert list(lines[0]) == ["identity"]
    return lines[1:]


def test_a_run_is_continued(folder):
    with Run.open(folder, IDENTITY) as run:
        assert run.done("keyframe 1") is None
        file = write(run, "keyframes", 1)
        run.finish("keyframe 1", files=[file], facts={"spp": np.int64(64), "mean": np.float32(0.5)})
    with Run.open(folder, IDENTITY) as run:
        line = run.done("keyframe 1")
        assert run.notes == []
        run.check(file)
    assert line is not None
    assert line["spp"] == 64
    assert line["files"]["keyframes/0001.exr"]["bytes"] == 6
    assert recorded(folder) == [line]
    assert json.loads((folder / "run.json").read_text())["identity"] == IDENTITY


def test_reading_changes_nothing_and_sees_a_running_run(folder):
    with Run.open(folder, IDENTITY) as writer:
        writer.finish("a", files=[], facts={})
        with (folder / "ledger.jsonl").open("a") as ledger:
            ledger.write('{"unit": "half')
        before = (folder / "ledger.jsonl").read_bytes()
        with Run.existing(folder) as run:
            assert [line["unit"] for line in run.lines()] == ["a"]
            assert run.identity == IDENTITY
            with pytest.raises(ValueError, match="reading only"):
                run.finish("b", files=[], facts={})
        assert (folder / "ledger.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("number", "name"), [(0, "0000"), (7, "0007"), (12345, "12345"), (-5, "-0005"), (-12345, "-12345")]
)
def test_files_are_named_by_the_frame(folder, number, name):
    with Run.open(folder, IDENTITY) as run:
        for kind in KINDS:
            assert run.file(kind, number) == folder / kind / f"{name}.exr"
        with pytest.raises(ValueError, match="known are: drafts, keyframes, cells, raw, frames"):
            run.file("plots", number)


def test_another_run_is_refused_with_what_differs(folder):
    Run.open(folder, IDENTITY).close()
    with pytest.raises(RunFolderError) as refused:
        Run.open(folder, {**other(spp=128, depth=3), "path": {"fps": 24}})
    text = str(refused.value)
    assert "settings.trace.spp: 64 there, 128 now" in text
    assert "settings.trace.depth: nothing there, 3 now" in text
    assert "path.frames: [1, 2, 3] there, nothing now" in text
    assert "fps" not in text  # 24 and 24.0 are one frame rate
    assert "seed" not in text
    assert "--out" in text
    Run.open(folder, IDENTITY).close()


def test_many_or_long_differences_are_shortened(folder):
    Run.open(folder, {**{f"k{i}": i for i in range(50)}, "long": list(range(1000))}).close()
    with pytest.raises(RunFolderError, match="and 39 more") as refused:
        Run.open(folder, {"long": 1})
    assert len(str(refused.value)) < 1500


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(RunFolderError, match=r"not empty and holds no run \(it has thesis\.tex\)"):
        Run.open(tmp_path, IDENTITY)
    assert [f.name for f in tmp_path.iterdir()] == ["thesis.tex"]
    with pytest.raises(RunFolderError, match="no run folder"):
        Run.existing(tmp_path)


def test_a_place_that_can_not_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(RunFolderError, match="can't make a run in"):
            Run.open(place, IDENTITY)
    with pytest.raises(RunFolderError, match="/proc"):
        Run.open(tmp_path.__class__("/proc/enfilade"), IDENTITY)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 1}', '{"format": 9, "identity": {}}', None])
def test_a_damaged_identity_is_written_again_by_who_knows_it(folder, text):
    Run.open(folder, IDENTITY).close()
    whole = (folder / "run.json").read_bytes()
    if text is None:
        (folder / "run.json").unlink()
    else:
        (folder / "run.json").write_text(text)
    with pytest.raises(RunFolderError, match=r"run\.json"):
        Run.existing(folder)
    with pytest.raises(RunFolderError, match=r"run\.json is (damaged|missing), and its checksum"):
        Run.open(folder, other(spp=1))
    with Run.open(folder, IDENTITY) as run:
        assert run.notes == ["run.json was damaged or missing and was written again"]
    assert (folder / "run.json").read_bytes() == whole


def test_a_flipped_bit_of_the_identity_is_no_other_run(folder):
    Run.open(folder, IDENTITY).close()
    text = (folder / "run.json").read_text()
    (folder / "run.json").write_text(text.replace("64", "65"))
    with pytest.raises(RunFolderError, match="is damaged"):
        Run.existing(folder)
    Run.open(folder, IDENTITY).close()
    assert (folder / "run.json").read_text() == text


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 1}', '{"format": 9, "identity": {}}'])
def test_a_folder_from_before_ledgers_had_a_head(folder, text):
    with Run.open(folder, IDENTITY) as run:
        run.finish("a", files=[], facts={"x": 1})
    lines = recorded(folder)
    (folder / "ledger.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert [line["x"] for line in Run.existing(folder).lines()] == [1]
    (folder / "run.json").write_text(text)
    for opening in (lambda: Run.open(folder, IDENTITY), lambda: Run.existing(folder)):
        with pytest.raises(RunFolderError, match=r"run\.json"):
            opening()


def test_a_unit_is_done_while_its_files_have_their_sizes(folder):
    with Run.open(folder, IDENTITY) as run:
        file = write(run, "frames", 1)
        run.finish("frame 1", files=[file], facts={})
        file.write_bytes(b"short")
        assert run.done("frame 1") is None
        file.write_bytes(b"pixelz")
        assert run.done("frame 1") is not None
        with pytest.raises(RunFolderError, match=r"0001\.exr.*'frame 1'.*run the same command"):
            run.check(file)
        file.unlink()
        assert run.done("frame 1") is None
        with pytest.raises(RunFolderError, match="missing"):
            run.check(file)
        run.finish("frame 1", files=[write(run, "frames", 1, b"new")], facts={"try": 2})
        run.check(file)
        assert [line["try"] for line in run.lines()] == [2]
        with pytest.raises(RunFolderError, match="in no ledger line"):
            run.check(write(run, "frames", 2))


def test_facts_and_names_that_the_ledger_can_not_hold(folder):
    with Run.open(folder, IDENTITY) as run:
        for facts, error in (
            ({"unit": 1}, ValueError),
            ({"x": float("nan")}, ValueError),
            ({"x": {1}}, TypeError),
        ):
            with pytest.raises(error):
                run.finish("a", files=[], facts=facts)
        with pytest.raises(RunFolderError, match=r"0009\.exr"):
            run.finish("a", files=[run.file("raw", 9)], facts={})
        with pytest.raises(ValueError, match="subpath"):
            run.finish("a", files=[folder.parent / "x"], facts={})
        for name in ("../x.json", "/x.json", "run.json", "ledger.jsonl"):
            with pytest.raises(ValueError, match="no name"):
                run.write_json(name, {})
        run.write_json("summary.json", {"slow": 1.5})
        assert list(run.lines()) == []
    assert json.loads((folder / "summary.json").read_text()) == {"slow": 1.5}


def test_a_line_torn_anywhere_is_recovered(folder):
    with Run.open(folder, IDENTITY) as run:
        run.finish("a", files=[], facts={"text": "Zimmer ü\r\n"})
        run.finish("b", files=[], facts={})
    ledger = folder / "ledger.jsonl"
    data = ledger.read_bytes()
    first = data.index(b"\n", data.index(b"\n") + 1) + 1
    for size in range(first, len(data)):
        ledger.write_bytes(data[:size])
        with Run.open(folder, IDENTITY) as run:
            assert [line["unit"] for line in run.lines()] == ["a"]
            assert len(run.notes) == (size > first)
            run.finish("b", files=[], facts={})
        assert ledger.read_bytes() == data


@pytest.mark.parametrize("tail", [b"\0" * 40, b"\0" * 40 + b"\n", b"{}\n", b"\xff\xfe\n", b"[" * 9999])
def test_a_damaged_last_line_is_recovered_and_said(folder, tail):
    with Run.open(folder, IDENTITY) as run:
        run.finish("a", files=[], facts={})
    with (folder / "ledger.jsonl").open("ab") as ledger:
        ledger.write(tail)
    with Run.open(folder, IDENTITY) as run:
        assert run.done("a") is not None
        assert "torn" in run.notes[0]


@pytest.mark.parametrize(
    "bad",
    [
        b"{",
        b"",
        b'{"unit": 3, "files": {}}',
        b'{"unit": "x", "files": {"../a": {"bytes": 1, "sha256": ""}}}',
        b'{"unit": "x", "files": {"a": 1}}',
    ],
)
def test_a_damaged_line_in_the_middle_is_left_out_and_its_unit_done_again(folder, bad):
    with Run.open(folder, IDENTITY) as run:
        for unit in "abc":
            run.finish(unit, files=[], facts={})
    lines = (folder / "ledger.jsonl").read_bytes().splitlines()
    (folder / "ledger.jsonl").write_bytes(b"\n".join([*lines[:2], bad, lines[3], b""]))
    with pytest.raises(RunFolderError, match=r"ledger\.jsonl, line 3 is damaged: run the command"):
        Run.existing(folder)
    assert "line 3 is damaged; it was left out" in Run.existing(folder, is_lenient=True).notes[0]
    with Run.open(folder, IDENTITY) as run:
        assert "line 3 is damaged; its unit is done again" in run.notes[0]
        assert [line["unit"] for line in run.lines()] == ["a", "c"]
        run.finish("b", files=[], facts={})
    assert sorted((folder / "ledger.jsonl").read_bytes().splitlines()) == sorted(lines)


def test_every_flipped_bit_of_the_ledger_is_found(folder):
    with Run.open(folder, IDENTITY) as run:
        for unit in "abc":
            run.finish(unit, files=[write(run, "raw", ord(unit))], facts={"x": 1.5})
        digest = run.digest()
    whole = (folder / "ledger.jsonl").read_bytes()
    for place in range(0, len(whole), 7):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << place % 8
        (folder / "ledger.jsonl").write_bytes(flipped)
        with Run.open(folder, IDENTITY) as run:
            left = {line["unit"] for line in run.lines()}
            assert left < set("abc") or run.digest() == digest
            for unit in set("abc") - left:
                assert run.notes
                run.finish(unit, files=[run.file("raw", ord(unit))], facts={"x": 1.5})
            assert run.digest() == digest


def test_a_full_disk_leaves_the_ledger_as_it_was(folder, monkeypatch):
    with Run.open(folder, IDENTITY) as run:
        run.finish("a", files=[], facts={})
        before = (folder / "ledger.jsonl").read_bytes()
        really = os.write

        def half(handle, data):
            if len(data) < 10:
                raise OSError(28, "No space left on device")
            return really(handle, data[: len(data) // 2])

        with monkeypatch.context() as patch:
            patch.setattr(os, "write", half)
            with pytest.raises(NoSpaceError, match="No space left"):
                run.finish("b", files=[], facts={})
        assert (folder / "ledger.jsonl").read_bytes() == before
        assert run.done("b") is None
        run.finish("b", files=[], facts={})


HOLDER = """
import os, socket, sys, time
from pathlib import Path
from enfilade.store import Run
run = Run.open(Path(sys.argv[1]), {})
name = f".0001.writing-{socket.gethostname()}-{os.getpid()}-01234567.exr"
(Path(sys.argv[1]) / name).write_text("x")
print("held", flush=True)
time.sleep(60)
"""


def test_a_lock_names_its_live_holder_and_goes_with_a_dead_one(folder):
    with subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", HOLDER, str(folder)], stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(RunFolderError, match=rf"process {holder.pid} on .*, since 2\d\d\d-.*--out"):
            Run.open(folder, {})
        assert list(Run.existing(folder).lines()) == []
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        with Run.open(folder, {}) as run:
            assert run.notes == ["removed 1 unfinished files of a run that was interrupted"]
            with pytest.raises(RunFolderError, match=f"process {os.getpid()} "):
                Run.open(folder, {})
    Run.open(folder, {}).close()


def test_a_run_killed_before_it_had_an_identity_begins_anew(folder):
    folder.mkdir(parents=True)
    (folder / "run.lock").write_text("")
    (folder / f".run.writing-{socket.gethostname()}-99999999-01234567.json").write_text(
        "{"
    )  # no such process
    with Run.open(folder, IDENTITY) as run:
        assert "1 unfinished" in run.notes[0]
    assert sorted(f.name for f in folder.iterdir()) == ["ledger.jsonl", "run.json", "run.lock"]


def test_damaged_files_are_found_and_forgotten(folder):
    with Run.open(folder, IDENTITY) as run:
        for number in (1, 2, 3):
            run.finish(f"frame {number}", files=[write(run, "frames", number)], facts={})
        assert run.damaged() == []
        run.file("frames", 1).write_bytes(b"pixelz")
        run.file("frames", 3).unlink()
        assert run.damaged() == ["frames/0001.exr", "frames/0003.exr"]
        with pytest.raises(DamagedFileError) as error:
            run.check(run.file("frames", 1))
        assert run.done("frame 1")
        run.forget(error.value.file)
        assert not run.done("frame 1")
        assert run.done("frame 2")


def test_the_digest_leaves_out_times_and_order(tmp_path):
    digests = []
    for name, units in (("a", "xyz"), ("b", "zxy")):
        with Run.open(tmp_path / name, IDENTITY) as run:
            for unit in units:
                run.finish(unit, files=[write(run, "raw", ord(unit))], facts={"n": unit, "cost": {"t": name}})
            digests.append(run.digest())
            run.finish("x", files=[write(run, "raw", 120, b"other!")], facts={"n": "x"})
            digests.append(run.digest())
    assert digests[0] == digests[2] != digests[1] == digests[3]


def test_who_joins_a_run_reports_and_sees_what_is_finished(folder):
    reported = []
    with Run.open(folder, IDENTITY) as run:
        run.finish("a", files=[], facts={})
        worker = Run.joining(folder, reported.append)
        assert worker.done("a")
        run.finish("b", files=[], facts={})
        assert not worker.done("b")
        worker.refresh()
        assert worker.done("b")
        worker.finish("c", files=[write(worker, "raw", 3)], facts={"n": np.int64(3)})
        assert worker.done("c")["n"] == 3
        assert not run.done("c")
        run.record(reported[0])
        assert run.done("c") == worker.done("c")
        worker.check(worker.file("raw", 3))
    assert [line["unit"] for line in recorded(folder)] == ["a", "b", "c"]


def test_several_commands_share_a_run(folder):
    Run.open(folder, IDENTITY).close()
    with Run.sharing(folder, "one") as one, Run.sharing(folder, "two") as two:
        one.finish("a", files=[], facts={})
        two.refresh()
        assert two.done("a")
        two.finish("b", files=[write(two, "raw", 1)], facts={})
        with pytest.raises(RunFolderError, match=f"another command is writing.*process {os.getpid()}"):
            Run.open(folder, IDENTITY)
        with pytest.raises(RunFolderError, match="another command is writing"):
            Run.sharing(folder, "two")
    assert {line["unit"] for line in Run.existing(folder).lines()} == {"a", "b"}
    with Run.open(folder, IDENTITY) as run:
        assert {line["unit"] for line in run.lines()} == {"a", "b"}
        with pytest.raises(RunFolderError, match="another command is writing"):
            Run.sharing(folder, "three")
    assert [line["unit"] for line in recorded(folder)] == ["a", "b"]
    assert not list((folder / "parts").glob("*.jsonl"))


def opened(monkeypatch):
    """Names of the files that are opened to be read, from now on."""
    names, really = [], Path.open

    def note(file, *how, **more):
        names.append(file.name)
        return really(file, *how, **more)

    monkeypatch.setattr(Path, "open", note)
    return names


def test_a_worker_opens_one_ledger_a_unit(folder, monkeypatch):
    Run.open(folder, IDENTITY).close()
    with Run.sharing(folder, "one") as one, Run.sharing(folder, "two") as two:
        two.finish("a", files=[], facts={})
        worker = Run.joining(folder, print, part="one")
        assert worker.done("a")
        names = opened(monkeypatch)
        one.finish("b", files=[], facts={})
        worker.keep_up()
        assert names == ["one.jsonl"]
        assert worker.done("b")
        one.keep_up()  # it wrote all that it needs itself
        assert names == ["one.jsonl"]
        two.finish("c", files=[write(two, "raw", 1)], facts={})
        worker.check(worker.file("raw", 1))  # of a line that it has not read
        assert worker.done("c")
    with Run.open(folder, IDENTITY) as run:
        worker = Run.joining(folder, print)
        run.finish("d", files=[], facts={})
        worker.keep_up()
        assert worker.done("d")


def test_parts_are_joined_with_one_flush_and_their_locks_go(folder, monkeypatch):
    Run.open(folder, IDENTITY).close()
    for part in range(5):
        with Run.sharing(folder, f"frames-{part}-of-5") as run:
            for unit in range(4):
                run.finish(f"frame {4 * part + unit}", files=[], facts={})
    flushed, really = [], os.fsync

    def flush(handle):
        flushed.append(Path(f"/proc/self/fd/{handle}").readlink())
        really(handle)

    monkeypatch.setattr(os, "fsync", flush)
    with Run.open(folder, IDENTITY) as run:
        assert {line["unit"] for line in run.lines()} == {f"frame {n}" for n in range(20)}
    assert flushed.count(folder / "ledger.jsonl") == 1
    assert folder / "parts" not in {place for name in flushed for place in (name, name.parent)}
    assert list((folder / "parts").iterdir()) == []
    assert len(recorded(folder)) == 20


def test_parts_stay_where_the_disk_is_full(folder, monkeypatch):
    Run.open(folder, IDENTITY).close()
    with Run.sharing(folder, "one") as one:
        one.finish("a", files=[], facts={})

    really = os.fsync

    def full(handle):
        if b'"unit"' in (folder / "ledger.jsonl").read_bytes():
            raise OSError(errno.ENOSPC, "No space left on device")
        really(handle)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(NoSpaceError):
            Run.open(folder, IDENTITY)
    assert (folder / "parts" / "one.jsonl").exists()
    with Run.open(folder, IDENTITY) as run:
        assert run.done("a")
    assert len(recorded(folder)) == 1


def test_what_another_command_has_made_again_is_not_removed(folder):
    Run.open(folder, IDENTITY).close()
    with Run.sharing(folder, "one") as one, Run.sharing(folder, "two") as two:
        file = write(one, "raw", 1)
        one.finish("raw 1", files=[file], facts={})
        two.refresh()
        good = file.read_bytes()
        file.write_bytes(b"damaged"[: len(good)])
        for run in (one, two):
            with pytest.raises(DamagedFileError):
                run.check(file)
        one.forget("raw/0001.exr")
        assert not one.done("raw 1")
        assert one.was_finished("raw 1")
        assert not one.was_finished("raw 2")
        file.write_bytes(good)
        one.finish("raw 1", files=[file], facts={})
        two.forget("raw/0001.exr")
        assert file.read_bytes() == good
        two.check(file)


@pytest.mark.parametrize("name", ["run.lock", "ledger.jsonl"])
def test_links_in_a_foreign_run_folder_lead_nowhere(folder, tmp_path, name):
    (tmp_path / "precious").write_text("keep me")
    Run.open(folder, IDENTITY).close()
    (folder / name).unlink()
    (folder / name).symlink_to(tmp_path / "precious")
    with pytest.raises(RunFolderError, match=r"Too many levels of symbolic links|damaged"):
        Run.open(folder, IDENTITY)
    assert (tmp_path / "precious").read_text() == "keep me"


def test_nothing_outside_the_folder_is_removed(folder, tmp_path):
    with Run.open(folder, IDENTITY) as run:
        run.finish("frame 1", files=[write(run, "frames", 1)], facts={})
        (folder / "frames").rename(tmp_path / "elsewhere")
        (folder / "frames").symlink_to(tmp_path / "elsewhere")
        (tmp_path / "elsewhere" / "0001.exr").write_bytes(b"precious")
        assert run.damaged() == ["frames/0001.exr"]
        with pytest.raises(RunFolderError, match="outside the run folder"):
            run.forget("frames/0001.exr")
    assert (tmp_path / "elsewhere" / "0001.exr").exists()


def test_ten_thousand_units_open_quickly(folder):
    with Run.open(folder, IDENTITY):
        record = {"bytes": 1, "sha256": "0" * 64}
        lines = (json.dumps({"unit": f"u{i}", "files": {f"raw/{i}.exr": record}}) for i in range(10_000))
        (folder / "ledger.jsonl").write_text("\n".join(lines) + "\n")
    with Run.open(folder, IDENTITY) as run:
        assert sum(run.done(f"u{i}") is not None for i in range(10_000)) == 0
        assert len(list(run.lines())) == 10_000


def full(*_arguments, **_options):
    raise OSError(errno.EDQUOT, "Disk quota exceeded")


@pytest.mark.parametrize(
    ("where", "what"),
    [
        ("enfilade.store.lock.os.open", r"run\.lock: no room"),
        ("enfilade.store.ledger._appending", r"ledger\.jsonl: no room"),
        ("pathlib.Path.mkdir", "run: no room"),
    ],
)
def test_a_disk_that_is_full_when_a_command_begins_is_no_wrong_input(folder, monkeypatch, where, what):
    with monkeypatch.context() as patch:
        patch.setattr(where, full)
        with pytest.raises(NoSpaceError, match=what):
            Run.open(folder, IDENTITY)
    Run.open(folder, IDENTITY).close()
    with monkeypatch.context() as patch:
        patch.setattr("pathlib.Path.mkdir", full)
        with pytest.raises(NoSpaceError, match=r"one\.jsonl: no room"):
            Run.sharing(folder, "one")


def test_what_is_taken_over_while_a_run_is_read_is_seen(folder, monkeypatch):
    Run.open(folder, IDENTITY).close()
    with Run.sharing(folder, "one") as one:
        one.finish("a", files=[], facts={})

    def late(of):
        found = part_files(of)
        Run.open(folder, IDENTITY).close()
        return found

    monkeypatch.setattr("enfilade.store.run.part_files", late)
    assert Run.existing(folder).done("a")


@pytest.mark.parametrize("name", ["ledger.jsonl", "parts/one.jsonl"])
def test_who_shares_a_run_is_told_at_once_of_a_line_that_another_damaged(folder, name):
    with Run.open(folder, IDENTITY) as run:
        for unit in "ab":
            run.finish(unit, files=[], facts={})
    with Run.sharing(folder, "one") as one:
        for unit in "cd":
            one.finish(unit, files=[], facts={})
    with Run.sharing(folder, "two") as two:
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data.replace(b'"unit": "a"', b'"unit": "x"').replace(b'"c"', b'"y"'))
        worker = Run.joining(folder, print, part="two")  # who began before goes on, and so do its workers
        assert (worker.done("a") is None) == (name == "ledger.jsonl")
        assert (worker.done("c") is None) == (name != "ledger.jsonl")
        two.finish("e", files=[], facts={})
    with pytest.raises(RunFolderError, match=rf"{name}, line \d is damaged: `enfilade work {folder}`, "):
        Run.sharing(folder, "two")
    with Run.open(folder, IDENTITY) as run:
        left = {line["unit"] for line in run.lines()}
        assert left == set("bcde" if name == "ledger.jsonl" else "abde")
    Run.sharing(folder, "two").close()
