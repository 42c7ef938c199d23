"""What case studies keep on disk: scenes, walkthroughs, traced frames and results, each for its own terms."""

import dataclasses
import json
import shutil

import numpy as np
import pytest

from enfilade.errors import RunFolderError
from enfilade.files import read_json
from enfilade.monitor import Silence
from enfilade.reports.plots import walkthrough_figure
from scenes_analytic import room, room_walk
from small_runs import Told, job_of
from studies.cases.case import Case
from studies.cases.runner import ITEMS, measure
from studies.cases.terms import TERMS


def test_results_are_read_again_and_made_anew_on_other_terms(tmp_path):
    calls = []

    def make():
        calls.append(1)
        return {"value": len(calls)}

    def stored(**other):
        terms = dataclasses.replace(TERMS["small"], **other)
        return Case("room", terms, tmp_path, Silence()).stored("item", make, ("spp", "size")).result

    assert stored() == {"value": 1}
    assert stored() == {"value": 1}
    assert stored(crops=7) == {"value": 1}  # on which it does not depend
    assert stored(spp=99) == {"value": 2}
    assert read_json(tmp_path / "item.json")["made_by"]["terms"] == {"spp": 99, "size": [160, 120]}


@pytest.fixture
def case(tmp_path, monkeypatch):
    """Makes cases whose scene has nothing in it and is written in no time."""

    def write(_name, folder, *, preset):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "scene.xml").write_text(f"<!-- {preset} -->\n<scene version='3.0.0'/>")
        pose = np.eye(4).ravel().tolist()
        cameras = [{"camera_to_world": pose, "fov": 50, "aspect": 4 / 3}] * 3
        values = {"render_width": 32, "render_height": 24, "fps": 30, "camera_type": "perspective"}
        values |= {"seconds": 0.1, "camera_path": cameras}
        (folder / "camera_path.json").write_text(json.dumps(values))

    monkeypatch.setattr("studies.cases.case.write_scene", write)
    return lambda preset="small", **other: Case(
        "room", dataclasses.replace(TERMS["small"], preset=preset, **other), tmp_path / "room", Silence()
    )


def test_a_folder_with_the_scene_of_another_preset_is_refused_before_anything_is_measured(case, tmp_path):
    kept = case().whole.scene
    kept.write_text(kept.read_text() + "\n")  # a second time it is not written
    assert case().whole.scene.read_text().endswith("\n")
    with pytest.raises(RunFolderError, match=r'"preset": "small".* there, .*"preset": "full".* now.*--out'):
        _ = case("full").whole
    full = dataclasses.replace(TERMS["small"], preset="full")
    with pytest.raises(RunFolderError, match="holds other case studies"):
        measure(("atrium", "room"), ("placement",), full, tmp_path, Silence())
    assert not (tmp_path / "atrium").exists()


def test_a_scene_that_was_not_written_to_its_end_is_written_again(case):
    kept = case().whole.scene
    kept.write_text("<scene>")
    (kept.parent / "made_by.json").unlink()  # which is written last
    assert case().whole.scene.read_text().endswith("<scene version='3.0.0'/>")


def test_traced_frames_are_kept_by_scene_and_settings(case):
    first = case()
    folder = first.frames_of(first.short)
    assert case().frames_of(case().short) == folder
    other = case(window_spp=7)
    assert other.frames_of(other.short) != folder
    first.short.scene.write_text("<!-- another lamp -->\n<scene version='3.0.0'/>")
    assert first.frames_of(first.short) != folder


def test_a_walkthrough_of_other_settings_is_not_taken_for_this_one(tmp_path):
    def case_of(**trace):
        case = Case("room", TERMS["small"], tmp_path, Silence())
        case.whole = job_of(tmp_path, room(), room_walk(3, size=(16, 12)), trace={"spp": 2, **trace})
        return case

    first = case_of().rendered()
    again = case_of().rendered()
    assert again["table2"] == first["table2"]  # nothing was rendered again
    assert again["path_s"] == first["path_s"]  # of the hour in which it was
    assert first["path_s"]["gaussian"]["cpu"] > 0.0
    with pytest.raises(RunFolderError, match=r"settings\.trace\.seed.*\n.*delete .*paper to begin anew"):
        case_of(seed=7).rendered()


def test_what_could_not_be_made_anew_is_not_said_to_be(tmp_path):
    told = Told()

    def refuse():
        raise RunFolderError("another run")

    def case_of(**other):
        return Case("room", dataclasses.replace(TERMS["small"], **other), tmp_path, told)

    case_of().stored("item", dict, ("spp",))
    with pytest.raises(RunFolderError):
        case_of(spp=99).stored("item", refuse, ("spp",))
    assert told.said == []
    case_of(spp=99).stored("item", dict, ("spp",))
    assert told.said == [f"{tmp_path / 'item.json'} was made on other terms, and was made anew"]


@pytest.mark.parametrize("item", ITEMS.values(), ids=ITEMS)
def test_items_depend_on_terms_that_exist(item):
    assert set(item.fields) <= set(TERMS["small"].to_dict())
    assert "preset" in item.fields


@pytest.mark.slow
def test_a_scene_is_measured_once(tmp_path):
    """The small ROOM at 32x24: its run, its predictions with and without noise, its shares."""
    terms = dataclasses.replace(TERMS["small"], size=(32, 24), spp=2)
    items = ("statistics", "shares")
    told = Told()
    measured = measure(("room",), items, terms, tmp_path, told)["room"]
    found = {name: one.result for name, one in measured.items()}
    assert told.stages
    summary = found["statistics"]["summary"]
    assert len(walkthrough_figure(summary).axes) == 3
    assert summary["frames"] == 60
    initial = [s for s in summary["segments"] if s["depth"] == 0]
    plain = [s for s in found["statistics"]["plain_segments"] if s["depth"] == 0]
    assert [(s["first"], s["last"]) for s in initial] == [(s["first"], s["last"]) for s in plain]
    assert found["statistics"]["plain"]["before"] > found["statistics"]["predictions"]["before"]
    assert found["shares"]["table1"] == summary["table1"]
    assert found["shares"]["specular_seen"] == 0.0

    again = Told()
    assert measure(("room",), items, terms, tmp_path, again)["room"] == measured
    assert again.stages == []
    # Of scenes that are not asked for, what is there is told.
    assert measure(("atrium",), (), terms, tmp_path, again) == {"room": {}, "atrium": {}}
    (tmp_path / "atrium").mkdir(exist_ok=True)
    for file in (tmp_path / "room").glob("*.json"):
        shutil.copy(file, tmp_path / "atrium")
    assert measure(("room",), items, terms, tmp_path, again)["atrium"].keys() == set(items)
