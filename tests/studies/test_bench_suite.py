"""The bench on several scenes: their splits, those of a folder, and means over them."""

import pytest

from enfilade.errors import SceneError
from studies.bench.configurations import LARGE, SMALL, configuration, default_names
from studies.bench.splits import split_of, splits
from studies.bench.suite import (
    GENERATED,
    QUICK,
    QUICK_SCENES,
    found_in,
    summary,
)
from support.study_runs import room_job


def test_every_generated_scene_is_in_one_split():
    assert set(splits()) == {"tuning", "held-out"}
    assert not splits()["tuning"].keys() & splits()["held-out"].keys()
    assert all(split_of(name) != "not listed" for name in GENERATED)
    assert {split_of(name) for name in QUICK_SCENES} == {"tuning", "held-out"}
    assert (split_of("room"), split_of("courtyard"), split_of("my house")) == (
        "tuning",
        "held-out",
        "not listed",
    )


def test_scenes_of_a_folder(tmp_path):
    for scene in ("a/scene.xml", "b/mitsuba/scene.xml"):
        (tmp_path / scene).parent.mkdir(parents=True)
        (tmp_path / scene).touch()
        (tmp_path / scene[0] / "camera_path.json").touch()
    (tmp_path / "notes").mkdir()
    found = found_in(tmp_path)
    assert [(case.name, case.scene.parent.name) for case in found] == [("a", "a"), ("b", "mitsuba")]
    (tmp_path / "a" / "scene.xml").unlink()
    with pytest.raises(SceneError, match=r"a has 0 files scene.xml"):
        found_in(tmp_path)
    with pytest.raises(SceneError, match=r"no subfolder with camera_path\.json"):
        found_in(tmp_path / "notes")


def test_configurations_of_the_suite_exist(tmp_path):
    job = room_job(tmp_path, 2)
    for names in (SMALL, LARGE, QUICK):
        assert [configuration(name, job).name for name in names] == list(names)
    assert default_names(320 * 180) == SMALL
    assert default_names(1280 * 720) == LARGE


def test_the_summary_has_a_mean_for_each_size_split_and_configuration():
    def bench(scene, camp, times):
        ratio = {"times": times, "kind": "equal", "low": times, "high": times, "is_decided": True}
        return {
            "size": [320, 180],
            "scene": scene,
            "split": camp,
            "ratios": {"decoupled-15": {"flip": ratio}},
        }

    found = summary([bench("room", "tuning", 4.0), bench("a", "held-out", 2.0), bench("b", "held-out", 0.5)])
    assert [(one["split"], one["scenes"]) for one in found] == [
        ("held-out", ["a", "b"]),
        ("tuning", ["room"]),
    ]
    assert found[0]["ratios"]["flip"]["times"] == pytest.approx(1.0)
    assert found[1]["ratios"]["flip"]["times"] == pytest.approx(4.0)
