"""Plugins and files of a scene: only Mitsuba's own, and only those of the allowed folders."""

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import SceneError
from enfilade.renderer import Purpose, RandomKey
from enfilade.runs.failure import Failure, FailureKind
from enfilade.scene.mitsuba.files import check_scene, fingerprint
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from enfilade.settings import LimitSettings
from studies.scenes import write_scene

BALL = '<shape type="sphere"/><emitter type="constant"/>'


def texture(name):
    return f'<texture type="bitmap"><string name="filename" value="{name}"/></texture>'


def include(name):
    return f'<include filename="{name}"/>'


def default(name, value):
    return f'<default name="{name}" value="{value}"/>'


def refused(file, words, **limits):
    with pytest.raises(SceneError, match=words) as error:
        check_scene(file, LimitSettings(**limits))
    assert str(file.parent) in str(error.value)


def test_a_shape_group_inside_an_instance_is_refused(scene):
    group = '<shape type="shapegroup"><shape type="cube"/></shape>'
    file = scene(f'<shape type="instance">{group}</shape><emitter type="constant"/>')
    refused(file, r"holds its shape group: move it to the top of the scene and refer to it by <ref id=")
    named = group.replace(">", ' id="group">', 1)
    check_scene(scene(f'{named}<shape type="instance"><ref id="group"/></shape>'), LimitSettings())


def test_scenes_are_checked_before_a_variant_is_chosen(scene):
    # As by the command, in a process of its own. Mitsuba can't convert transforms and colours there.
    moved = '<transform name="to_world"><translate x="1"/></transform>'
    group = '<shape type="shapegroup" id="group"><shape type="cube"/></shape>'
    light = '<emitter type="constant"><spectrum name="radiance" value="400:1, 700:2"/></emitter>'
    paint = '<bsdf type="diffuse" id="paint"><rgb name="reflectance" value="0.1, 0.2, 0.3"/></bsdf>'
    file = scene(f'{group}<shape type="instance"><ref id="group"/>{moved}</shape>{light}{paint}')
    script = (
        "import sys\nfrom pathlib import Path\n"
        "from enfilade.scene.mitsuba.files import check_scene, fingerprint\n"
        "from enfilade.settings import LimitSettings\n"
        "check_scene(Path(sys.argv[1]), LimitSettings())\nprint(fingerprint(Path(sys.argv[1])))"
    )
    line = [sys.executable, "-c", script, str(file)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == fingerprint(file)


@pytest.mark.parametrize("name", ["room", "atrium"])
def test_the_generated_scenes_pass(name, tmp_path):
    file = write_scene(name, tmp_path, preset="small").scene
    check_scene(file, LimitSettings())
    before = fingerprint(file)
    mesh = next(tmp_path.rglob("*.ply"))
    mesh.write_bytes(mesh.read_bytes() + b" ")
    assert fingerprint(file) != before


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            '<shape type="sphere" id="ball"><float name="radius" value="nan"/></shape>',
            "'radius' of 'sphere ball",
        ),
        ('<shape type="sphere"><point name="center" x="0" y="-inf" z="0"/></shape>', "'center' of 'sphere"),
        (
            '<shape type="cube"><transform name="to_world"><scale value="nan"/></transform></shape>',
            "'to_world'",
        ),
        ('<emitter type="constant"><rgb name="radiance" value="nan 0 0"/></emitter>', "'radiance' of 'const"),
        (
            '<emitter type="point"><spectrum name="intensity" value="400:1, 700:nan"/></emitter>',
            "'intensity'",
        ),
    ],
)
def test_numbers_that_are_not_finite_are_refused(scene, body, words):
    refused(scene(BALL + body), rf"scene\.xml \(line 1, .*{words}.* NaN or infinite; correct it")


@pytest.mark.parametrize("kind", ["../../evil", "/tmp/evil", "Sphere", "", "prb", "blender"])  # noqa: S108
def test_plugins_other_than_mitsubas_are_refused(scene, kind):
    refused(scene(f'<shape type="{kind}"/>'), rf"scene\.xml \(line 1, .*'{kind}' is not one of Mitsuba's")
    scene(f'<shape type="{kind}"/>', "part.xml")
    refused(scene(include("part.xml")), rf"part\.xml .*'{kind}' is not one of Mitsuba's plugins")


