"""Items of the case studies: by hand, on analytic scenes, and all of them once from end to end."""

import dataclasses
import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from enfilade.camera.path import Segment
from enfilade.errors import InputError, RunFolderError
from enfilade.monitor import Silence
from enfilade.records import SurfaceClass
from enfilade.settings import KeyframeSettings, Placement
from studies.cases import (
    placement,
    refinement,
    reflections,
    separation,
    statistics,
    supports,
    threshold,
    times,
)
from studies.cases.blocks import BLOCKS
from studies.cases.case import Case, Result, open_folder
from studies.cases.document import check_blocks, replaced, write_document
from studies.cases.extent import EXTENTS
from studies.cases.runner import ITEMS, measure
from studies.cases.speed import even_positions, mean_cost
from studies.cases.visibility import score_in
from support.analytic_scene import AnalyticScene, Checker, Material, Quad
from support.example_scenes import room, room_walk
from support.study_runs import room_job, windows_of

TEMPLATE = Path(__file__).parents[2] / "studies" / "cases" / "README.md"
TINY = dataclasses.replace(
    EXTENTS["small"], size=(48, 36), window_size=(48, 36), window_spp=4, window_reference_spp=16, windows=1,
    traced_windows=1, reference_spp=32, crop=(32, 24), crops=1, most_spp=8, spp=4,
)  # fmt: skip


@cache
def plain():
    return windows_of(room())


def test_disocclusions_of_a_placement():
    uniform = KeyframeSettings(placement=Placement.UNIFORM, spacing=6)
    walk, analysis = plain().walk, plain().analysis
    row, some = (placement.disocclusions(walk, analysis, uniform, step, Silence()) for step in (1, 2))
    assert row["keyframes"] == [1, 7, 13, 19, 24]
    assert row["adaptation"] is None
    wanted = placement.disoccluded_percent(walk, Segment(0, 6), 3)
    assert row["percent"][row["frames"].index(4)] == wanted > 0.0
    assert row["mean"] == pytest.approx(sum(row["percent"]) / 24)
    # Frames that are left out are represented by their neighbours.
    assert len(some["frames"]) < len(row["frames"])
    assert some["mean"] == pytest.approx(row["mean"], rel=0.25)


def segment(first, last, depth, percent, still, *, is_split, middle=1):
    return {
        "first": first, "last": last, "middle": middle, "depth": depth, "percent_visible": percent,
        "percent_visible_no_pursuit": still, "is_split": is_split,
    }  # fmt: skip


def test_predictions_by_hand():
    segments = [
        segment(0, 10, 0, 20.0, 8.0, is_split=True),
        segment(0, 4, 1, 4.0, 2.0, is_split=False),
        segment(4, 10, 1, 12.0, 11.0, is_split=False),
        segment(10, 14, 0, 2.0, 1.0, is_split=False),
        segment(14, 15, 0, 0.0, 0.0, is_split=False, middle=None),  # nothing between its keyframes
    ]
    found = statistics.predictions(segments, 10.0)
    assert (found["initial"], found["split"], found["remaining"]) == (2, 1, 3)
    assert found["before"] == pytest.approx((9 * 20.0 + 3 * 2.0) / 12)
    assert found["after"] == pytest.approx((3 * 4.0 + 5 * 12.0 + 3 * 2.0) / 11)
    assert (found["split_before"], found["split_after"]) == (20.0, (3 * 4.0 + 5 * 12.0) / 8)
    assert found["before_still"] == pytest.approx((9 * 8.0 + 3 * 1.0) / 12)
    assert found["after_still"] == pytest.approx((3 * 2.0 + 5 * 11.0 + 3 * 1.0) / 11)
    assert [
        found[key] for key in ("split_only_by_pursuit", "unsplit_above_limit_still", "remaining_above_limit")
    ] == [1, 1, 1]
    assert statistics.predictions(segments[3:], 10.0)["split_before"] is None


