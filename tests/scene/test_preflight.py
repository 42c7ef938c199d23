"""The preflight process reports problems of a scene, and outlives neither its time limit nor its parent."""

import json
import os
import re
import select
import signal
import subprocess
import sys
import time

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image

from enfilade.errors import SceneError
from enfilade.scene.opener import Scene
from enfilade.scene.preflight import Preflight, preflight
from enfilade.settings import LimitSettings, Settings, TraceSettings

HOT = '<spectrum name="intensity" type="blackbody"><float name="temperature" value="4000"/></spectrum>'
BALL = '<shape type="sphere"/><emitter type="constant"/>'


def checked(file, max_depth=0, **limits):
    return preflight(file, TraceSettings(max_depth=max_depth), LimitSettings(**limits), "llvm_ad_rgb")


def test_it_reports_why_lobes_are_inseparable(scene):
    assert checked(scene(BALL)) == Preflight()
    for depth in (3, 4):
        found = checked(scene(BALL), max_depth=depth).why_inseparable
        assert found == f"its paths end at depth {depth} (--max-depth 5 or more continues them)"


FOG = """<shape type="cube"><bsdf type="null"/><medium type="homogeneous" name="interior">
<float name="sigma_t" value="1"/></medium></shape><emitter type="constant"/>"""

CLIP = '<sensor type="perspective"><float name="{}" value="{}"/></sensor>'
SENSORS = f"""<sensor type="perspective"/><sensor type="orthographic"/><sensor type="thinlens">
<float name="aperture_radius" value="0.1"/><float name="focus_distance" value="2"/></sensor>
{CLIP.format("near_clip", 0.03)}{CLIP.format("near_clip", 0.04)}{CLIP.format("far_clip", 3)}"""


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            f'{SENSORS}{BALL}<shape type="disk" id="slit"><emitter type="directionalarea"/></shape>',
            [
                *("OrthographicCamera", "ThinLensCamera", "of 0.04 to 10000 alone", "of 0.01 to 3 al"),
                "the emitter of slit is a directionalarea",
            ],
        ),
        (
            (
                '<shape type="sphere"><transform name="to_world"><scale x="2"/></transform></shape>'
                '<emitter type="constant"/>'
            ),
            ["Mitsuba warns (Sphere): 'to_world' transform shouldn't contain non-uniform"],
        ),
        (f'<integrator type="path"/>{FOG}', ["participating media"]),
        (f'<integrator type="volpath"/>{FOG}', []),
    ],
)
def test_it_reports_what_frames_will_not_show(scene, body, words):
    notes = checked(scene(body)).notes
    assert len(notes) == len(words)
    assert all(word in note for word, note in zip(words, notes, strict=True))


def test_it_reports_warnings_of_mitsuba_and_leaves_its_log_as_it_was(scene):
    image = '<texture type="bitmap" name="reflectance"><string name="filename" value="bright.pfm"/></texture>'
    shape = f'<shape type="sphere"><bsdf type="diffuse">{image}</bsdf></shape>'
    file = scene(f'{shape}{shape}<emitter type="constant"/>')
    (file.parent / "bright.pfm").write_bytes(
        b"PF\n8 4\n-1.0\n" + np.full((4, 8, 3), 2.0, np.float32).tobytes()
    )
    (note,) = checked(file).notes
    assert re.search(r'^Mitsuba warns: .*"bright.pfm" contains pixels that exceed', note)

    def log():
        logger = mi.logger()
        appenders = [logger.appender(i) for i in range(logger.appender_count())]
        return logger.log_level(), logger.formatter(), appenders

    before = log()
    assert Scene(file).open(Settings()).describe().notes == (note,)
    assert log() == before


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_images_with_values_that_are_not_finite_are_refused(scene, value):
    picture = np.ones((4, 8, 3), np.float32)
    picture[2, 5, :2] = value
    image = '<texture type="bitmap" name="reflectance"><string name="filename" value="bad.pfm"/></texture>'
    shape = f'<shape type="sphere"><bsdf type="diffuse">{image}</bsdf></shape>'
    file = scene(f'{shape}<emitter type="constant"/>')
    (file.parent / "bad.pfm").write_bytes(b"PF\n8 4\n-1.0\n" + picture[::-1].tobytes())
    with pytest.raises(SceneError, match=r"has 2 values that are NaN .*, first in row 2, column 5 of 8x4"):
        checked(file)


