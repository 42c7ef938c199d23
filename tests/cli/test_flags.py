"""Flags, the TOML file and defaults, in that order of strength."""

import dataclasses
import os

import click
import pytest

from enfilade.cli import main
from enfilade.cli.flags import SettingOption
from enfilade.cli.inputs import JOB_SECTIONS
from enfilade.settings import Metering, Placement, Settings, sections

PAPER = ("--method", "paper")


@pytest.fixture
def settings(run, jobs, camera_path):
    def made(*flags):
        result = run(
            "render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run", "--json", *flags
        )
        assert result.exit_code == 0, result.output
        return jobs.seen[-1].settings

    return made


def test_no_flags_give_the_defaults(settings):
    assert settings() == Settings()


def test_flags_beat_the_file_and_the_file_beats_the_default(settings, tmp_path):
    file = tmp_path / "look.toml"
    file.write_text("[keyframes]\nspacing = 30\nadaptation = 0\n[trace]\nspp = 8\n")
    made = settings("--settings", file, "--keyframes-spacing", "40", "--seed", "7", *PAPER)
    assert (made.keyframes.spacing, made.keyframes.adaptation) == (40, 0.0)
    assert (made.trace.spp, made.trace.seed) == (8, 7)
    assert made.masks == Settings().masks


def test_a_flag_that_repeats_the_default_still_beats_the_file(settings, tmp_path):
    file = tmp_path / "look.toml"
    file.write_text("[keyframes]\nspacing = 30\n")
    assert settings("--settings", file, "--keyframes-spacing", "25", *PAPER).keyframes.spacing == 25


def test_choices_switches_and_short_forms(settings):
    made = settings(
        *("--keyframes-placement", "equal-flow", "--metric-metering", "none", "--antialias-separate-items"),
        *("--codec", "ffv1", "--method", "paper", "--spp", "3", "--ocio", "ocio://default", "--view", "Film"),
    )
    assert made.keyframes.placement is Placement.EQUAL_FLOW
    assert made.metric.metering is Metering.NONE
    assert made.antialias.separate_items
    assert (made.video.codec, made.video.ocio, made.video.view) == ("ffv1", "ocio://default", "Film")
    assert made.trace.spp == 3
    assert not settings("--antialias-no-separate-items", *PAPER).antialias.separate_items


def test_paths_are_absolute_in_flags_from_here_and_in_a_file_from_there(settings, tmp_path, monkeypatch):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    monkeypatch.chdir(here)
    made = settings("--ocio", "a/../studio.ocio", "--allow", f"models{os.pathsep}/textures")
    assert made.video.ocio == str(here / "studio.ocio")
    assert made.limits.allow == f"{here / 'models'}{os.pathsep}/textures"
    file = there / "look.toml"
    file.write_text('[video]\nocio = "studio.ocio"\n[limits]\nallow = ["models", "/textures"]\n')
    made = settings("--settings", "../there/look.toml")
    assert made.video.ocio == str(there / "studio.ocio")
    assert made.limits.allow == f"{there / 'models'}{os.pathsep}/textures"
    assert settings("--settings", file, "--ocio", "").video.ocio == ""
    file.write_text('[video]\nocio = "ocio://studio-config-latest"\n')
    assert settings("--settings", file).video.ocio == "ocio://studio-config-latest"


def test_a_flag_that_says_nothing_to_the_method_is_refused(run, camera_path):
    line = ("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run")
    for flags, said in (
        (("--spp", "3"), "--quality"),
        (("--quality", "5", "--method", "paper"), "--spp"),
        (("--light-quality", "5", "--method", "reference"), "--spp"),
        (("--keyframes-spacing", "20"), "--light-spacing"),
        (("--antialias-frames", "3"), "--antialias-frames says nothing to --method decoupled; leave it out"),
        (("--masks-specular-jnd", "1"), "--masks-specular-jnd says nothing to --method decoupled"),
        (("--light-spacing", "3", "--method", "paper"), "--light-spacing says nothing to --method paper"),
        (("--masks-specular-jnd", "1", "--method", "reference"), "--method reference"),
    ):
        result = run(*line, *flags)
        assert result.exit_code == 2
        assert said in result.stderr
    assert not (camera_path.parent / "run").exists()


def test_every_setting_has_a_flag():
    command = main.get_command(click.Context(main), "render")
    flags = {(p.section, p.field.name) for p in command.params if isinstance(p, SettingOption)}
    assert flags == {(name, f.name) for name, cls in sections().items() for f in dataclasses.fields(cls)}
    assert tuple(sections()) == JOB_SECTIONS


def test_size_frames_fps_method(run, jobs, camera_path):
    run(
        *("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run", "--json"),
        *("--size", "128x96", "--frames", "1-3:2", "--fps", "30", "--method", "reference"),
    )
    job = jobs.seen[-1]
    assert (job.path.width, job.path.height, job.path.numbers, job.path.fps) == (128, 96, (1, 3), 30.0)
    assert (str(job.scene), job.method) == ("s.xml", "reference")


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--keyframes-spacing", "1"), ("[keyframes] spacing = 1", "at least 2")),
        (("--trace-seed", "4294967296"), ("[trace] seed", "between 0 and 4294967295")),
        (("--viewing-distance-m", "nan"), ("[viewing] distance_m", "finite")),
        (("--keyframes-spacing", "many"), ("--keyframes-spacing", "not a valid integer")),
        (("--keyframes-placement", "anywhere"), ("--keyframes-placement", "'adapted'", "'equal-flow'")),
        (("--codec", "vp9"), ("--codec", "'h264'", "'prores'")),
        (("--size", "640"), ("--size", "640x480")),
        (("--size", "640x-480"), ("--size", "640x480")),
        (("--frames", "3-1"), ("3-1", "descends")),
        (("--frames", "1-9"), ("frame 4 is not on the path", "1-3")),
        (("--size", "100x100"), ("does not fit the aspect",)),
        (("--fps", "0"), ("0 frames per second",)),
        (("--method", "magic"), ("--method", "'reference'", "'paper'")),
        (("--settings", "absent.toml"), ("absent.toml", "No such file")),
        (("--colour", "red"), ("No such option",)),
    ],
)
def test_wrong_input_is_one_message_and_2(run, jobs, camera_path, flags, words):
    result = run("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run", *flags)
    assert result.exit_code == 2
    assert jobs.seen == []
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[keyframe]\nspacing = 30\n", ("unknown section [keyframe]", "keyframes")),
        ("[keyframes]\nspaces = 30\n", ("unknown setting 'spaces'", "spacing")),
        ("[keyframes]\nspacing = 'wide'\n", ("spacing", "expected int")),
        ("[video]\ncodec = 'vp9'\n", ("codec", "h264, ffv1, av1, prores")),
        ("keyframes = 3\n", ("[keyframes] must be a table",)),
        ("[keyframes\n", ("not valid TOML",)),
    ],
)
def test_a_wrong_file_names_the_place(run, jobs, camera_path, tmp_path, text, words):
    file = tmp_path / "look.toml"
    file.write_text(text)
    flags = ("--settings", file, "--keyframes-adaptation", "0.25")
    result = run("render", "s.xml", "--path", camera_path, "--out", camera_path.parent / "run", *flags)
    assert result.exit_code == 2
    for word in words:
        assert word in result.stderr