def test_lights_agree_where_they_split_the_same_initial_segments():
    one = [segment(0, 10, 0, 20.0, 8.0, is_split=True), segment(10, 14, 0, 2.0, 1.0, is_split=False)]
    other = [one[0], segment(0, 5, 1, 30.0, 8.0, is_split=True), segment(10, 14, 0, 12.0, 1.0, is_split=True)]
    assert refinement.agreement(one, other) == (1, 2)
    assert refinement.agreement(one, one) == (2, 2)


def test_art_is_the_least_spp_at_which_nothing_is_visible():
    def scores(*percents):
        return [{"score": 0.0, "visible_percent": p} for p in percents]

    assert times.art_spp({4: scores(20.0, 1.0), 8: scores(0.5, 1.2), 16: scores(0.9, 1.0)}) == (16, False)
    assert times.art_spp({4: scores(20.0), 8: scores(3.0)}) == (8, True)


def test_equal_quality_is_interpolated():
    series = [{"spp": n, "frames": [{"score": 40.0 / n}, {"score": 80.0 / n}]} for n in (4, 8, 16)]  # 60 / n
    assert times.equal_spp(series, 7.5) == pytest.approx(8.0)
    assert times.equal_spp(series, 60.0 / 11.0) == pytest.approx(11.0)
    assert times.equal_spp(series, 2.0) is times.equal_spp(series, 99.0) is None


def test_crops_places_and_costs():
    rows, columns = times.central_crop((64, 48), 10, 8)
    assert np.ones((48, 64))[rows, columns].shape == (8, 10)
    assert (rows.start, columns.start) == (20, 27)
    assert times.central_crop((64, 48), 999, 999) == (slice(0, 48), slice(0, 64))
    assert even_positions(200, 4) == [25, 75, 124, 174]
    assert even_positions(3, 1) == [1]
    slow, fast = ({"centre": {"wall": s, "cpu": 2.0 * s}} for s in (3.0, 1.0))
    assert mean_cost([slow, fast]) == {"centre": {"wall": 2.0, "cpu": 4.0}}


def test_the_papers_numbers():
    of = times.PAPER_MINUTES
    assert of["atrium"]["art"] / of["atrium"]["ibr_rt"] == pytest.approx(8.3, abs=0.05)
    assert of["room"]["rt"] / of["room"]["ibr_rt"] == pytest.approx(1.36, abs=0.01)
    for table in statistics.PAPER_SHARES.values():
        assert sum(v for k, v in table.items() if k != "total") == pytest.approx(table["total"])


def test_all_traced_is_no_difference_and_nothing_traced_is_all_of_it():
    found = threshold.calibrate(plain(), [8, 12], thresholds_deg_s=(0.0, 1.0, 1000.0))
    low, _, high = found["curve"]
    assert low["traced_percent"] == 0.0
    assert low["removed_below_deg_s"] is None  # I_c is I_ibr
    assert low["reused_visible_percent"] > 0.0
    assert high["traced_percent"] == 100.0
    assert high["reused_visible_percent"] is None  # nothing is reused
    assert high["removed_below_deg_s"] > 0.0


def test_the_threshold_is_the_least_from_which_on_little_is_visible():
    def chosen(*percents):
        rows = [{"threshold_deg_s": float(k), "reused_visible_percent": p} for k, p in enumerate(percents)]
        return threshold.least_threshold(rows, 1.0)

    assert chosen(30.0, 5.0, 0.5, 0.2) == 2.0
    assert chosen(0.5, 5.0, 0.5, None) == 2.0  # differences that come back count
    assert chosen(0.1, 0.1) == 0.0
    assert chosen(9.0, 5.0) is chosen(9.0, 5.0, None) is None


def test_a_little_filter_is_better_than_none_and_a_wide_one_is_worse():
    tried = {"spatial_px": (1.0, 3.0, 11.0), "temporal": (1, 11), "classes_deg_s": (0.0, 1.0, np.inf)}
    found = supports.compare(plain(), [8, 14], **tried)
    assert found["classes"]
    for velocity in found["classes"]:
        scores = np.array(velocity["scores"]["paper"])
        assert scores.shape == (3, 2)
        assert scores[1, 1] < scores[0, 0]
        assert scores[2, 1] > scores[1, 1]
        assert velocity["best"]["paper"]["score"] == scores.min()


