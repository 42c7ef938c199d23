"""``python -m studies calibrate threshold``, from the command line to the table."""

import json

import pytest

from studies.cases import threshold
from support.study_runs import room_files


@pytest.fixture
def line(tmp_path):
    """A path of ten frames along the front of a room."""
    flags = ("--probes", 1, "--spp", 4, "--set", "viewing.diagonal_m=0.01875", "--quiet", "--device", "auto")
    return ("calibrate", "threshold", *room_files(tmp_path, 10), *flags)


def test_table_json_plot_and_kept_frames(run, line, tmp_path):
    folder, plot = tmp_path / "kept", tmp_path / "curve.png"
    result = run(*line, "--visible-percent", "100", "--plot", plot, "--out", folder)
    assert result.exit_code == 0, result.output
    assert "v_t     0 deg/s" in result.output
    assert "--set masks.slow_deg_s=0" in result.output
    assert plot.read_bytes().startswith(b"\x89PNG")
    files = {file: file.stat().st_mtime_ns for file in folder.rglob("*.exr")}
    assert files
    again = run(*line, "--out", folder, "--json")
    found = json.loads(again.stdout)
    assert found["spp"] == 4
    assert tuple(row["threshold_deg_s"] for row in found["curve"]) == threshold.THRESHOLDS_DEG_S
    assert {file: file.stat().st_mtime_ns for file in folder.rglob("*.exr")} == files
    other = run(*line, "--out", folder, "--seed", "7")
    assert other.exit_code == 2
    assert "another run" in other.output


def test_without_noise_no_threshold_may_suffice(run, line):
    result = run(*line, "--visible-percent", "0", "--light", "plain")
    assert result.exit_code == 0, result.output
    assert "No threshold up to 5 deg/s" in result.output


@pytest.mark.parametrize(
    ("flags", "message"),
    [(("--spp", "1"), "needs --spp 2 or more"), (("--plot", "curve.svg"), "file name that ends in .png")],
)
def test_refusals(run, line, flags, message):
    result = run(*line, *flags)
    assert result.exit_code == 2
    assert message in result.stderr
