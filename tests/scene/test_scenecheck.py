"""Scenes that reach for what is not theirs are refused before Mitsuba reads them."""

import os
import struct
import zlib

import pytest

from enfilade.errors import SceneError
from enfilade.scene.scenecheck import check_scene
from enfilade.scene.scenefile import fingerprint
from enfilade.settings import LimitSettings
from studies.scenes import write_scene


def refused(file, words, **limits):
    with pytest.raises(SceneError, match=words) as error:
        check_scene(file, LimitSettings(**limits))
    assert str(file.parent) in str(error.value)


def texture(name):
    return f'<texture type="bitmap"><string name="filename" value="{name}"/></texture>'


def test_a_plain_scene_passes(scene):
    file = scene(f'<shape type="sphere"><bsdf type="diffuse">{texture("picture.exr")}</bsdf></shape>')
    assert [f.name for f in check_scene(file, LimitSettings())] == ["picture.exr"]


@pytest.mark.parametrize("name", ["room", "atrium"])
def test_the_generated_scenes_pass(name, tmp_path):
    files = write_scene(name, tmp_path, preset="small")
    named = check_scene(files.scene, LimitSettings())
    assert set(named) >= {f.resolve() for f in tmp_path.rglob("*.pfm")}
    assert named


@pytest.mark.parametrize("kind", ["../../evil", "/tmp/evil", "Sphere", "a b", "", "$which", "sphere&#10;"])  # noqa: S108
def test_names_of_plugins(scene, kind):
    refused(scene(f'<shape type="{kind}"/>'), "no name of a plugin|has no <default>")


def test_memory_of_blender_is_not_read(scene):
    refused(
        scene('<shape type="blender"><integer name="verts" value="4096"/></shape>'), "only Blender itself"
    )


def test_parameters_are_filled_in_before_they_are_judged(scene):
    head = '<scene version="3.0.0"><default name="kind" value="../evil"/><default name="at" value="/etc"/>'
    refused(scene('<shape type="$kind"/>', head), "no name of a plugin")
    refused(scene(texture("$at/passwd"), head), "outside the scene's folder")
    loop = '<scene version="3.0.0"><default name="a" value="$b$b"/><default name="b" value="$a"/>'
    refused(scene(texture("$a"), loop), "has no <default>")


@pytest.mark.parametrize(
    "body",
    [
        texture("/etc/passwd"),
        texture("../../../../etc/passwd"),
        '<include filename="/etc/passwd"/>',
        '<path value="/etc"/>',
        '<spectrum name="x" filename="/etc/passwd"/>',
        '<shape type="x"><string name="table" value="/etc/passwd"/></shape>',
        '<texture type="bitmap"><string value="/etc/passwd" name="filename"/></texture>',
    ],
)
def test_files_elsewhere(scene, body):
    refused(scene(body), r"outside the scene's folder; allow it with --allow /")


def test_links_that_lead_out(scene, tmp_path):
    file = scene(texture("link.exr"))
    (tmp_path / "elsewhere").mkdir()
    (file.parent / "picture.exr").rename(tmp_path / "elsewhere" / "p.exr")
    (file.parent / "link.exr").symlink_to(tmp_path / "elsewhere" / "p.exr")
    refused(file, "outside the scene's folder")
    allowed = os.pathsep.join(["/nowhere", str(tmp_path / "elsewhere")])
    assert len(check_scene(file, LimitSettings(allow=allowed))) == 1


def test_includes_are_read_too(scene):
    file = scene('<include filename="part.xml"/>')
    part = file.parent / "part.xml"
    part.write_text('<scene version="3.0.0"><shape type="../evil"/></scene>')
    refused(file, "no name of a plugin")
    part.write_text('<scene version="3.0.0"><include filename="part.xml"/></scene>')
    refused(file, "more than 16 deep")
    part.unlink()
    refused(file, "can't read the scene")