def test_ghosts_are_away_from_outlines_and_antialiasing_is_at_them():
    windows = windows_of(room(), 10)  # fast: the ball moves before the wall by a pixel a frame
    found, example = separation.compare(windows, [4, 5])
    most = max(found["frames"], key=lambda r: r["ghosts"]["pixels"])
    assert found["example"] == most["frame"]
    assert 0.0 < most["ghosts"]["pixels"] < 20.0
    viewer, near = windows.viewer, separation.outlines(windows.geometry(most["frame"] - 1).shape_index)
    changed = separation.changed_pixels(viewer, example["unseparated"], example["separated"])
    wanted = viewer.luminance(example["reference"])
    errors = [np.abs(viewer.luminance(example[name]) - wanted) for name in ("unseparated", "separated")]
    ghosts = changed & ~near & (errors[0] > errors[1])
    np.testing.assert_array_equal(example["ghost"] > 0.0, ghosts)
    assert most["ghosts"]["count"] == ghosts.sum()
    assert most["outlines"]["pixels"] == pytest.approx(100.0 * (changed & near).mean())
    effect = {where: most[where]["effect"]["motion"]["score"] for where in ("ghosts", "outlines")}
    assert effect["ghosts"] == pytest.approx(score_in(example["motion"], ghosts))
    assert min(effect.values()) > score_in(example["motion"], ~changed)


def test_outlines_by_hand():
    shape_index = np.ones((9, 9), np.uint32)
    shape_index[:, 5:] = 2
    assert separation.outlines(shape_index)[4].tolist() == [False] * 3 + [True] * 4 + [False] * 2


def test_the_motion_of_the_reflection_preserves_it():
    """Along a plane mirror: its own motion blurs the reflection, that of the virtual image does not."""
    mirror = Material((0.9, 0.9, 0.9), SurfaceClass.MIRROR)
    checks = Material(Checker((0.9, 0.9, 0.9), (0.1, 0.1, 0.1), 2.4))
    back = Quad((-3, 0, -1), (6, 0, 0), (0, 3, 0), mirror, "mirror")
    front = Quad((-20, -10, 8), (0, 20, 0), (40, 0, 0), checks, "wall")
    windows = windows_of(AnalyticScene((back, front)), path=room_walk(24, size=(64, 48), turn_deg=0.0))
    found = reflections.compare(windows, reflections.largest_mirrors(windows, 1)[0])
    by_filter = {name: of["motion"]["score"] for name, of in found["filters"].items()}
    assert by_filter["reflected"] < min(by_filter["full"], by_filter["none"])
    assert reflections.largest_mirrors(plain(), 3) == []


def small_case(folder, job):
    """A case whose walk is that of a job."""
    case = Case("room", TINY, folder, Silence())
    case.whole = job
    case._job = lambda _size, _spp: job
    return case


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """All items of a tiny walk, as results of both scenes, and their folder."""
    folder = tmp_path_factory.mktemp("cases")
    job = room_job(folder, 14, masks={"split_percent": 5.0})
    case = small_case(folder / "room", job)
    found = {name: case.result(name, lambda item=item: item(case)) for name, item in ITEMS.items()}
    (folder / "atrium").symlink_to(folder / "room")
    return {name: {"room": result, "atrium": result} for name, result in found.items()}, folder, job


