"""A run's frames once more as a video, and what a folder that holds them says of it."""

import dataclasses
import shlex
import socket

import numpy as np
import pytest
from click.testing import CliRunner

from enfilade.cli import main
from enfilade.errors import DamagedFileError, RunFolderError, SettingsError, UnfinishedError
from enfilade.images import open_sequence
from enfilade.monitor import Silence
from enfilade.pipeline.encode import encode
from enfilade.pipeline.walkthrough import prepare
from enfilade.settings import Settings
from enfilade.store import Run
from scenes_analytic import room, room_walk
from small_runs import Told, colors, job_of, rendered

FRAMES = 4


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A finished run of four frames at 25 fps, and its job."""
    folder = tmp_path_factory.mktemp("encoded")
    video, viewing = {"codec": "ffv1"}, {"exposure_ev": -1.0}
    job = job_of(
        folder, room(), room_walk(FRAMES, fps=25.0), method="reference", video=video, viewing=viewing
    )
    _, run = rendered(folder, job)
    return job, run


def changed(job, **tables):
    old = job.settings.to_tables()
    new = {name: {**table, **tables.get(name, {})} for name, table in old.items()}
    return dataclasses.replace(job, settings=Settings.from_tables(new))


def test_what_is_not_said_is_as_the_run_has_it(made, tmp_path):
    _, run = made
    file = encode(run, {}, Silence(), file=tmp_path / "again.mkv")
    again, own = open_sequence(file), open_sequence(run / "video.mkv")
    assert (len(again), again.fps, again.width, again.height) == (FRAMES, 25.0, own.width, own.height)
    assert all(np.array_equal(a, b) for a, b in zip(again, own, strict=True))


def test_another_exposure_and_codec(made, tmp_path):
    _, run = made
    before = {f: f.read_bytes() for f in run.iterdir() if f.is_file()}
    changes = {"video": {"codec": "prores"}, "viewing": {"exposure_ev": 0.0, "diagonal_m": 1.0}}
    file = encode(run, changes, Silence())
    assert file == run / "encoded.mov"
    shown = np.stack(list(open_sequence(file)))
    assert abs(shown - np.clip(colors(run), 0, 1)).mean() < 0.01  # a stop more than the run's video
    file.unlink()
    assert {f: f.read_bytes() for f in run.iterdir() if f.is_file()} == before


@pytest.mark.parametrize(
    ("name", "overwritten", "error", "words"),
    [
        ("video.mkv", True, RunFolderError, "the run's own"),
        ("clips/0001.mkv", True, RunFolderError, "the run's own"),
        ("clips/0241.mkv", False, RunFolderError, "the run's own"),
        ("there.mkv", False, RunFolderError, "there already; choose another --out, or add --overwrite"),
        ("there.mkv", True, None, ""),
        ("a.mp4", False, SettingsError, "end in .mkv"),
    ],
)
def test_no_file_is_replaced_without_being_told(made, name, overwritten, error, words):
    _, run = made
    (run / "there.mkv").write_text("mine")
    own = (run / "video.mkv").read_bytes()
    if error is None:
        encode(run, {}, Silence(), file=run / name, is_replaced=overwritten)
        assert len(open_sequence(run / name)) == FRAMES
    else:
        with pytest.raises(error, match=words):
            encode(run, {}, Silence(), file=run / name, is_replaced=overwritten)
        assert (run / "there.mkv").read_text() == "mine"
    assert (run / "video.mkv").read_bytes() == own
    (run / "there.mkv").unlink()


def test_frames_that_are_missing_are_named_or_left_out(made, tmp_path):
    job, _ = made
    prepare(job, tmp_path / "begun")
    with pytest.raises(UnfinishedError, match=r"0 of 4 frames, 1-4 are missing; `enfilade work .*` makes"):
        encode(tmp_path / "begun", {}, Silence(), is_partial=True)
    _, part = rendered(tmp_path, job, "part")
    (part / "frames" / "0002.exr").unlink()
    with pytest.raises(UnfinishedError, match=r"3 of 4 frames, 2 are missing.* --unfinished") as error:
        encode(part, {}, Silence())
    assert error.value.units == ("frame 2",)
    assert len(open_sequence(encode(part, {}, Silence(), is_partial=True))) == 3


class Meanwhile(Silence):
    """Does something when a frame has been encoded."""

    def __init__(self, act):
        self.advance = lambda *_: act()


def test_who_has_the_folder_to_himself_leaves_what_is_being_encoded(made):
    _, run = made
    identity, notes = Run.existing(run).identity, []
    killed = f"{socket.gethostname()}-99999999-01234567"  # no such process
    (run / f".lost.writing-{killed}.mkv").write_text("x")
    (run / "frames" / f".0001.writing-{killed}.exr").write_text("x")

    def open_it():
        with Run.open(run, identity) as sole:
            notes.extend(sole.notes)

    encode(run, {}, Meanwhile(open_it), file=run / "meanwhile.mkv")
    assert len(open_sequence(run / "meanwhile.mkv")) == FRAMES
    (run / "meanwhile.mkv").unlink()
    open_it()
    assert notes == ["removed 2 unfinished files of a run that was interrupted"]
    assert not list(run.rglob(".*writing*"))


def test_a_damaged_frame_is_not_encoded(made, tmp_path):
    job, _ = made
    _, run = rendered(tmp_path, job)
    frame = run / "frames" / "0003.exr"
    data = bytearray(frame.read_bytes())
    data[-1] ^= 1
    frame.write_bytes(data)
    with pytest.raises(DamagedFileError, match=r"0003\.exr"):
        encode(run, {}, Silence())
    assert not (run / "encoded.mkv").exists()


@pytest.mark.parametrize(
    "tables",
    [
        {"video": {"codec": "h264", "quality": 20}},
        {"viewing": {"exposure_ev": 1.5}},
        {"viewing": {"exposure_ev": 1.5}, "video": {"codec": "prores"}},
    ],
)
def test_the_refusal_names_a_command_that_works(made, tables, tmp_path):
    job, run = made
    with pytest.raises(RunFolderError, match="holds another run") as error:
        prepare(changed(job, **tables), run)
    line = next(line for line in str(error.value).splitlines() if "enfilade encode" in line)
    words = shlex.split(line.split("`")[1])
    suffix = {"h264": "mp4", "prores": "mov"}.get(tables.get("video", {}).get("codec"), "mkv")
    out = tmp_path / f"a.{suffix}"
    result = CliRunner().invoke(main, [*words[1:], "--out", str(out), "--quiet"])
    assert result.exit_code == 0, result.output
    assert result.output == f"video   {out}\n"
    assert len(open_sequence(out)) == FRAMES


def test_the_refusal_names_no_command_where_frames_would_differ(made):
    job, run = made
    for tables in ({"viewing": {"diagonal_m": 1.0}}, {"video": {"codec": "h264"}, "trace": {"spp": 5}}):
        with pytest.raises(RunFolderError, match="holds another run") as error:
            prepare(changed(job, **tables), run)
        assert "enfilade encode" not in str(error.value)


def test_flags_beat_the_file_and_both_beat_the_run(made, tmp_path):
    _, run = made
    file = tmp_path / "look.toml"
    file.write_text('[viewing]\nexposure_ev = 0.0\n[video]\ncodec = "prores"\n[trace]\nspp = 3\n')
    words = ["encode", str(run), "--settings", str(file), "--codec", "ffv1", "--out", str(tmp_path / "a.mkv")]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    shown = np.stack(list(open_sequence(tmp_path / "a.mkv")))
    np.testing.assert_allclose(shown, np.clip(colors(run), 0, 1), atol=2e-3)
    assert Run.existing(run).identity["settings"]["viewing"]["exposure_ev"] == -1.0


OCIO = """ocio_profile_version: 2
search_path: "."
roles: {default: raw, scene_linear: lin_rec709}
displays:
  sRGB:
    - !<View> {name: Plain, colorspace: encoded}