@pytest.fixture
def elsewhere(scene, tmp_path, monkeypatch):
    """Files that Mitsuba finds in other folders than beside what names them; who names each, and the file."""
    (tmp_path / "desk").mkdir()
    monkeypatch.chdir(tmp_path / "desk")
    folder = scene("").parent
    for name in ("alt/a", "alt/both", "both", "shared", "spectrum", "../desk/here", "kept"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(name)
    (folder / "sub").mkdir()
    (folder / "sub" / "part.xml").write_text(f'<scene version="3.0.0">{texture("shared")}</scene>')
    return folder


NAMED = {
    '<path value="alt"/>' + texture("a"): "alt/a",
    texture("a") + '<path value="alt"/>': "alt/a",
    '<path value="alt"/>' + texture("both"): "alt/both",
    '<path value="alt"/>' + texture("kept"): "kept",
    '<include filename="sub/part.xml"/>': "shared",
    '<default name="which" value="kept"/>' + texture("$which"): "kept",
    '<spectrum name="x" filename="spectrum"/>': "spectrum",
    texture("here"): "../desk/here",
}


@pytest.mark.parametrize(("body", "file"), NAMED.items())
def test_files_are_looked_for_as_mitsuba_does(scene, elsewhere, body, file):
    written, file = scene(body), (elsewhere / file).resolve()
    before = fingerprint(written)
    if file.is_relative_to(elsewhere):
        assert file in check_scene(written, LimitSettings())
    else:
        refused(written, "outside the scene's folder")
    file.write_text("other")
    changed = fingerprint(written)
    file.unlink()
    assert len({before, changed, fingerprint(written)}) == 3


def test_links_in_other_folders_are_followed(scene, elsewhere):
    (elsewhere / "alt" / "out").symlink_to("/etc/hostname")
    refused(scene('<path value="alt"/>' + texture("out")), "outside the scene's folder")


def test_folders_that_an_included_file_gives_are_refused(scene, elsewhere):
    (elsewhere / "sub" / "part.xml").write_text('<scene version="3.0.0"><path value="alt"/></scene>')
    refused(scene('<include filename="sub/part.xml"/>'), "does not look in the <path> of an included file")


@pytest.mark.parametrize("name", ["pipe", "device"])
def test_what_is_no_ordinary_file(scene, name):
    file = scene(texture(name))
    os.mkfifo(file.parent / name)
    refused(file, "no ordinary file")


BOMB = '<!DOCTYPE s [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><scene version="3.0.0">&b;'


@pytest.mark.parametrize(
    ("text", "words"),
    [(BOMB, "document type"), ("<scene>", "not well-formed"), ("\0", "or none; save it as UTF-8"),
     ("", "not well-formed"), ('<?xml version="1.0" encoding="latin-99"?><scene/>', "XML")],
)  # fmt: skip
def test_what_is_no_scene(scene, text, words):
    file = scene("")
    file.write_text(text)
    refused(file, words)


@pytest.mark.parametrize("value", ["1000000000000", "-4", "x", "0x10"])
def test_films_are_bounded(scene, value):
    film = f'<film type="hdrfilm"><integer name="width" value="{value}"/></film>'
    refused(scene(f'<sensor type="perspective">{film}</sensor>'), "a film")


@pytest.mark.parametrize(
    ("head", "name"),
    [
        ('<scene version="3.0.0"><default name="w" value="width"/>', "$w"),
        ('<scene version="0.6.0">', "cropWidth"),  # which Mitsuba reads as crop_width
    ],
)
def test_films_are_bounded_by_whatever_name(scene, head, name):
    sides = f'<integer name="{name}" value="900000000"/>'
    refused(scene(f'<sensor type="perspective"><film type="hdrfilm">{sides}</film></sensor>', head), "a film")


def test_films_are_bounded_by_a_setting(scene):
    sides = '<integer name="width" value="40000"/><integer name="height" value="30000"/>'
    file = scene(f'<sensor type="perspective"><film type="hdrfilm">{sides}</film></sensor>')
    refused(file, r"1200 million pixels; at most 268 are taken: raise --limits-megapixels")
    check_scene(file, LimitSettings(megapixels=1200))


def test_pictures_are_bounded_by_their_headers(scene):
    file = scene(texture("large.png"))
    chunk = b"IHDR" + struct.pack(">IIBBBBB", 90_000, 90_000, 8, 2, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
    (file.parent / "large.png").write_bytes(data)
    refused(file, "8100 million pixels|no picture that can be read")
    (file.parent / "large.png").write_bytes(b"GIF89a")
    refused(file, "no picture")
    file = scene(texture("sky.hdr"))
    (file.parent / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999 +X 99999\n")
    refused(file, "9999.8 million pixels")
    (file.parent / "sky.hdr").write_bytes(b"#?RADIANCE\n\n-Y x +X 9\n")
    refused(file, "without a size")
    file = scene(texture("map.pfm"))
    (file.parent / "map.pfm").write_bytes(b"PF\n40000 30000\n-1.0\n\0")
    refused(file, "1200 million pixels")
    (file.parent / "map.pfm").write_bytes(b"PF\n4 ")
    refused(file, "without a size")


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (
            "ply\nformat binary_little_endian 1.0\nelement vertex 900000000\nend_header\n",
            "900 million elements",
        ),
        ("ply\nformat binary_little_endian 1.0\nelement face 9000\nend_header\n", "too short"),
        ("ply\nelement vertex 3\n", "header is damaged"),
        ("solid", "no PLY"),
    ],
)
def test_meshes_are_bounded_by_their_headers(scene, header, words):
    file = scene('<shape type="ply"><string name="filename" value="mesh.ply"/></shape>')
    (file.parent / "mesh.ply").write_text(header)
    refused(file, words)


def test_files_that_can_not_be_read(scene, monkeypatch):
    file = scene(texture("picture.exr"))

    def fails(self, *_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("enfilade.scene.scenecheck.pixels", fails)  # root may read all
    refused(file, r"can't read .*picture\.exr: Permission denied")


def test_large_files(scene):
    file = scene(texture("huge.bin"))
    with (file.parent / "huge.bin").open("wb") as raw:
        raw.truncate(3_000_000)
    check_scene(file, LimitSettings(file_mb=3))
    with (file.parent / "huge.bin").open("ab") as raw:
        raw.write(b"x")
    refused(file, "at most 3 are taken: raise --limits-file-mb", file_mb=3)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("room.blend", "mitsuba-blender add-on .*docs/camera-paths"),
        ("walk.json", "camera path is given by --path"),
    ],
)
def test_what_is_no_scene_says_what_to_do(tmp_path, name, words):
    (tmp_path / name).write_bytes(b"BLENDER-v402")
    refused(tmp_path / name, words)
    (tmp_path / name).unlink()
    refused(tmp_path / name, "No such file")
