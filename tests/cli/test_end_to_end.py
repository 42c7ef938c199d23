"""The commands with the real pipeline, on a scene in closed form."""

import json

import numpy as np
import pytest

import scenes_analytic
from enfilade.camera.pinhole import look_at
from small_runs import RENDERER
from support.analytic_scene import write_scene

FRAMES = 5


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    scene = write_scene(folder / "room.analytic", scenes_analytic.room())
    path = folder / "camera_path.json"
    poses = [look_at((x, 1.5, 2.5), (0.0, 1.2, -2.0)) for x in np.linspace(-0.2, 0.2, FRAMES)]
    cameras = [{"camera_to_world": p.ravel().tolist(), "fov": 55, "aspect": 4 / 3} for p in poses]
    values = {"render_width": 64, "render_height": 48, "fps": 24, "seconds": FRAMES / 24}
    path.write_text(json.dumps({**values, "camera_type": "perspective", "camera_path": cameras}))
    return (
        *(scene, "--renderer", RENDERER),
        *("--path", path, "--device", "cpu", "--spp", "2", "--method", "paper"),
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


def test_render_twice_and_compare(run, inputs, finished):
    first = run("render", *inputs, "--out", finished / "paper", "--json")
    assert first.exit_code == 0, first.output
    summary = json.loads(first.stdout)
    assert (summary["frames"], summary["method"]) == (FRAMES, "paper")
    assert len(list((finished / "paper" / "frames").glob("*.exr"))) == FRAMES
    assert (finished / "paper" / summary["video"]).exists()
    again = json.loads(run("render", *inputs, "--out", finished / "paper", "--json").stdout)
    assert again["table1"] == summary["table1"]
    assert "in-betweens: 5/5" in first.stderr

    reference = run("render", *inputs, "--out", finished / "reference", "--method", "reference")
    assert reference.exit_code == 0, reference.output
    assert "Table 1" in reference.stdout
    found = run("compare", finished / "paper", finished / "reference", "--json")
    assert found.exit_code == 0, found.output
    figures = json.loads(found.stdout)
    assert (figures["frames"], figures["fps"], figures["flow"]) == (FRAMES, 24.0, "layers")
    assert figures["psnr_db"] > 15.0


def test_another_run_in_the_folder_is_refused(run, inputs, tmp_path):
    frames = ("--frames", "1-2", "--out", tmp_path / "run")
    assert run("render", *inputs, *frames).exit_code == 0
    result = run("render", *inputs, *frames, "--seed", "5")
    assert result.exit_code == 2
    assert "seed" in result.stderr
    assert result.stderr.count("Error:") == 1


def test_plan(run, inputs, tmp_path):
    result = run("plan", *inputs, "--plot", tmp_path / "plan.png")
    assert result.exit_code == 0, result.output
    assert f"{FRAMES} frames, 2 initial keyframes: 1, {FRAMES}" in result.stdout
    assert (tmp_path / "plan.png").exists()
    made = json.loads(run("plan", *inputs, "--json").stdout)
    assert made["frames"] == list(range(1, FRAMES + 1))


@pytest.mark.parametrize(
    ("renderer", "words"),
    [("support.analytic", "support.analytic"), ("support.analytic:gone", "gone"), ("gone:load", "gone")],
)
def test_a_renderer_that_there_is_not(run, inputs, tmp_path, renderer, words):
    result = run("render", inputs[0], "--renderer", renderer, *inputs[3:], "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert f"there is no renderer '{renderer}'" in result.stderr
    assert words in result.stderr


def test_an_output_that_is_a_file(run, inputs, tmp_path):
    (tmp_path / "run").write_text("")
    result = run("render", *inputs, "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert str(tmp_path / "run") in result.stderr


def test_a_mitsuba_scene_that_is_malformed(run, inputs, tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text('<scene version="3.0.0"><shape type="no_such_shape"/></scene>')
    result = run("render", scene, *inputs[3:], "--out", tmp_path / "run")
    assert result.exit_code == 2, result.output
    assert "scene.xml" in result.stderr
