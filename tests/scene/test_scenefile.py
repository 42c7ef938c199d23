"""A scene is read as Mitsuba reads it: the same parameters, the same files, in the same order."""

import errno
import os
from pathlib import Path

import pytest

from enfilade.errors import SceneError
from enfilade.executors.executor import Failure, FailureKind
from enfilade.scene.mitsuba import MitsubaRenderer
from enfilade.scene.mitsuba.parsed import parsed_demands
from enfilade.scene.scenecheck import check_scene
from enfilade.scene.scenefile import SceneFile, fingerprint, why_unreadable
from enfilade.settings import LimitSettings, TraceSettings

HEAD = '<scene version="3.0.0">'
BALL = HEAD + '<shape type="sphere"/></scene>'
EVIL = HEAD + '<shape type="../evil"/></scene>'


def default(name, value):
    return f'<default name="{name}" value="{value}"/>'


def include(name):
    return f'<include filename="{name}"/>'


def string(value, name="filename"):
    return f'<shape type="obj"><string name="{name}" value="{value}"/></shape>'


def whole(body):
    return f"{HEAD}{body}</scene>"


# What an older version of us judged in place of what Mitsuba reads: the scene, the files beside it.
READ_OTHERWISE = {
    "the longest name": (default("x", "ok") + default("x-y", "/etc/passwd") + string("$x-y"), {}),
    "the longest name, included": (
        default("x", "ok") + default("x-y", "evil.xml") + include("$x-y"),
        {"ok-y": BALL, "evil.xml": EVIL},
    ),
    "a name that begins another": (default("si", "a") + default("size", "/etc") + string("$size/x"), {}),
    "not a letter of ours": (default("a", "ok") + default("aé", "/etc/x") + string("$aé"), {}),
    "a default of an include": (
        include("part.xml") + default("a", "ok") + string("$a"),
        {"part.xml": whole(default("a", "/etc/passwd") + '<shape type="sphere"/>')},
    ),
    "a default after an include": (
        default("a", "/etc/passwd") + include("part.xml"),
        {"part.xml": whole(default("a", "ok") + string("$a"))},
    ),
    "a default's name": (default("n", "x") + default("$n", "/etc/passwd") + string("$x"), {}),
    "an escape": (default("ab", r"\$c") + default("c", "/etc/x") + string("$ab"), {}),
    "a string's name": (default("n", "filename") + string("here.obj", name="$n"), {"../here.obj": "v 0 0 0"}),
    "beside the file that includes": (
        include("sub/part.xml"),
        {"sub/part.xml": whole(include("it.xml")), "sub/it.xml": EVIL, "it.xml": BALL},
    ),
    "before a folder is given": (
        include("it.xml") + '<path value="alt"/>',
        {"it.xml": EVIL, "alt/it.xml": BALL},
    ),
    "in a folder that is given": (
        '<path value="alt"/><path value="b"/>' + include("it.xml"),
        {"b/it.xml": EVIL, "alt/it.xml": BALL},
    ),
}


@pytest.fixture(params=READ_OTHERWISE)
def crooked(request, scene, monkeypatch):
    """A scene that reaches for what is not its own, by a trick."""
    body, files = READ_OTHERWISE[request.param]
    file = scene(body)
    for name, text in files.items():
        (file.parent / name).parent.mkdir(exist_ok=True)
        (file.parent / name).write_text(text)
    monkeypatch.chdir(file.parent.parent)
    return file


def test_what_mitsuba_would_read_is_judged(crooked):
    with pytest.raises(SceneError, match=r"outside the scene's folder|no name of a plugin"):
        check_scene(crooked, LimitSettings())


def test_tricks_are_read_as_mitsuba_does(crooked):
    assert SceneFile(crooked).demands() == parsed_demands(crooked)


INNER = {"sub/part.xml": whole(include("it.xml")), "it.xml": BALL}
LAYOUTS = {
    "beside the scene": (include("sub/part.xml"), INNER),
    "beside the scene, not where a folder is given": (
        '<path value="alt"/>' + include("sub/part.xml"),
        {**INNER, "alt/it.xml": EVIL},
    ),
    "where a folder is given": (
        '<path value="alt"/>' + include("sub/part.xml"),
        {"sub/part.xml": INNER["sub/part.xml"], "alt/it.xml": BALL},
    ),
    "a folder within itself": ('<path value="alt"/><path value="alt"/>' + include("it.xml"),
                               {"alt/it.xml": BALL, "alt/alt/it.xml": EVIL}),
    "a folder by a parameter": (default("p", "alt") + '<path value="$p"/>' + include("it.xml"),
                                {"alt/it.xml": BALL}),
    "a material": ('<shape type="sphere">' + include("it.xml") + "</shape>",
                   {"it.xml": '<bsdf version="3.0.0" type="diffuse" id="d"/>'}),
    "a spectrum": (
        include("sub/part.xml"),
        {"sub/part.xml": whole('<shape type="sphere"><spectrum name="x" filename="it.spd"/></shape>'),
         "it.spd": "400 1\n500 2", "sub/it.spd": "no spectrum"},
    ),
}  # fmt: skip


@pytest.fixture(params=LAYOUTS)
def layout(request, scene):
    """A scene that reads other files, and these."""
    body, files = LAYOUTS[request.param]
    file = scene(body)
    for name, text in files.items():
        (file.parent / name).parent.mkdir(exist_ok=True, parents=True)
        (file.parent / name).write_text(text)
    return file, files