def test_a_plugin_in_the_folder_of_the_scene_is_refused(scene):
    file = scene(BALL)
    check_scene(file, LimitSettings())
    (file.parent / "plugins").mkdir()
    (file.parent / "plugins" / "sphere.so").write_bytes(b"")  # which Mitsuba would load
    refused(file, "'sphere' is not one of Mitsuba's plugins")


@pytest.mark.parametrize(
    "body",
    [
        texture("/etc/hostname"),
        texture("../../../../../../../../../../etc/hostname"),
        default("at", "/etc") + texture("$at/hostname"),
        '<path value="/etc"/>' + texture("hostname"),
        texture("link"),
        include("../outside.xml"),
    ],
)
def test_files_in_other_folders_are_refused(scene, tmp_path, body):
    file = scene(body)
    (tmp_path / "outside.xml").write_text(f'<scene version="3.0.0">{BALL}</scene>')
    (file.parent / "link").symlink_to("/etc/hostname")
    refused(file, r"outside the scene's folder; allow it with --allow /")
    check_scene(file, LimitSettings(allow=os.pathsep.join(["/nowhere", "/etc", str(tmp_path)])))


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (texture("gone.exr"), r"uses .*scene/gone\.exr, which is missing"),
        (texture("/etc/gone"), "uses /etc/gone, which is missing"),
        (texture("pipe"), "uses .*pipe, which is missing or not a regular file"),
        (texture("x" * 5000), "File name too long"),
        (include("gone.xml"), 'included file "gone.xml" not found'),
        (include("scene.xml"), "recursion depth"),
        (texture("$which"), r"undefined parameter: \$which"),
        ('<spectrum name="x" filename="gone.spd"/>', 'spectrum from file "gone.spd"$'),
    ],
)
def test_what_is_missing_is_named(scene, body, words):
    file = scene(body)
    os.mkfifo(file.parent / "pipe")
    refused(file, words)


def test_a_loop_of_links_is_no_scene(tmp_path):
    (tmp_path / "scene.xml").symlink_to(tmp_path / "scene.xml")
    refused(tmp_path / "scene.xml", "there is no scene file")


def test_a_path_that_is_not_utf_8_is_refused(tmp_path):
    folder = tmp_path / os.fsdecode(b"sc\xe9ne")
    folder.mkdir()
    (folder / "scene.xml").write_text('<scene version="3.0.0"/>')
    with pytest.raises(SceneError, match=r"sc\\xe9ne.scene\.xml is not UTF-8.*: rename"):
        check_scene(folder / "scene.xml", LimitSettings())


def test_no_file_is_quoted(scene, tmp_path):
    (tmp_path / "secret").write_text("password\n")
    file = scene('<spectrum name="x" filename="../secret"/>')
    with pytest.raises(SceneError, match="failed to load spectrum") as error:
        check_scene(file, LimitSettings())
    assert "password" not in str(error.value)


@pytest.mark.parametrize(
    "data", [b"", b"\0", b"<scene>", b"BLENDER-v402", b'<scene version="3">\xff</scene>']
)
def test_what_is_no_scene(tmp_path, data):
    file = tmp_path / "scene.xml"
    file.write_bytes(data.replace(b"\xff", b'<shape type="\xff"/>'))
    refused(file, "Mitsuba can't parse|is not UTF-8")
    file.unlink()
    refused(file, "there is no scene file")


NAMED = {
    '<path value="alt"/>' + texture("a"): "alt/a",
    '<path value="alt"/>' + texture("both"): "alt/both",
    texture("both"): "both",
    include("sub/part.xml"): "both",
    include("sub/part.xml") + " ": "sub/part.xml",
    default("which", "kept") + texture("$which"): "kept",
    '<spectrum name="x" filename="kept"/>': "kept",
}


