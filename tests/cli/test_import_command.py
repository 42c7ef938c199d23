"""``enfilade import`` writes a scene folder; `render` and `plan` import by themselves."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

import enfilade
from enfilade.images import write_exr
from enfilade.settings import VideoSettings, ViewingSettings
from support.fake_blender import NOTE, RESULT
from support.toys import environment, wait_for

QUICK = ("--method", "reference", "--spp", "2", "--device", "auto", "--quiet")


@pytest.fixture
def shot(tmp_path, blender_path):
    def write(**wish):
        file = tmp_path / "my shot.blend"
        file.write_text(json.dumps(wish))
        return file

    return write


def imports(source):
    return len(source.with_suffix(".calls").read_text().splitlines())


def test_an_import_lists_what_it_means_in_the_picture(run, shot, tmp_path):
    notes = [{"kind": kind, **NOTE, "object": kind} for kind in ("baked", "not-carried")]
    out = tmp_path / "scenes" / "my shot"
    result = run("import", shot(notes=notes), "--out", out, "--quiet")
    assert result.exit_code == 0, result.output
    first, *_ = result.stdout.splitlines()
    assert first == "not carried over:"
    assert "  not-carried / Noise Texture: a procedural texture\n      the sofa is plain\n" in result.stdout
    assert "my shot.blend by Blender 4.5.1: 3 objects, 4 instances" in result.stdout
    assert "1 not carried over, 0 approximated, 1 baked" in result.stdout
    render = next(line for line in result.stdout.splitlines() if line.startswith("render"))
    assert render.endswith(f"enfilade render '{out}' --out RUN")


def test_the_folder_of_an_imported_scene_renders_with_the_path_and_settings_of_the_file(
    run, shot, tmp_path, jobs
):
    out = tmp_path / "scene"
    run("import", shot(), "--out", out)
    run("render", out, "--out", tmp_path / "run")
    run("render", out, "--out", tmp_path / "other", "--exposure-ev", "2", "--frames", "11")
    with pytest.raises(SystemExit):
        enfilade.render(out, None, tmp_path / "third", settings={"viewing": {"exposure_ev": 2.0}})
    first, second, third = jobs
    assert (third.scene, third.settings[ViewingSettings]) == (first.scene, second.settings[ViewingSettings])
    assert first.scene.file == out / "scene.xml"
    assert [job.settings[ViewingSettings].exposure_ev for job in (first, second)] == [0.5, 2.0]
    assert second.path.numbers == (11,)
    assert set(second.path.numbers) < set(first.path.numbers)
    result = run("render", tmp_path, "--out", tmp_path / "none")
    assert result.exit_code == 2
    assert "holds no imported scene" in result.stderr


def test_as_json(run, shot, tmp_path):
    source = shot(files=["/wood.png"])
    result = run("import", source, "--out", tmp_path / "s", "--json", "--frames", "3-5", "--size", "32x24")
    found = json.loads(result.stdout)
    assert (found["frames"], found["size"], found["view"]) == ([3, 5], [32, 24], RESULT["view"])
    assert (found["folder"], found["files"]) == (str(tmp_path / "s"), ["/wood.png"])
    assert found["wall_s"] > 0.0


def test_a_check_names_the_objects_that_differ(run, shot, tmp_path):
    for seed in (0, 1):
        image = {"RGB": np.full((12, 16, 3), 0.25, np.float32)}
        write_exr(tmp_path / "cycles" / str(seed) / "12.exr", image)
    source, out = shot(size=[16, 12], cycles=str(tmp_path / "cycles")), tmp_path / "s"
    check = ("--check", "--check-frames", "12", "--check-spp", "2", "--quiet")
    result = run("import", source, "--out", out, *check)
    assert result.exit_code == 0, result.output
    assert "check   everything" in result.stdout
    assert result.stdout.endswith(f"page    {out}/check.html\n")
    assert "frame 12" in (out / "check.html").read_text()
    found = json.loads(run("import", source, "--out", out, "--overwrite", *check, "--json").stdout)
    everything = found["check"]["differences"][0]
    assert everything["brightness_percent"] > 50.0  # the sky is white, and the images were grey
    for flag in ("--check-frames", "--check-spp"):
        alone = run("import", source, "--out", tmp_path / "t", flag, "12")
        assert f"{flag} needs --check" in alone.stderr


def test_a_check_that_fails_keeps_the_scene_and_says_where(run, shot, tmp_path):
    out = tmp_path / "s"
    result = run("import", shot(), "--out", out, "--check", "--check-frames", "99", "--quiet")
    assert result.exit_code == 2
    assert f"The imported scene is kept in {out}" in result.stderr
    assert (out / "scene.xml").is_file()


def test_strict_is_an_error_of_the_input(run, shot, tmp_path):
    result = run("import", shot(notes=[{"kind": "not-carried", **NOTE}]), "--out", tmp_path / "s", "--strict")
    assert result.exit_code == 2
    assert "--strict refuses my shot.blend" in result.stderr
    assert not (tmp_path / "s").exists()


def test_folders_are_replaced_on_demand_only(run, shot, tmp_path):
    out = tmp_path / "s"
    assert run("import", shot(), "--out", out).exit_code == 0
    again = run("import", shot(), "--out", out)
    assert (again.exit_code, "--overwrite" in again.stderr) == (2, True)
    assert run("import", shot(), "--out", out, "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--frames", "1,5"), "takes one range"),
        (("--check", "--check-frames", "many"), "can't read 'many'"),
        (("--size", "0x0"), "0x0 is no image size"),
        (("--size", "99999x99999"), "each side must be 1 to 16384"),
        (("--set", "decoupled.quality=5"), "has no effect on an import"),
        (("--blender", "/nowhere"), "/nowhere can't import scenes"),
        (("--set", "blender.bake_px=1"), "out of range"),
    ],
)
def test_wrong_input(run, shot, tmp_path, flags, words):
    result = run("import", shot(camera=""), "--out", tmp_path / "s", *flags)
    assert result.exit_code == 2
    assert words in result.stderr
    assert not (tmp_path / "s").exists()


def test_without_blender(run, shot, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setattr("enfilade.scene.blender.find.environment_folder", lambda: tmp_path / "none")
    result = run("render", shot(), "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert "--install-blender" in result.stderr
    assert not (tmp_path / "run" / "scene").exists()


def test_a_run_from_a_blend_file_continues_without_another_import(run, shot, tmp_path):
    source, out = shot(notes=[{"kind": "not-carried", **NOTE}]), tmp_path / "run"
    line = ("render", source, "--out", out, *QUICK[:-1], "--size", "16x12")
    first = run(*line, "--frames", "11-12")
    assert first.exit_code == 0, first.output
    assert "not carried over: Sofa / Noise Texture: a procedural texture; the sofa is plain" in first.stderr
    assert sorted(file.name for file in (out / "frames").iterdir()) == ["0011.exr", "0012.exr"]
    assert run(*line, "--frames", "11-12").exit_code == 0
    assert run("work", out, "--quiet").exit_code == 0
    assert run("farm", out).exit_code == 0
    assert imports(source) == 1
    job = json.loads((out / "job.json").read_text())
    assert job["scene"]["file"] == "scene/scene.xml"  # as the folder may be moved
    assert job["settings"]["viewing"]["exposure_ev"] == 0.5
    another = run(*line, "--frames", "11-13")
    assert "frames: [11, 12] there, [11, 13] now" in another.stderr


def test_a_run_is_bound_to_its_source(run, shot, tmp_path):
    source, out = shot(), tmp_path / "run"
    line = ("render", source, "--out", out, *QUICK, "--prepare")
    assert run(*line).exit_code == 0
    os.utime(source, (1.0, 1.0))
    assert run(*line).exit_code == 0
    chosen = run(*line, "--set", "blender.camera=B")
    assert chosen.exit_code == 2
    assert "camera: '' there, 'B' now" in chosen.stderr
    shot(fps=25.0)
    changed = run(*line)
    assert changed.exit_code == 2
    assert "has changed since it was imported" in changed.stderr
    source.unlink()
    assert f"`enfilade work {out}` continues without it" in run(*line).stderr
    assert run("work", out, "--quiet").exit_code == 0


def test_flags_win_over_the_file(run, shot, tmp_path, jobs, camera_path):
    flags = ("--exposure-ev", "-1", "--fps", "12", "--size", "32x24")
    result = run("render", shot(), "--out", tmp_path / "run", *flags)
    assert result.exit_code == 0, result.output
    run("render", shot(), "--out", tmp_path / "run2", "--path", camera_path)
    first, second = jobs
    assert first.settings[ViewingSettings].exposure_ev == -1.0
    assert (first.path.fps, first.path.width, first.path.numbers) == (12.0, 32, (11, 12, 13))
    assert second.path.numbers == (1, 2, 3)
    assert second.settings[VideoSettings] == VideoSettings()


def test_frames_beyond_the_range_of_the_file(run, shot, tmp_path, jobs):
    run("render", shot(), "--out", tmp_path / "run", "--frames", "20,22,24")
    assert jobs[0].path.numbers == (20, 22, 24)


def test_a_file_without_a_camera_needs_a_path(run, shot, tmp_path, jobs, camera_path):
    result = run("render", shot(camera=""), "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert "my shot.blend has no camera that can be used" in result.stderr
    unusable = {
        **NOTE,
        "object": "Plan",
        "node": "Camera",
        "what": "an orthographic camera can't be exported",
    }
    source = shot(camera="", notes=[{"kind": "not-carried", **unusable}])
    result = run("render", source, "--out", tmp_path / "run2", "--quiet")
    assert "Plan: an orthographic camera can't be exported" in result.stderr
    run("render", shot(camera=""), "--out", tmp_path / "run", "--path", camera_path)
    assert len(jobs) == 1


def test_plan_leaves_nothing(run, shot, tmp_path, jobs):
    source = shot()
    run("plan", source)
    assert len(jobs[0].path) == 3
    assert not jobs[0].scene.file.exists()


def test_a_folder_of_something_else_is_refused_before_the_import(run, shot, tmp_path):
    source = shot()
    result = run("render", source, "--out", tmp_path)
    assert result.exit_code == 2
    assert "is not empty and holds no run" in result.stderr
    assert not source.with_suffix(".calls").exists()


def test_settings_of_blender_have_no_effect_on_xml(run, scene, camera_path, tmp_path):
    flags = ("--path", camera_path, "--out", tmp_path / "run", "--set", "blender.camera=B")
    result = run("render", scene, *flags)
    assert result.exit_code == 2
    assert "which Blender does not import" in result.stderr


def test_settings_of_blender_have_no_effect_on_a_folder_of_any_name(run, shot, tmp_path):
    run("import", shot(), "--out", tmp_path / "scene.blend")
    result = run("render", tmp_path / "scene.blend", "--out", tmp_path / "run", "--set", "blender.camera=B")
    assert result.exit_code == 2
    assert "which is imported already" in result.stderr


@pytest.mark.parametrize("command", ["import", "render"])
def test_a_terminated_import_leaves_nothing(shot, tmp_path, tmp_path_factory, command):
    source, out, scratch = shot(do="hang"), tmp_path / "out", tmp_path_factory.mktemp("scratch")
    calls = source.with_suffix(".calls")
    line = [sys.executable, "-m", "enfilade", command, str(source), "--out", str(out), "--quiet"]
    variables = {**environment(), "TMPDIR": str(scratch)}
    with subprocess.Popen(line, env=variables, stderr=subprocess.DEVNULL) as process:  # noqa: S603
        try:
            wait_for(lambda: calls.exists() and calls.read_text().endswith("\n"))
            process.send_signal(signal.SIGTERM)
            assert process.wait(60) == 143
        finally:
            process.kill()
    assert [*scratch.iterdir(), *tmp_path.rglob("*.writing-*")] == []
