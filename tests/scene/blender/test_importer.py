"""Imports end with a whole scene folder, or with none and a message."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from enfilade.errors import SceneError, SettingsError
from enfilade.images.view import files_of_view
from enfilade.monitor import Silence
from enfilade.scene.blender import process
from enfilade.scene.blender.imported import ImportedScene
from enfilade.scene.blender.importer import import_file
from enfilade.scene.blender.notes import NoteKind, grouped
from enfilade.scene.blender.source import Choices, Source
from enfilade.settings import LimitSettings, VideoSettings, read_tables
from support.fake_blender import NOTE
from support.toys import is_alive, wait_for

OUTSIDE = (
    '<scene version="3.0.0"><shape type="obj"><string name="filename" value="/etc/passwd"/></shape></scene>'
)


@pytest.fixture
def load(program, tmp_path):
    def go(source, out=tmp_path / "scene", monitor=None, choices=None, is_strict=False, **limits):
        return import_file(
            source, out, choices or Choices(), LimitSettings(**limits), monitor or Silence(),
            program=str(program), is_strict=is_strict,
        )  # fmt: skip

    return go


class Seen(Silence):
    def __init__(self):
        self.steps = []

    def progress(self, name, done, total):
        self.steps.append((name, done, total))


def left(folder):
    return sorted(entry.name for entry in folder.iterdir() if entry.suffix != ".calls")


def test_a_scene_folder_is_written(load, shot, tmp_path):
    seen = Seen()
    source = shot()
    made = load(source, monitor=seen)
    assert left(made.folder) == [
        "camera_path.json",
        "import.json",
        "scene.xml",
        "settings.toml",
        "source.json",
    ]
    assert made == ImportedScene.read(tmp_path / "scene")
    assert (made.scene, made.camera, made.fps, made.frames, made.size) == (
        "Scene",
        "Cam",
        24.0,
        (11, 13),
        (64, 48),
    )
    assert read_tables(made.folder / "settings.toml") == {"viewing": {"exposure_ev": 0.5}, "video": {}}
    assert seen.steps == [("import", 50, 100)]
    recorded = Source.read(made.folder)
    assert (recorded.file, recorded.bytes) == (str(source), source.stat().st_size)
    assert recorded.differences(source, Choices()) == []


def test_the_job_and_the_environment(load, shot, monkeypatch, tmp_path):
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", "/scripts")
    monkeypatch.setenv("OCIO", "/config.ocio")
    choices = Choices(camera="Second", size=(32, 24), frames=(5, 6))
    made = load(shot(echo=1), choices=choices, allow=f"/a{os.pathsep}/b", import_instances=7)
    seen = json.loads((made.folder / "seen.json").read_text())
    job, environ = seen["job"], seen["environ"]
    assert (job["task"], job["camera"], job["scene"], job["size"], job["frames"]) == (
        "export", "Second", None, [32, 24], [5, 6],
    )  # fmt: skip
    assert job["library_folders"] == ["/a", "/b"]
    assert job["limits"] == {"instances": 7, "triangles": 50_000_000}
    assert {"PYTHONPATH", "BLENDER_USER_SCRIPTS", "OCIO"}.isdisjoint(environ)
    assert environ["HOME"] != os.environ["HOME"]
    assert (made.camera, made.size, made.frames) == ("Second", (32, 24), (5, 6))


def test_settings_of_the_file_stand_under_those_given(load, shot):
    made = load(shot())
    given = {"viewing": {"exposure_ev": 2.0}, "video": {"codec": "av1"}}
    assert made.tables_under({}) == {"viewing": {"exposure_ev": 0.5}, "video": {}}
    assert made.tables_under(given) == given
    (made.folder / "settings.toml").write_text(
        "[viewing]\nwhite = 16.0\n"
        '[video]\nocio = "colormanagement/config.ocio"\nview = "AgX"\nlook = "Punchy"\n'
    )
    config = str(made.folder / "colormanagement" / "config.ocio")
    assert made.tables_under({"video": {"view": "AgX"}})["video"]["look"] == "Punchy"
    assert made.tables_under({"video": {"view": "Raw"}})["video"] == {"ocio": config, "view": "Raw"}
    given = {"video": {"view": "Raw", "look": "Soft"}}
    assert made.tables_under(given)["video"] == {"ocio": config, **given["video"]}
    assert made.tables_under({})["viewing"] == {"white": 16.0}
    assert made.tables_under({"video": {"view": "Raw"}})["viewing"] == {}
    assert made.tables_under({"video": {"ocio": ""}}) == {"viewing": {}, "video": {"ocio": ""}}
    (made.folder / "settings.toml").write_text("video = 1")
    with pytest.raises(SettingsError, match=r"\[video\] must be a table"):
        made.tables_under({})


def test_an_earlier_import_is_replaced_as_a_whole(load, shot):
    made = load(shot())
    (made.folder / "check.html").touch()
    assert made.path_file is not None
    assert load(shot(camera="")).path_file is None
    assert "check.html" not in left(made.folder)


def test_only_an_imported_scene_is_replaced(load, shot, tmp_path, monkeypatch):
    def refused(words, source=None, out=tmp_path / "scene"):
        source = source or shot()
        before = sorted(file for file in tmp_path.rglob("*") if file.suffix != ".calls")
        with pytest.raises(SceneError, match=words):
            load(source, out)
        assert [file for file in sorted(tmp_path.rglob("*")) if file.suffix != ".calls"] == before

    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "thesis.tex").touch()
    refused("holds no imported scene")
    (tmp_path / "scene" / "thesis.tex").rename(tmp_path / "thesis.tex")
    load(shot())
    (tmp_path / "scene" / "notes.txt").touch()
    refused("the import has not written notes.txt")
    (tmp_path / "scene" / "notes.txt").unlink()
    (tmp_path / "scene" / "textures").mkdir()
    inside = shot("scene/textures/other.blend")
    refused("other.blend is in .*scene, which would be replaced", inside)
    refused("other.blend is in .*scene, which would be replaced", shot(files=[str(inside)]))
    refused("is no folder", out=shot())
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    refused("the working folder is in", out=Path())


@pytest.mark.parametrize(
    ("wish", "limits", "words"),
    [
        ({"do": "refuse"}, {}, r"shot.blend by Blender 4.5.1: it is cut off \(block DATA\); save it again"),
        ({"do": "crash"}, {}, r"killed by SIGSEGV, without.*\n  Read blend: shot.blend\n  Error: .\[31mno"),
        ({"do": "nothing"}, {}, "ended with exit code 0, without a result"),
        ({"do": "eat"}, {"import_mb": 2048}, r"needs more than 2048 MB"),
        ({"do": "hang"}, {"import_s": 1.5}, r"not finished in 1.5 s; raise --set limits.import_s"),
        ({"xml": "<scene"}, {}, "was imported as a scene that can't be used: Mitsuba can't parse"),
        ({"xml": OUTSIDE}, {}, "outside the scene's folder"),
        ({"fps": 0.0}, {}, "its camera can't be used: .*fps"),
        ({"version": 2}, {}, "import.json is damaged"),
        ({"notes": [{"kind": "pink"}]}, {}, "import.json is damaged"),
    ],
)  # fmt: skip
def test_failures_leave_nothing(load, shot, tmp_path, wish, limits, words):
    source = shot(**wish)
    with pytest.raises(SceneError, match=words) as error:
        load(source, **limits)
    assert "\x1b" not in str(error.value)
    assert left(tmp_path) == ["blender", "shot.blend"]


def test_a_failure_keeps_an_earlier_import(load, shot):
    made = load(shot())
    with pytest.raises(SceneError):
        load(shot(do="crash"))
    assert ImportedScene.read(made.folder).camera == "Cam"


def test_a_process_that_hangs_at_its_end_is_ended(load, shot, monkeypatch):
    monkeypatch.setattr(process, "ENDING_S", 0.3)
    assert load(shot(do="hang after")).camera == "Cam"


def test_a_process_that_is_left_behind_is_not_waited_for(load, shot):
    made = load(shot(do="leave a process"))  # which has the pipe for a minute
    os.killpg(int((made.folder / "left.pid").read_text()), signal.SIGKILL)
    assert not (made.folder.parent / "shot.ended").exists()


def test_strict_refuses_what_is_not_carried_over(load, shot, tmp_path):
    notes = [{"kind": "not-carried", **NOTE}, {"kind": "not-carried", **NOTE, "object": "Chair"}]
    source = shot(notes=[*notes, {"kind": "baked", **NOTE}])
    with pytest.raises(
        SceneError, match=r"Sofa / Noise Texture, Chair / Noise Texture: a procedural texture"
    ):
        load(source, is_strict=True)
    assert not (tmp_path / "scene").exists()
    made = load(source)
    assert len(made.notes_of(NoteKind.NOT_CARRIED)) == 2
    first, second = grouped(made.notes)
    assert (first.kind, len(first.places)) == (NoteKind.NOT_CARRIED, 2)
    assert (second.kind, second.listed) == (NoteKind.BAKED, "Sofa / Noise Texture")
    assert "2 not carried over, 0 approximated, 1 baked" in made.summary


def test_a_view_that_is_not_there_is_a_note(load, shot):
    view = {"display": "sRGB", "view_transform": "AgX", "look": "None"}
    made = load(shot(view=view))
    assert read_tables(made.folder / "settings.toml")["video"] == {}
    note = made.notes[0]
    assert (note.kind, note.node) == (NoteKind.NOT_CARRIED, "Color Management")
    assert "view transform AgX on sRGB: " in note.what
    assert ImportedScene.read(made.folder).notes == made.notes


CONFIG = """ocio_profile_version: 2
search_path: luts
roles: {default: lin_rec709}
displays:
  sRGB:
    - !<View> {name: AgX, colorspace: lin_rec709, looks: Soft}
