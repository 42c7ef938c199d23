"""``enfilade bench``: from its arguments to its files."""

import json

import pytest

from enfilade.camera import load_path
from enfilade.comparison.measures import JUDGES
from scenes_analytic import room
from small_runs import RENDERER, TABLES
from studies.bench.command import JUDGES as LISTED
from support.analytic_scene import write_scene

ARGUMENTS = ("--spp", "1,2", "--denoised-spp", "none", "--reference-spp", "8", "--quiet")


@pytest.fixture
def scene(tmp_path):
    return write_scene(tmp_path / "room.analytic", room())


def test_the_listed_judges_are_those_there_are():
    assert LISTED == JUDGES


def test_from_arguments_to_files(run, tmp_path, scene, camera_path):
    line = ("bench", scene, "--renderer", RENDERER, "--path", camera_path, "--out", tmp_path / "bench")
    line += (
        *ARGUMENTS,
        "--only",
        "traced-*",
        "--judge",
        "psnr",
        "--viewing-diagonal-m",
        TABLES["viewing"]["diagonal_m"],
    )
    result = run(*line, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert [row["name"] for row in found["contestants"]] == ["traced-1", "traced-2"]
    assert list(found["judges"]) == ["psnr"]
    assert found["size"] == [load_path(camera_path).width, load_path(camera_path).height]
    for name in ("bench.json", "bench.png", "crops.png"):
        assert (tmp_path / "bench" / name).is_file()
    # as a table, from what is there
    again = run(*line)
    assert again.exit_code == 0
    assert "traced-2" in again.output
    assert "bench.png" in again.output


@pytest.mark.parametrize("counts", ["4,x", "0", "-1", "", "4,,8", "²"])
def test_wrong_lists_of_paths_are_refused(run, tmp_path, scene, camera_path, counts):
    result = run("bench", scene, "--path", camera_path, "--out", tmp_path / "bench", "--spp", counts)
    assert result.exit_code == 2
    assert "write it like 4,16,64" in result.output
    assert not (tmp_path / "bench").exists()


def test_an_unknown_contestant_is_refused_before_any_work(run, tmp_path, scene, camera_path):
    result = run("bench", scene, "--path", camera_path, "--out", tmp_path / "bench", "--only", "best")
    assert result.exit_code == 2
    assert "traced-256" in result.output
    assert not (tmp_path / "bench").exists()