active_displays: []
active_views: []
colorspaces:
  - !<ColorSpace> {name: raw, isdata: true}
  - !<ColorSpace> {name: lin_rec709}
  - !<ColorSpace>
    name: encoded
    from_scene_reference: !<FileTransform> {src: look.cube, interpolation: linear}
"""


def write_look(folder, middle):
    """A configuration whose only view bends the curve of a table."""
    folder.mkdir(exist_ok=True)
    (folder / "config.ocio").write_text(OCIO)
    rows = "".join(f"{v} {v} {v}\n" for v in (0.0, middle, 1.0))
    (folder / "look.cube").write_text(f"LUT_1D_SIZE 3\n{rows}")
    return str(folder / "config.ocio")


def test_a_run_is_another_where_its_view_is(made, tmp_path, monkeypatch):
    ocio = pytest.importorskip("PyOpenColorIO")
    job, run = made
    look = changed(job, video={"ocio": write_look(tmp_path / "look", 0.6)})
    prepare(look, tmp_path / "run")
    prepare(look, tmp_path / "run")  # the same look is the same run
    write_look(tmp_path / "look", 0.7)
    ocio.ClearAllCaches()  # as in another process
    with pytest.raises(RunFolderError, match=r"holds another run:\n  view\.processor: ") as error:
        prepare(look, tmp_path / "run")
    assert "everything but the video" in str(error.value)
    assert f"`enfilade encode {tmp_path / 'run'}`" in str(error.value)
    write_look(tmp_path / "look", 0.6)
    ocio.ClearAllCaches()
    prepare(look, tmp_path / "run")
    monkeypatch.setattr(ocio, "GetVersion", lambda: "99.0")
    with pytest.raises(RunFolderError, match=r"versions\.opencolorio: .* \"99\.0\" now"):
        prepare(look, tmp_path / "run")
    with pytest.raises(RunFolderError, match="opencolorio") as error:
        prepare(look, run)
    assert f"--video-ocio {tmp_path}" in str(error.value)
    assert "opencolorio" not in Run.existing(run).identity["versions"]


def test_what_should_be_known_of_the_video_is_said_first(made, tmp_path):
    pytest.importorskip("PyOpenColorIO")
    job, _ = made
    odd = dataclasses.replace(job, path=room_walk(1, size=(97, 73)))
    told = Told()
    rendered(tmp_path, changed(odd, video={"codec": "h264"}), "odd", told)
    assert len(told.said) == 1
    assert "97x73 pixels" in told.said[0]
    assert "--size 96x72" in told.said[0]
    told = Told()
    rendered(tmp_path, changed(odd, video={"ocio": write_look(tmp_path / "look", 0.6)}), "seen", told)
    assert len(told.said) == 1
    assert "not by a view of" in told.said[0]
    told = Told()
    rendered(tmp_path, odd, "plain", told)
    assert not told.said


def test_another_configuration_leaves_the_view_of_the_run(made, tmp_path):
    pytest.importorskip("PyOpenColorIO")
    job, _ = made
    look = changed(job, video={"ocio": write_look(tmp_path / "look", 0.6), "view": "Plain"})
    _, run = rendered(tmp_path, look)
    plain = encode(run, {"video": {"ocio": ""}}, Silence(), file=tmp_path / "plain.mkv")
    again = encode(run, {}, Silence(), file=tmp_path / "again.mkv")
    own = [np.stack(list(open_sequence(f))) for f in (run / "video.mkv", again, plain)]
    np.testing.assert_array_equal(own[0], own[1])
    assert abs(own[0] - own[2]).max() > 0.02