def test_what_its_process_prints_is_not_its_answer(scene, tmp_path, monkeypatch):
    printing = "import atexit, os\natexit.register(os.write, 1, b'a plugin says')\n"
    (tmp_path / "sitecustomize.py").write_text(printing)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    assert checked(scene(BALL)) == Preflight()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<shape type="nonesuch"/>', "'nonesuch' is not one of Mitsuba's plugins"),
        ('<shape type="sphere"><integer name="a" value="1"/></shape>', r"can't load .*scene\.xml"),
        (f'<integrator type="direct"/>{BALL}', "leave --max-depth out"),
        (
            f'{BALL}<emitter type="point">{HOT}</emitter>',
            "scene.xml .*: blackbody can't be rendered here; write <rgb>",
        ),
    ],
)
def test_it_refuses_what_mitsuba_refuses(scene, body, words):
    with pytest.raises(SceneError, match=words):
        checked(scene(body), max_depth=7)


def test_a_scene_that_takes_too_much_is_refused(scene):
    image = '<texture type="bitmap"><string name="filename" value="large.png"/></texture>'
    file = scene(f'<shape type="sphere"><bsdf type="diffuse">{image}</bsdf></shape>')
    Image.new("L", (12_000, 12_000)).save(file.parent / "large.png", compress_level=1)
    with pytest.raises(SceneError, match=r"needs more than 512 MB of memory|can't load"):
        checked(file, preflight_mb=512)
    with pytest.raises(SceneError, match=r"was not loaded in 0\.1 s"):  # in which Mitsuba does not start
        checked(file, preflight_s=0.1)


@pytest.mark.parametrize(
    ("end", "words"),
    [
        ("raise KeyError('colour')", r"was not loaded: KeyError: 'colour'; this is a defect of enfilade"),
        (r"print('use of %mask\n   ^', file=sys.stderr); os.abort()", "by SIGABRT: use of %mask; .* report"),
        (
            "print('bad_alloc', file=sys.stderr); os.abort()",
            "by SIGABRT: bad_alloc; .* more than .* MB of memory",
        ),
        ("os.kill(os.getpid(), 9)", "by SIGKILL; .* more than .* MB of memory"),
    ],
)
def test_ends_of_its_process_are_told_apart(scene, tmp_path, monkeypatch, end, words):
    (tmp_path / "sitecustomize.py").write_text(
        "import os, sys\nfrom enfilade.scene.mitsuba import files\n"
        f"def check_scene(*_): {end}\nfiles.check_scene = check_scene\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(SceneError, match=words):
        checked(scene(BALL))


@pytest.fixture
def endless(scene):
    """A scene with a spectrum that is never read to its end, and the pipe that stands for it."""
    file = scene('<shape type="sphere"><spectrum name="x" filename="pipe"/></shape>')
    os.mkfifo(file.parent / "pipe")
    return file, file.parent / "pipe"


def opened(pipe, seconds=60.0):
    """The end to write to, as soon as a process reads from the other."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:  # nobody reads yet
            time.sleep(0.05)
    raise TimeoutError(pipe)


PREFLIGHT = """
import sys
from pathlib import Path
from enfilade.scene.preflight import preflight
from enfilade.settings import LimitSettings, TraceSettings
preflight(Path(sys.argv[1]), TraceSettings(), LimitSettings(), "llvm_ad_rgb")
"""


def test_it_ends_with_the_command_that_began_it(endless):
    scene, pipe = endless
    with subprocess.Popen([sys.executable, "-c", PREFLIGHT, str(scene)]) as command:  # noqa: S603
        writing = opened(pipe)
        try:
            command.kill()
            ended = select.poll()
            ended.register(writing, select.POLLERR)  # nobody reads any more
            assert ended.poll(20_000), "the preflight process is still there"
        finally:
            os.close(writing)


def run(file, parent, seconds=60.0):
    tables = Settings(LimitSettings(preflight_s=seconds)).to_tables()
    line = [sys.executable, "-P", "-m", "enfilade.scene.preflight", str(file)]
    line += [json.dumps(tables), "llvm_ad_rgb", str(parent)]
    return subprocess.run(line, check=False, timeout=60, capture_output=True).returncode  # noqa: S603


def test_it_ends_itself_when_its_time_is_over(endless):
    assert run(endless[0], os.getpid(), 0.5) == -signal.SIGALRM


def test_it_does_not_begin_without_its_parent(scene):
    assert run(scene(BALL), 0) == 1