def test_all_items_agree_with_each_other(results):
    found = {name: by_scene["room"].value for name, by_scene in results[0].items()}
    run, plain_segments = found["statistics"]["segments"], found["statistics"]["plain_segments"]
    initial = [[(s["first"], s["last"]) for s in of if s["depth"] == 0] for of in (run, plain_segments)]
    assert initial[0] == initial[1] == [(1, 7), (7, 13), (13, 14)]
    by_light = found["refinement"]
    assert list(by_light) == ["no noise", "8", "32", "128"]
    assert by_light["no noise"]["segments"] == plain_segments
    assert found["shares"]["frames"] == len(found["statistics"]["per_frame"]) == 14
    assert 0.0 < found["shares"]["specular_percent"] < 50.0
    methods = found["times"]["methods"]
    assert all(method["cpu_s"] > 0.0 and method["equivalent_paths"] > 0.0 for method in methods.values())
    assert methods["art"]["spp"] == 8
    assert [row["spp"] for row in found["times"]["art_series"]] == [4, 8]
    assert found["reflections"]["frames"]
    assert found["threshold"]["traced"]["spp"] == 4


def test_results_are_read_again(results):
    again = small_case(results[1] / "room", results[2])
    assert again.result("times", pytest.fail) == results[0]["times"]["room"]
    assert again.rendered("paper")["path_s"]["centre"]["cpu"] > 0.0


def block(text, name):
    return text.split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0]


def test_the_document_has_a_table_and_figures_for_each_item(results, tmp_path):
    found, folder, _ = results
    target = tmp_path / "out" / "README.md"
    files = write_document(found, TINY, folder, TEMPLATE, target)
    text = target.read_text()
    assert files[0] == target
    assert {f.name for f in files[1:]} == {
        "placement.png", "walkthrough-room.png", "walkthrough-atrium.png", "threshold.png",
        "ghosts-room.png", "ghosts-atrium.png",
    }  # fmt: skip
    for file in files[1:]:
        assert file.read_bytes().startswith(b"\x89PNG")
        assert f"({file.relative_to(target.parent)})" in text
    for name in ITEMS:
        rows = [line for line in block(text, name).splitlines() if line.startswith("|")]
        assert len({line.count("|") for line in rows[:3]}) == 1
        assert re.search(r"\*Measured: ROOM \d{4}-\d\d-\d\d \(enfilade .*\); ATRIUM .*\*", block(text, name))
    assert re.search(
        r"\| room \| uniform \| 4.04 \| \d+\.\d\d \| \d+ \| \d+\.\d\d \|", block(text, "placement")
    )
    assert "| atrium | paper | 2.4 | 40.8 | 0.3 | 6.0 | 49.5 |" in text
    assert text.startswith(TEMPLATE.read_text().split("<!--")[0])
    # Blocks without results stay as they are.
    other = tmp_path / "README.md"
    write_document({"shares": found["shares"]}, TINY, folder, target, other)
    assert other.read_text() == text


def test_a_document_without_a_block_is_refused(tmp_path):
    assert list(BLOCKS) == list(ITEMS)
    check_blocks(TEMPLATE)
    file = tmp_path / "README.md"
    file.write_text(TEMPLATE.read_text().replace("<!-- shares -->", ""))
    with pytest.raises(InputError, match="no block <!-- shares -->"):
        check_blocks(file)


def test_a_block_is_replaced_and_the_rest_stays():
    text = "before\n<!-- a -->\nold\n<!-- /a -->\nafter\n<!-- b -->\n<!-- /b -->\n"
    new = replaced(text, "a", r"new \1")
    assert new == "before\n<!-- a -->\n\nnew \\1\n\n<!-- /a -->\nafter\n<!-- b -->\n<!-- /b -->\n"
    assert replaced(new, "a", r"new \1") == new


def test_a_folder_of_another_extent_is_refused(tmp_path):
    open_folder(tmp_path, TINY)
    open_folder(tmp_path, TINY)
    with pytest.raises(RunFolderError, match=r"another extent \(spp\); choose another --out"):
        measure(("room",), (), dataclasses.replace(TINY, spp=9), tmp_path, Silence())


def test_results_of_earlier_calls_are_returned_too(tmp_path):
    (tmp_path / "atrium").mkdir()
    (tmp_path / "atrium" / "shares.json").write_text(json.dumps({"origin": {"date": "today"}, "result": 7}))
    found = measure(("room",), (), TINY, tmp_path, Silence())
    assert found.pop("shares") == {"atrium": Result(7, {"date": "today"})}
    assert not any(found.values())
