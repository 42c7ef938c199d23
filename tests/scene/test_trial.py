"""A process of its own loads a scene first: it says what is wrong, and outlives neither its time nor us."""

import json
import os
import re
import select
import signal
import subprocess
import sys
import time

import pytest
from PIL import Image

from enfilade.errors import SceneError
from enfilade.scene import trial
from enfilade.scene.parameters import Parameters
from enfilade.scene.scenecheck import check_scene
from enfilade.scene.trial import check_reading, try_scene
from enfilade.settings import LimitSettings, Settings, TraceSettings
from studies.scenes import write_scene

TRACE = Settings().to_tables()["trace"]


def texture(name):
    return f'<texture type="bitmap"><string name="filename" value="{name}"/></texture>'


def tried(file, max_depth=0, **limits):
    return try_scene(file, TraceSettings(max_depth=max_depth), LimitSettings(**limits), "llvm_ad_rgb")


def test_a_trial_says_why_there_is_no_light_to_ask_for(scene):
    ball = '<shape type="sphere"/><emitter type="constant"/>'
    assert tried(scene(ball)) == ""
    assert tried(scene(ball), max_depth=3) == "its paths end after 3 edges, fewer than 4"
    assert "DirectIntegrator, not a path tracer" in tried(scene(f'<integrator type="direct"/>{ball}'))


def test_a_trial_loads_with_the_settings_of_the_run(scene):
    file = scene('<integrator type="direct"/><shape type="sphere"/><emitter type="constant"/>')
    with pytest.raises(SceneError, match="leave --trace-max-depth out"):
        tried(file, max_depth=7)


def test_a_trial_says_why_a_scene_can_not_be_loaded(scene):
    with pytest.raises(SceneError, match=r"can't load .*scene\.xml"):
        tried(scene('<shape type="nonesuch"/>'))


def test_a_trial_that_needs_too_much_is_refused(scene):
    file = scene(f'<shape type="sphere"><bsdf type="diffuse">{texture("large.png")}</bsdf></shape>')
    Image.new("L", (12_000, 12_000)).save(file.parent / "large.png", compress_level=1)
    with pytest.raises(SceneError, match=r"was too much for the process|can't load"):
        tried(file, trial_mb=512)
    with pytest.raises(SceneError, match=r"was not loaded in 0\.1 s"):  # in which no Mitsuba starts
        tried(file, trial_s=0.1)


@pytest.mark.parametrize("name", ["room", "atrium"])
def test_mitsuba_reads_the_generated_scenes_as_we_do(name, tmp_path):
    check_reading(write_scene(name, tmp_path, preset="small").scene)


class OlderParameters(Parameters):
    """What a name was before: letters, digits and underscores."""

    def filled(self, text):
        return re.sub(r"\$(\w+)", lambda found: self.values[found[1]], text)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<include filename="$x-y"/>', r"it finds .*evil\.xml\. Write"),
        ('<shape type="$x-y"/>', r"it finds the plugin 'evil\.xml'"),
        (
            '<shape type="obj"><string name="filename" value="$x-y"/></shape>',
            r"it finds filename='evil\.xml'",
        ),
    ],
)
def test_a_scene_that_mitsuba_reads_otherwise_is_refused(scene, monkeypatch, body, words):
    ball = '<scene version="3.0.0"><shape type="sphere"/></scene>'
    file = scene(f'<default name="x" value="ok"/><default name="x-y" value="evil.xml"/>{body}')
    for name in ("ok-y", "evil.xml"):
        (file.parent / name).write_text(ball)
    check_reading(file)
    monkeypatch.setattr("enfilade.scene.scenefile.Parameters", OlderParameters)
    with pytest.raises(SceneError, match=words):
        check_reading(file)


def test_the_trial_compares_what_mitsuba_reads(scene, monkeypatch, capsys):
    file = scene('<shape type="sphere"/><emitter type="constant"/>')

    def differs(_):
        raise SceneError("otherwise than it was checked")

    monkeypatch.setattr(trial, "check_reading", differs)
    monkeypatch.setattr(trial, "limit_memory", lambda _: None)
    monkeypatch.setattr("enfilade.device.activate", lambda _: None)
    assert trial._load(str(file), json.dumps(TRACE), 16_384, "llvm_ad_rgb") == trial.REFUSED
    assert "otherwise than it was checked" in capsys.readouterr().out


@pytest.fixture
def endless(scene):
    """A scene with a spectrum that is never read to its end, and the pipe that stands for it."""
    file = scene('<shape type="sphere"><spectrum name="x" filename="pipe"/></shape>')
    os.mkfifo(file.parent / "pipe")
    with pytest.raises(SceneError, match="no ordinary file"):  # render asks this first
        check_scene(file, LimitSettings())
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


TRY = """
import sys
from pathlib import Path
from enfilade.scene.trial import try_scene
from studies.scenes import write_scene
from enfilade.settings import LimitSettings, TraceSettings
try_scene(Path(sys.argv[1]), TraceSettings(), LimitSettings(), "llvm_ad_rgb")
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_trial_ends_with_the_command_that_began_it(endless, number):
    scene, pipe = endless
    command = subprocess.Popen([sys.executable, "-c", TRY, str(scene)])  # noqa: S603
    try:
        writing = opened(pipe)
        try:
            command.send_signal(number)
            command.wait()
            ended = select.poll()
            ended.register(writing, select.POLLERR)  # nobody reads any more
            assert ended.poll(20_000), "the process that loads the scene is still there"
        finally:
            os.close(writing)
    finally:
        command.kill()
        command.wait()


def test_a_trial_ends_itself_when_its_time_is_over(endless):
    scene, _ = endless
    line = [sys.executable, "-P", "-m", "enfilade.scene.trial"]
    line += [str(scene), json.dumps(TRACE), "16384", "llvm_ad_rgb", str(os.getpid()), "0.5"]
    assert subprocess.run(line, check=False, timeout=60).returncode == -signal.SIGALRM  # noqa: S603


def test_a_trial_without_its_parent_does_not_begin(scene):
    line = [sys.executable, "-P", "-m", "enfilade.scene.trial"]
    line += [str(scene("")), json.dumps(TRACE), "16384", "llvm_ad_rgb", "0", "60"]
    assert subprocess.run(line, check=False, timeout=60, capture_output=True).returncode == 1  # noqa: S603