def test_files_are_found_where_mitsuba_finds_them(layout):
    file, files = layout
    ours = SceneFile(file).demands()
    assert ours == parsed_demands(file)
    assert "../evil" not in ours.plugins
    check_scene(file, LimitSettings())
    before = fingerprint(file)
    for name, text in files.items():
        (file.parent / name).write_text(f"{text} ")
    assert fingerprint(file) != before


@pytest.mark.parametrize("name", ["scene.xml", "../scene/scene.xml"])
def test_files_are_found_from_the_folder_of_the_scene(layout, name, monkeypatch):
    monkeypatch.chdir(layout[0].parent)
    assert SceneFile(Path(name)).demands() == parsed_demands(Path(name))


@pytest.mark.parametrize("name", ["scene.xml", "../scene/scene.xml"])
def test_a_scene_without_a_folder_in_its_name(scene, name, monkeypatch):
    file = scene('<path value="alt"/>' + include("it.xml"))
    (file.parent / "alt").mkdir()
    (file.parent / "it.xml").write_text(BALL)
    (file.parent / "alt" / "it.xml").write_text(whole('<shape type="cube"/>'))
    monkeypatch.chdir(file.parent)
    ours = SceneFile(Path(name)).demands()
    assert ours == parsed_demands(Path(name))
    assert ("cube" in ours.plugins) == (name == "scene.xml")  # Mitsuba sees no folder to look in first


def test_a_scene_is_judged_by_all_names_by_which_it_is_loaded(scene, tmp_path, monkeypatch):
    file = scene('<path value="alt"/>' + include("it.xml"))
    (file.parent / "alt").mkdir()
    (file.parent / "alt" / "it.xml").write_text(BALL)
    (file.parent / "it.xml").write_text(EVIL)
    (tmp_path / "links").mkdir()
    (tmp_path / "links" / "scene.xml").symlink_to(file)
    (tmp_path / "links" / "it.xml").symlink_to(file.parent / "alt" / "it.xml")
    (tmp_path / "links" / "alt").symlink_to(file.parent / "alt")
    monkeypatch.chdir(file.parent)
    for name in (Path("scene.xml"), tmp_path / "links" / "scene.xml"):
        assert "../evil" not in SceneFile(name).demands().plugins
        with pytest.raises(SceneError, match="no name of a plugin"):
            check_scene(name, LimitSettings())


def test_what_lies_in_the_working_directory_is_found_from_there(scene, monkeypatch):
    file = scene(include("it.xml"))
    desk = file.parent.parent / "desk"
    desk.mkdir()
    (desk / "it.xml").write_text(whole(include("part.xml")))
    (desk / "part.xml").write_text(BALL)
    monkeypatch.chdir(desk)
    assert SceneFile(file).demands() == parsed_demands(file)


def test_a_file_that_a_longer_name_includes_is_in_the_fingerprint(scene):
    file = scene(default("x", "ok") + default("x-y", "part.xml") + include("$x-y"))
    (file.parent / "part.xml").write_text(BALL)
    before = fingerprint(file)
    (file.parent / "part.xml").write_text(f"{BALL} ")
    assert fingerprint(file) != before


@pytest.mark.parametrize("number", [errno.EIO, errno.EACCES])
def test_what_the_operating_system_says_of_a_file_is_kept(scene, monkeypatch, number):
    file = scene('<shape type="ply"><string name="filename" value="ball.ply"/></shape>')
    (file.parent / "ball.ply").write_text("no mesh")
    assert why_unreadable(file) is None
    really = Path.open

    def fails(self, *how, **more):
        if self.name == "ball.ply":
            raise OSError(number, os.strerror(number))
        return really(self, *how, **more)

    monkeypatch.setattr(Path, "open", fails)
    with pytest.raises(SceneError, match=rf"can't read .*ball\.ply, which .* names: {os.strerror(number)}"):
        fingerprint(file)
    with pytest.raises(SceneError, match="can't load") as said:
        MitsubaRenderer(file, TraceSettings())
    kind = FailureKind.IO if number == errno.EIO else FailureKind.REFUSED
    assert Failure.of(said.value).kind is kind


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (string("$a") + default("a", "ok"), "a parameter of '\\$a' has no <default> before it"),
        (default("", "ok"), "a <default> without a name"),
        ('<shape xmlns="urn:x" type="sphere"/>', "namespaces"),
        ('<shape xmlns:x="urn:x" x:type="sphere"/>', "namespaces"),
    ],
)
def test_what_mitsuba_refuses_is_refused(scene, body, words):
    file = scene(body)
    with pytest.raises(SceneError, match=words):
        check_scene(file, LimitSettings())
    with pytest.raises(SceneError, match="Mitsuba can't load"):
        parsed_demands(file)


def test_a_scene_is_utf_8(scene):
    file = scene("")
    (file.parent / "é").symlink_to("/etc")  # in another encoding, the bytes are another name
    for name in ("cp1252", "iso-8859-1", "utf-16"):
        file.write_text(f'<?xml version="1.0" encoding="{name}"?>{whole(string("é/passwd"))}')
        with pytest.raises(SceneError, match=f"in the encoding '{name}'; save it as UTF-8"):
            check_scene(file, LimitSettings())
    for head in ('<?xml version="1.0" encoding="UTF-8"?>', "\ufeff<?xml version='1.0'?>", ""):
        file.write_text(head + whole(string("é/passwd")))
        with pytest.raises(SceneError, match="outside the scene's folder"):
            check_scene(file, LimitSettings())
    for name in ("utf-16", "utf-16-le", "utf-16-be", "utf-32"):
        file.write_text(whole(""), encoding=name)
        with pytest.raises(SceneError, match="save it as UTF-8"):
            check_scene(file, LimitSettings())
