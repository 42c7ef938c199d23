"""``enfilade calibrate threshold``, from the command line to the table."""

import json

import pytest

from enfilade.errors import RunFolderError
from scenes_analytic import room
from small_runs import RENDERER
from studies.__main__ import main
from studies.cases import charts as cases
from studies.cases import threshold
from support.analytic_scene import write_scene


@pytest.fixture
def inputs(tmp_path):
    """An analytic scene, and a path of ten frames along its front."""
    scene = write_scene(tmp_path / "scene.analytic", room())

    def pose(x):
        return [1, 0, 0, x, 0, 1, 0, 1.4, 0, 0, 1, 3.5, 0, 0, 0, 1]

    cameras = [{"camera_to_world": pose(0.05 * k), "fov": 50, "aspect": 4 / 3} for k in range(10)]
    file = tmp_path / "camera_path.json"
    values = {"render_width": 64, "render_height": 48, "fps": 30, "camera_type": "perspective"}
    file.write_text(json.dumps({**values, "seconds": 1 / 3, "camera_path": cameras}))
    return [
        str(scene),
        *("--renderer", RENDERER),
        *("--path", str(file)),
        "--viewing-diagonal-m",
        "0.025",
        "--probes",
        "1",
        "--spp",
        "4",
        "--quiet",
    ]


def test_it_says_the_threshold_with_its_curve(run, inputs, tmp_path):
    plot = tmp_path / "curve.png"
    result = run(
        "calibrate", "threshold", *inputs, "--visible-percent", "100", "--plot", plot, "--device", "cpu"
    )
    assert result.exit_code == 0, result.output
    assert "v_t     0 deg/s" in result.output
    assert "--masks-slow-deg-s 0" in result.output
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_a_curve_that_cannot_be_drawn_is_told(run, inputs, tmp_path, monkeypatch, flags):
    found = {"threshold_deg_s": 0.5, "curve": []}
    monkeypatch.setattr(threshold, "calibrate_job", lambda *_, **__: found)
    drawn = []

    def draw(curves, file):
        drawn.extend(curves)
        raise RunFolderError(f"can't write {file}")

    monkeypatch.setattr(cases, "draw_threshold", draw)
    monkeypatch.chdir(tmp_path)
    line = ("calibrate", "threshold", "scene.analytic", *inputs[1:], "--device", "cpu", *flags)
    result = run(*line, "--plot", "curve.png")
    assert result.exit_code == 2
    assert "0.5" in result.stdout
    assert "can't write curve.png" in result.stderr
    assert drawn == [tmp_path.name]
    refused = run(*line, "--plot", "curve.svg")
    assert "curve.svg: it is written as .png" in refused.stderr
    assert refused.stdout == ""


def test_json_has_all_of_it_and_traced_frames_are_kept(run, inputs, tmp_path):
    folder = tmp_path / "kept"
    result = run("calibrate", "threshold", *inputs, "--out", folder, "--json", "--device", "cpu")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["spp"] == 4
    assert [row["threshold_deg_s"] for row in found["curve"]] == list(
        threshold.Calibration().thresholds_deg_s
    )
    assert list(folder.rglob("*.exr"))
    again = run("calibrate", "threshold", *inputs, "--out", folder, "--json", "--device", "cpu")
    assert json.loads(again.output) == found


def test_other_frames_in_the_folder_are_refused(run, inputs, tmp_path):
    folder = tmp_path / "kept"
    assert run("calibrate", "threshold", *inputs, "--out", folder, "--device", "cpu").exit_code == 0
    other = run("calibrate", "threshold", *inputs, "--out", folder, "--seed", "7", "--device", "cpu")
    assert other.exit_code == 2
    assert "another run" in other.output


def test_too_few_paths_to_know_their_noise_are_refused(run, inputs):
    result = run("calibrate", "threshold", *inputs, "--spp", "1", "--device", "cpu")
    assert result.exit_code == 2
    assert "--light traced needs --spp 2 or more" in result.stderr


def test_a_scene_that_reaches_for_other_files_is_refused(run, inputs, tmp_path):
    scene = tmp_path / "scene.xml"
    mesh = '<shape type="ply"><string name="filename" value="/elsewhere/mesh.ply"/></shape>'
    scene.write_text(f'<scene version="3.0.0">{mesh}</scene>')
    result = run("calibrate", "threshold", scene, *inputs[3:], "--device", "cpu")
    assert result.exit_code == 2
    assert "--allow /elsewhere" in result.stderr


@pytest.mark.parametrize("flag", ["--metric-metering", "--masks-slow-deg-s"])
def test_flags_that_change_nothing_are_unknown(run, inputs, flag):
    result = run("calibrate", "threshold", *inputs, flag, "0")
    assert result.exit_code == 2
    assert f"No such option '{flag}'" in result.stderr


def test_only_what_has_a_folder_is_said_to_stay(run, inputs, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(threshold, "calibrate_job", interrupted)
    line = ("calibrate", "threshold", *inputs, "--device", "cpu")
    assert run(*line).stderr.strip() == "Interrupted."
    assert "to continue:" in run(*line, "--out", tmp_path / "kept").stderr


def test_no_threshold_is_said(run, inputs):
    result = run(
        "calibrate", "threshold", *inputs, "--visible-percent", "0", "--light", "plain", "--device", "cpu"
    )
    assert result.exit_code == 0, result.output
    assert "No threshold up to 5 deg/s" in result.output


def test_help_says_what_is_calibrated(run):
    assert "threshold" in run("calibrate", "--help").output
    help_text = run("calibrate", "threshold", "--help").output
    assert "Fig. 9" in help_text
    assert all(flag in help_text for flag in ("--metric-mask-slope", "--allow"))
    assert "calibrate" in main.list_commands(None)
