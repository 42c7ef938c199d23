"""Settings from flags, assignments, files and defaults, in that order of precedence."""

import os

import pytest

from enfilade.settings import (
    AntialiasSettings,
    DecoupledSettings,
    KeyframeSettings,
    LimitSettings,
    Placement,
    SamplingSettings,
    Settings,
    TraceSettings,
    VideoSettings,
)

PAPER = ("--method", "paper")


@pytest.fixture
def settings(run, jobs, camera_path):
    def made(*flags):
        out = camera_path.parent / "run"
        result = run("render", "s.xml", "--path", camera_path, "--out", out, *flags)
        assert result.exit_code == 0, result.output
        return jobs[-1].settings

    return made


def test_defaults(settings):
    assert settings() == Settings()


def test_precedence(settings, tmp_path):
    file = tmp_path / "look.toml"
    file.write_text("[keyframes]\nspacing = 30\nadaptation = 0\n[sampling]\nspp = 8\n[trace]\nseed = 3\n")
    made = settings("--settings", file, "--set", "keyframes.spacing=40", "--seed", "7", *PAPER)
    assert (made[KeyframeSettings].spacing, made[KeyframeSettings].adaptation) == (40, 0.0)
    assert (made[SamplingSettings].spp, made[TraceSettings].seed) == (8, 7)
    # A flag that repeats the default wins, too.
    assert (
        settings("--settings", file, "--set", "keyframes.spacing=25", *PAPER)[KeyframeSettings].spacing == 25
    )


def test_assignments(settings):
    made = settings(
        *("--set", "keyframes.placement=equal-flow", "--set", "antialias.separate_shapes = true", *PAPER),
        *("--set", "video.codec='av1'", "--codec", "ffv1"),
    )
    assert made[KeyframeSettings].placement is Placement.EQUAL_FLOW
    assert made[AntialiasSettings].separate_shapes
    assert made[VideoSettings].codec == "ffv1"
    assert settings("--quality", "5")[DecoupledSettings].quality == 5.0


def test_numbers_of_thousands_of_digits_are_refused(run, camera_path):
    line = ("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run")
    result = run(*line, "--set", f"trace.seed={'1' * 5000}")
    assert result.exit_code == 2
    assert "seed" in result.stderr


def test_paths_are_absolute(settings, tmp_path, monkeypatch):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    monkeypatch.chdir(here)
    made = settings("--ocio", "a/../studio.ocio", "--allow", f"models{os.pathsep}/textures")
    assert made[VideoSettings].ocio == str(here / "studio.ocio")
    assert made[LimitSettings].allow == f"{here / 'models'}{os.pathsep}/textures"
    file = there / "look.toml"
    file.write_text('[video]\nocio = "studio.ocio"\n[limits]\nallow = ["models", "/textures"]\n')
    made = settings("--settings", "../there/look.toml")
    assert made[VideoSettings].ocio == str(there / "studio.ocio")
    assert made[LimitSettings].allow == f"{there / 'models'}{os.pathsep}/textures"
    (here / "link").symlink_to(there)
    assert settings("--allow", "link")[LimitSettings].allow == str(here / "link")
    file.write_text('[video]\nocio = "ocio://studio-config-latest"\n')
    assert settings("--settings", file)[VideoSettings].ocio == "ocio://studio-config-latest"


def test_flags_without_effect_are_refused(run, jobs, camera_path):
    line = ("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run")
    for flags, said in (
        (("--spp", "3"), "--spp has no effect with --method decoupled"),
        (("--quality", "5", *PAPER), "--quality has no effect with --method paper"),
        (("--set", "masks.slow_deg_s=1"), "which does not read [masks]"),
        (("--set", "warp.depth_tolerance=0.1", "--method", "reference"), "does not read [warp]"),
    ):
        result = run(*line, *flags)
        assert result.exit_code == 2
        assert said in result.stderr
    assert not jobs