looks:
  - !<Look> {name: Soft, process_space: lin_rec709, transform: !<FileTransform> {src: half.spi1d}}
  - !<Look> {name: Punchy, process_space: lin_rec709, transform: !<FileTransform> {src: half.spi1d}}
colorspaces:
  - !<ColorSpace> {name: lin_rec709}
"""
HALF = "Version 1\nFrom 0.0 1.0\nLength 2\nComponents 1\n{\n0.0\n0.5\n}\n"


def test_the_view_of_the_file_comes_along_with_its_tables(load, shot, tmp_path):
    pytest.importorskip("PyOpenColorIO")
    colors = tmp_path / "4.5" / "datafiles" / "colormanagement"
    (colors / "luts").mkdir(parents=True)
    (colors / "config.ocio").write_text(CONFIG)
    for name in ("half.spi1d", "other.spi1d"):
        (colors / "luts" / name).write_text(HALF)
    made = load(shot(view={"display": "sRGB", "view_transform": "AgX", "look": "Punchy"}))
    assert made.notes == ()
    video = VideoSettings.from_table(made.tables_under({})["video"])
    assert (video.display, video.view, video.look) == ("sRGB", "AgX", "Punchy")
    assert files_of_view(video) == [
        made.folder / "colormanagement" / "config.ocio",
        made.folder / "colormanagement" / "luts" / "half.spi1d",
    ]
    assert not (made.folder / "colormanagement" / "luts" / "other.spi1d").exists()


def test_a_file_without_a_camera(load, shot):
    assert load(shot(camera="")).path_file is None


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("gone.blend", None, "there is no file"),
        ("empty.blend", b"", "is empty"),
        ("walk.json", b"{}", "none of the suffixes"),
        ("folder.blend", "folder", "is a folder"),
    ],
)
def test_files_that_are_refused_at_once(load, tmp_path, name, content, words):
    file = tmp_path / name
    if content == "folder":
        file.mkdir()
    elif content is not None:
        file.write_bytes(content)
    with pytest.raises(SceneError, match=words):
        load(file)


def test_a_change_of_the_source_is_noticed(shot):
    source = shot()
    before = Source.of(source, Choices())
    os.utime(source, (1.0, 1.0))  # copied or touched
    assert before.differences(source, Choices()) == []
    assert before.differences(source, Choices(camera="B")) == ["camera: '' there, 'B' now"]
    shot(more=1)
    assert before.differences(source, Choices()) == [f"{source} has changed since it was imported"]


def test_a_change_of_an_image_or_library_is_noticed(load, shot, tmp_path):
    wood, shelf = tmp_path / "wood.png", tmp_path / "shelf.blend"
    wood.write_bytes(b"oak")
    shelf.write_bytes(b"BLENDER")
    source = shot(files=[str(wood), str(shelf), str(tmp_path / "moved away.png")])
    recorded = Source.read(load(source).folder)
    assert [other.file for other in recorded.others] == [str(wood), str(shelf)]
    os.utime(wood, (1.0, 1.0))
    shelf.unlink()  # the imported scene stands for it
    assert recorded.differences(source, Choices()) == []
    wood.write_bytes(b"elm")
    assert recorded.differences(source, Choices()) == [f"{wood} has changed since it was imported"]


IMPORT = """
import signal
import sys
from pathlib import Path
from enfilade.monitor import Silence
from enfilade.scene.blender.importer import import_file
from enfilade.scene.blender.source import Choices
from enfilade.settings import LimitSettings
source, out, program = sys.argv[1:]
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
import_file(Path(source), Path(out), Choices(), LimitSettings(), Silence(), program=program)
"""


@pytest.mark.parametrize("way", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_blender_ends_with_the_command(load, shot, program, tmp_path, tmp_path_factory, monkeypatch, way):
    source = shot(do="hang")
    calls, scratch = source.with_suffix(".calls"), tmp_path_factory.mktemp("scratch")
    monkeypatch.setenv("TMPDIR", str(scratch))
    monkeypatch.setattr(tempfile, "tempdir", None)  # which it keeps
    line = [sys.executable, "-c", IMPORT, str(source), str(tmp_path / "scene"), str(program)]
    with subprocess.Popen(line, stderr=subprocess.DEVNULL) as command:  # noqa: S603
        try:
            wait_for(lambda: calls.exists() and calls.read_text().endswith("\n"))
            assert is_alive(int(calls.read_text()))
            command.send_signal(way)
            command.wait(60)
        finally:
            command.kill()
    wait_for(lambda: not is_alive(int(calls.read_text())))
    if way != signal.SIGINT:
        assert len(left(tmp_path)) == 3
        assert len(left(scratch)) == 1
        load(shot(), tmp_path / "scene")  # removes both
        shutil.rmtree(tmp_path / "scene")
    assert left(tmp_path) == ["blender", "shot.blend"]
    assert left(scratch) == []
