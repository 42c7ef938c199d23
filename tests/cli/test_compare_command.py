"""``enfilade compare`` on images from a folder."""

import json

import numpy as np
import pytest
from PIL import Image


@pytest.fixture
def folders(tmp_path):
    rng = np.random.default_rng(1)
    for name, noise in (("test", 60), ("reference", 0)):
        (tmp_path / name).mkdir()
        for i in range(10):
            image = np.full((40, 60, 3), 120, np.int64)
            image += rng.integers(0, noise * (i % 2) + 1, image.shape)
            Image.fromarray(image.astype(np.uint8)).save(tmp_path / name / f"{i}.png")
    return tmp_path / "test", tmp_path / "reference"


def test_a_table_and_heat_maps(run, folders, tmp_path):
    result = run("compare", *folders, "--heatmap", tmp_path / "maps")
    assert result.exit_code == 0, result.output
    assert "10 frames, 60x40" in result.stdout
    assert "identical" in result.stdout
    assert "stood still" in result.stderr
    maps = sorted((tmp_path / "maps").iterdir())
    assert [m.name for m in maps] == [f"{i}.png" for i in range(10)]
    with Image.open(maps[1]) as noisy, Image.open(maps[0]) as equal:
        assert noisy.size == (60, 40)
        assert np.asarray(noisy.convert("L")).max() > np.asarray(equal.convert("L")).max()


def test_as_json(run, folders):
    found = json.loads(run("compare", *folders, "--json", "--fps", "24").stdout)
    assert (found["frames"], found["size"], found["fps"], found["has_flow"]) == (10, [60, 40], 24.0, False)
    assert found["per_frame"][0]["percent_visible"] == 0.0
    assert found["per_frame"][1]["percent_visible"] > 0.0


def test_viewing_conditions_count(run, folders):
    near, far = (
        json.loads(run("compare", *folders, "--json", "--viewing-distance-m", d).stdout)
        for d in ("0.5", "50")
    )
    assert far["score_jnd"]["mean"] < 0.9 * near["score_jnd"]["mean"]


@pytest.mark.parametrize("what", ["gone", "empty"])
def test_nothing_to_compare_is_wrong_input(run, folders, tmp_path, what):
    (tmp_path / "empty").mkdir()
    result = run("compare", tmp_path / what, folders[1])
    assert result.exit_code == 2
    assert what in result.stderr
