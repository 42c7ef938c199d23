"""The document of the case studies: tables and figures of made-up and of small results."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from enfilade.errors import InputError
from enfilade.images import write_arrays
from enfilade.pipeline.versions import code_digest
from made_up_runs import made_up_summary
from studies.cases.blocks import BLOCKS
from studies.cases.case import Measured
from studies.cases.document import check_blocks, replaced, write_document
from studies.cases.runner import ITEMS, forecast_s
from studies.cases.terms import TERMS

TEMPLATE = Path(__file__).parents[2] / "studies" / "cases" / "README.md"
SMALL = TERMS["small"]


def said(score, percent):
    return {"score": score, "visible_percent": percent}


def placed(adaptation, mean, keyframes):
    return {
        "name": "adapted", "adaptation": adaptation, "mean": mean, "keyframes": list(range(keyframes)),
        "frames": [1, 2, 3], "percent": [mean, 2 * mean, 0.0],
    }  # fmt: skip


def velocity_class(low, high):
    return {"from_deg_s": low, "to_deg_s": high, "pixels": 1000}


def curve_row(threshold):
    return {
        "threshold_deg_s": threshold, "traced_percent": 10.0 * threshold,
        "reused_visible_percent": 8.0 - threshold, "removed_below_deg_s": None if threshold == 0.0 else 0.3,
    }  # fmt: skip


def calibrated(chosen):
    return {
        "probes": [1, 2], "spp": 4, "size": [16, 12], "tolerated_percent": 1.0, "threshold_deg_s": chosen,
        "paper_deg_s": 0.5, "curve": [curve_row(v) for v in (0.0, 0.5, 1.0, 2.0, 5.0)],
        "by_velocity": [velocity_class(0.0, 1.0) | {"visible_percent": 7.0}],
    }  # fmt: skip


def supported():
    best = {"px": 3.0, "frames": 11, "score": 2.0}
    scores = [[9.0, 8.0], [3.0, 2.0]]
    one = {
        "paper_px": 3.4, "paper_frames": 11, "paper_score": {"paper": 2.5, "modern": 2.6},
        "scores": {"paper": scores, "modern": scores}, "best": {"paper": best, "modern": best},
    }  # fmt: skip
    classes = [velocity_class(0.0, 1.0) | one, velocity_class(16.0, None) | one]
    return {"probes": [1], "spatial_px": [1.0, 3.0], "temporal": [1, 11], "classes": classes}


def timed():
    stages = {"trace": {"cpu_s": 1.5, "wall_s": 0.8}, "pilot": {"cpu_s": 0.5, "wall_s": 0.2}}
    frames = [said(2.0, 3.0), said(4.0, 5.0)]
    own = {"cpu_s": 2.0, "wall_s": 1.0, "worth_paths": 2.5}
    return {
        "numbers": [3, 9], "reference_spp": 64, "crop": [8, 6], "art_is_bound": True,
        "art_series": [{"spp": 4, "frames": [said(6.0, 9.0)]}, {"spp": 8, "frames": frames}],
        "path_us": {"centre": {"wall": 1.0, "cpu": 2.0}, "gaussian": {"wall": 1.0, "cpu": 2.0}},
        "ways": {
            "art": {"spp": 8, "frames": frames, "cpu_s": 13.0, "wall_s": 7.0, "worth_paths": 8.0},
            "rt": {"spp": 4, "frames": None, "cpu_s": 3.0, "wall_s": 2.0, "worth_paths": 3.5},
            "ibr_rt": {"spp": 4, "frames": frames, **own, "stages": stages},
            "decoupled": {"spp": None, "frames": frames, **own, "stages": stages},
        },
    }  # fmt: skip


def separated():
    both = {how: said(2.0, 50.0) for how in ("motion", "still")}
    kinds = ("effect", "reference together", "reference apart", "raw together")
    place = {"count": 200, "pixels": 1.5, "deg_s": 3.0, **dict.fromkeys(kinds, both)}
    few = place | {"count": 199}
    return {"frames": [{"frame": 7, "ghosts": few, "outlines": place | {"deg_s": None}}], "example": 7}


def reflected():
    filters = {
        name: {how: said(2.0, 50.0) for how in ("motion", "still", "modern")}
        for name in ("none", "full", "short", "reflected")
    }
    row = {
        "frame": 5,
        "mirror_percent": 3.0,
        "surface_deg_s": 1.0,
        "reflected_deg_s": 0.5,
        "filters": filters,
    }
    return {"frames": [row], "example": 5}


@pytest.fixture(scope="module")
def results():
    summary = made_up_summary()
    segments = [s | {"depth": 0} for s in summary["segments"]]
    counts = dict.fromkeys(("initial", "split", "remaining", "given_up", "split_not_seen_still"), 3)
    means = dict.fromkeys(("before", "after", "before_still", "after_still", "split_before"), 4.25)
    means |= {"split_after": None}
    placements = [placed(0.0, 4.0, 2), placed(0.5, 2.0, 2), placed(None, 5.0, 2)]
    shares = {
        "table1": summary["table1"],
        "specular_seen": 40.0,
        "slow_seen": 20.0,
        "frames": 24,
        "keyframes": 4,
    }
    room = {
        "placement": {"numbers": list(range(20)), "spacing": 25, "placements": placements},
        "statistics": {
            "summary": summary, "predictions": {**counts, **means},
            "plain_segments": segments, "plain": {**counts, **means},
        },
        "shares": shares,
        "times": timed(),
        "threshold": {"plain": calibrated(None), "traced": calibrated(0.7)},
        "supports": {"plain": supported(), "traced": supported()},
        "separation": separated(),
        "reflections": {"frames": []},
    }  # fmt: skip
    found = {"room": room, "atrium": {**room, "reflections": reflected()}}
    return {
        scene: {name: Measured(of, "2026-11-22", code_digest()) for name, of in items.items()}
        for scene, items in found.items()
    }


@pytest.fixture(scope="module")
def written(results, tmp_path_factory):
    folder = tmp_path_factory.mktemp("cases")
    image, plane = np.full((24, 32, 3), 0.5, np.float32), np.ones((24, 32), np.float32)
    ghosts = dict.fromkeys(("raw", "together", "apart", "reference"), image)
    ghosts |= dict.fromkeys(("ghost", "motion", "still", "speed_deg_s"), plane)
    mirrors = dict.fromkeys(("none", "full", "short", "reflected", "reference"), image) | {"mirror": plane}
    for scene in results:
        write_arrays(folder / scene / "separation.npz", ghosts)
    write_arrays(folder / "atrium" / "reflections.npz", mirrors)
    target = folder / "out" / "case-studies.md"
    files = write_document(results, SMALL, folder, TEMPLATE, target)
    return target, files


def block(text, name):
    return text.split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0]


def test_there_is_a_block_for_each_item():
    assert list(BLOCKS) == list(ITEMS)
    text = TEMPLATE.read_text()
    assert [name for name in ITEMS if f"<!-- {name} -->" in text and f"<!-- /{name} -->" in text] == list(
        ITEMS
    )


def test_figures_lie_beside_the_document(written):
    target, files = written
    assert files[0] == target
    assert {f.name for f in files[1:]} == {
        "placement.png", "predictions.png", "walkthrough-room.png", "walkthrough-atrium.png", "times.png",
        "threshold.png", "supports.png", "ghosts-room.png", "ghosts-atrium.png", "mirrors-atrium.png",
    }  # fmt: skip
    for file in files[1:]:
        assert file.read_bytes().startswith(b"\x89PNG")
        assert f"({file.relative_to(target.parent)})" in target.read_text()


def test_tables_have_ours_beside_the_papers(written):
    text = written[0].read_text()
    assert "| room | uniform | 4.04 | 4.00 | 2 | 14.00 |" in block(text, "placement")
    assert "changes the holes of uniform spacing by -50 %, equal flow by +25 %" in block(text, "placement")
    assert "| atrium | paper | 2.4 | 40.8 | 0.3 | 6.0 | 49.5 |" in block(text, "shares")
    times = block(text, "times")
    bound = "| room | ART | at least 8 | 6.9 | at least 13.00 | at least 8.00 | at least 3.20 | 6.27 |"
    assert f"{bound} 3.0 | 4.0 |" in times
    assert "| room | RT | 4 | 1.5 | 3.00 | 3.50 | 1.40 | 1.36 |  |  |" in times
    assert "| atrium | `decoupled` |  |  | 2.00 | 2.50 | 1.00 |  | 3.0 | 4.0 |" in times
    assert "| room | IBR+RT (`paper`) | 8 | 3.2 | 6.3 |" in times
    assert "| room, no noise | none | 8.00 | 7.50 |" in block(text, "threshold")
    assert "| room, 4 paths | 0.7 |" in block(text, "threshold")
    assert "| 16 on | 3.4 px, 11 frames | 2.5 | 3 px, 11 frames | 2.0 |" in block(text, "supports")
    assert "| room | 7 | outlines | 1.50 | – | 2.00 | 2.00 | 2.00 | 2.00 | 50.0 |" in block(
        text, "separation"
    )
    assert "| room | 7 | ghosts |" not in block(text, "separation")  # fewer than 200 pixels
    assert "*Measured: ROOM 2026-11-22; ATRIUM 2026-11-22.*" in block(text, "separation")
    assert "| room | no noise | 4.25 | 4.25 | 4.25 | – |" in block(text, "statistics")
    assert "ROOM has no mirrors." in block(text, "reflections")


def test_text_by_hand_stays_and_what_was_not_measured_too(results, written, tmp_path):
    target, _ = written
    only = {scene: {"shares": items["shares"]} for scene, items in results.items()}
    other = tmp_path / "case-studies.md"
    write_document(only, SMALL, tmp_path, target, other)
    assert other.read_text() == target.read_text()
    start = TEMPLATE.read_text().split("<!--")[0]
    assert target.read_text().startswith(start)


def test_what_older_code_measured_is_said_to_be_so(results, written, tmp_path):
    target, other = written[0], tmp_path / "case-studies.md"
    room, atrium = (results[scene]["shares"] for scene in ("room", "atrium"))
    older = dataclasses.replace(room, date="2026-10-01", code="0123")
    write_document({"room": {"shares": older}, "atrium": {"shares": atrium}}, SMALL, tmp_path, target, other)
    said = "*Measured: ROOM 2026-10-01, by older code; ATRIUM 2026-11-22.*"
    assert said in block(other.read_text(), "shares")


def test_a_document_without_a_block_is_refused_before_anything_is_measured(tmp_path):
    check_blocks(TEMPLATE)
    file = tmp_path / "case-studies.md"
    file.write_text(TEMPLATE.read_text().replace("<!-- shares -->", ""))
    with pytest.raises(InputError, match="no block <!-- shares -->"):
        check_blocks(file)


def test_a_block_is_replaced_and_the_rest_stays():
    text = "before\n<!-- a -->\nold\n<!-- /a -->\nafter\n<!-- b -->\n<!-- /b -->\n"
    new = replaced(text, "a", r"new \1")
    assert new == "before\n<!-- a -->\n\nnew \\1\n\n<!-- /a -->\nafter\n<!-- b -->\n<!-- /b -->\n"
    assert replaced(new, "a", r"new \1") == new
    with pytest.raises(InputError, match="no block"):
        replaced(text, "c", "x")


def test_the_forecast_grows_with_paths_and_shrinks_with_cores():
    small, full = (forecast_s(("room", "atrium"), ITEMS, TERMS[name], 2) for name in ("small", "full"))
    assert 60.0 < small < 900.0
    assert full > 3.0 * small
    assert forecast_s(("room", "atrium"), ITEMS, TERMS["small"], 4) == pytest.approx(small / 2.0)