@pytest.mark.parametrize(("body", "file"), NAMED.items())
def test_the_fingerprint_follows_the_files_that_mitsuba_reads(scene, body, file):
    written = scene(body)
    scene(texture("both"), "sub/part.xml")
    for name in ("alt/a", "alt/both", "both", "kept", "sub/both"):
        (written.parent / name).parent.mkdir(exist_ok=True)
        (written.parent / name).write_text("400 1\n500 2")
    before = fingerprint(written)
    (written.parent / "sub" / "both").write_text("other")
    assert fingerprint(written) == before
    named = written.parent / file
    named.write_text(named.read_text().replace("2", "3") + " ")
    assert fingerprint(written) != before


@pytest.mark.parametrize("number", [errno.EIO, errno.EACCES])
def test_the_error_of_the_operating_system_is_kept(scene, monkeypatch, number):
    file = scene('<shape type="ply"><string name="filename" value="ball.ply"/></shape>')
    (file.parent / "ball.ply").write_text("no mesh")
    really = Path.open

    def fails(self, *how, **more):
        if self.name == "ball.ply":
            raise OSError(number, os.strerror(number), str(self))
        return really(self, *how, **more)

    monkeypatch.setattr(Path, "open", fails)
    with pytest.raises(SceneError, match=rf"can't read .*ball\.ply, which .* uses: {os.strerror(number)}"):
        fingerprint(file)
    with pytest.raises(SceneError, match="can't read") as said:
        MitsubaRenderer(file)
    kind = FailureKind.ERROR if number == errno.EIO else FailureKind.FATAL
    assert Failure.of(said.value).kind is kind


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            '<emitter type="point"><spectrum type="blackbody" name="intensity"/></emitter>',
            r"scene\.xml.*: blackbody can't be rendered here; write <rgb>",
        ),
        ('<emitter type="timed_sunsky"/>', r"scene\.xml.*: timed_sunsky can't .* <emitter type=\"sunsky\">"),
        (
            '<emitter type="constant"><rgb name="radiance" value="$light"/></emitter>',
            r'undefined parameter: \$light.*; add <default name="light" value="..."/> to it',
        ),
    ],
)
def test_refusals_name_the_replacement(scene, body, words):
    refused(scene(BALL + body), words)


@pytest.mark.parametrize(
    "emitter",
    [
        '<emitter type="directional" id="sun">{}</emitter>',
        '<emitter type="sunsky" id="sun"><vector name="sun_direction" x="0.3" y="1" z="0.2"/>{}</emitter>',
        '<emitter type="envmap" id="sun"><string name="filename" value="sky.pfm"/>{}</emitter>',
    ],
)
@pytest.mark.parametrize("after", ["", '<rotate x="1" angle="-70"/>'])
def test_the_scale_of_an_emitter_changes_no_light(scene, emitter, after):
    def mean(transform):
        place = f'<transform name="to_world"><rotate y="1" angle="90"/>{transform}{after}</transform>'
        renderer = MitsubaRenderer(scene('<shape type="sphere"/>' + emitter.format(place)))
        camera = Camera(look_at((0, 0, 6), (0, 0, 0)), 25, 8, 8)
        key, pixels = RandomKey(1, 0, Purpose.REFERENCE), np.arange(64, dtype=np.uint32)
        return renderer.trace(camera, pixels, key, spp=16).color.mean(), renderer.describe().notes

    sky = np.full((4, 8, 3), 0.2, np.float32)
    sky[1, 3] = 9.0
    (scene("").parent / "sky.pfm").write_bytes(b"PF\n8 4\n-1.0\n" + sky.tobytes())
    plain, none = mean("")
    scaled, notes = mean('<scale x="2" y="3" z="2"/>')
    assert none == ()
    assert scaled == pytest.approx(plain, rel=1e-4)
    assert re.search(r"^\S*scene\.xml .*: the to_world of the \w+ emitter sun has a scale", notes[0])
    with pytest.raises(SceneError, match=r"emitter sun scales by zero"):
        mean('<scale value="0"/>')