def test_flags_without_effect_on_other_commands_are_refused(run, jobs, camera_path):
    prepare = ("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run", "--prepare")
    for line, said in (
        (("encode", "run", "--set", "trace.seed=5"), "has no effect on a video, which does not read [trace]"),
        (("encode", "run", "--set", "viewing.distance_m=1"), "on a video, which does not read distance_m"),
        (
            ("compare", "a", "b", "--set", "trace.seed=1"),
            "has no effect on a comparison of mode modern, which",
        ),
        (("compare", "a", "b", "--set", "metric.mask_slope=0.3"), "modern, which does not read mask_slope"),
        ((*prepare, "--workers", "2"), "--workers has no effect with --prepare"),
        ((*prepare, "--threads", "0"), "--threads has no effect with --prepare"),
        ((*prepare, "--executor", "cloud"), "--executor has no effect with --prepare"),
    ):
        result = run(*line)
        assert (result.exit_code, said in result.stderr) == (2, True), result.output


def test_the_job(run, jobs, camera_path):
    run(
        *("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run"),
        *("--size", "128x96", "--frames", "1-3:2", "--fps", "30", "--method", "reference"),
        *("--executor", "processes", "--workers", "3", "--threads", "2"),
    )
    path = jobs[-1].path
    assert (path.width, path.height, path.numbers, path.fps) == (128, 96, (1, 3), 30.0)
    assert (str(jobs[-1].scene.file), jobs[-1].method) == ("s.xml", "reference")
    assert (jobs.workers.executor, jobs.workers.count, jobs.workers.threads) == ("processes", 3, 2)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--set", "keyframes.spacing=1"), ("[keyframes] spacing = 1", "2 or more")),
        (("--seed", "4294967296"), ("[trace] seed", "between 0 and 4294967295")),
        (("--set", "viewing.distance_m=nan"), ("[viewing] distance_m", "finite")),
        (("--set", "keyframes.spacing=many"), ("[keyframes] spacing", "expected int")),
        (("--set", "keyframes"), ("--set keyframes", "write it like")),
        (("--set", "colour.red=1"), ("unknown section [colour]", "keyframes")),
        (("--quality", "high"), ("--quality", "not a valid float")),
        (("--codec", "vp9"), ("--codec", "'h264'", "'prores'")),
        (("--size", "640"), ("--size", "640x480")),
        (("--frames", "3-1"), ("3-1", "descends")),
        (("--frames", "1-9"), ("frame 4 is not on the path", "1-3")),
        (("--size", "100x100"), ("does not fit the aspect",)),
        (("--fps", "0"), ("frames per second",)),
        (("--method", "magic"), ("magic", "reference", "paper")),
        (("--method", "enfilade.viewing:Viewing"), ("enfilade.Method",)),
        (("--settings", "absent.toml"), ("absent.toml", "No such file")),
        (("--executor", "cloud"), ("cloud", "processes")),
        (("--workers", "2"), ("--executor processes",)),
        (("--colour", "red"), ("No such option",)),
    ],
)
def test_wrong_input_is_one_message_and_2(run, jobs, camera_path, flags, words):
    result = run("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run", *flags)
    assert result.exit_code == 2, result.output
    assert not jobs
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[keyframe]\nspacing = 30\n", ("unknown section [keyframe]", "keyframes")),
        ("[keyframes]\nspaces = 30\n", ("unknown setting 'spaces'", "spacing")),
        ("keyframes = 3\n", ("[keyframes] must be a table",)),
        ("trace = 3\n", ("[trace] must be a table",)),
        ("[keyframes\n", ("not valid TOML",)),
    ],
)
def test_a_wrong_file_names_the_place(run, jobs, camera_path, tmp_path, text, words):
    file = tmp_path / "look.toml"
    file.write_text(text)
    out = camera_path.parent / "run"
    result = run("render", "s.xml", "--path", camera_path, "--out", out, "--settings", file, "--seed", "1")
    assert result.exit_code == 2
    for word in words:
        assert word in result.stderr
