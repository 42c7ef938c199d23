"""The page says what the run's files say, whatever state they are in."""

import base64
import io
import json
import re
import shutil

import numpy as np
import pytest
from PIL import Image

from enfilade.comparison import Terms, compare
from enfilade.errors import RunFolderError, SettingsError
from enfilade.images import read_exr, write_exr
from enfilade.images.view import open_view
from enfilade.kernels.tone import srgb_encode
from enfilade.monitor import Silence
from enfilade.records import Provenance
from enfilade.reports.film import encode_film
from enfilade.reports.layers import SOURCE_COLORS
from enfilade.reports.page import Wishes, write_page
from enfilade.reports.seen import SeenRun
from enfilade.reports.tables import percent
from enfilade.settings import Settings, VideoSettings
from enfilade.store.ledger import sealed
from enfilade.store.lock import Lock
from small_runs import TABLES

FRAMES = 10


def written(folder, tmp_path, **wishes):
    """Notes, text and data of a page."""
    file = tmp_path / "report.html"
    notes = write_page(folder, file, Wishes(**wishes), Silence())
    text = file.read_text(encoding="utf-8")
    return notes, text, data_of(text)


def data_of(text):
    return json.loads(
        re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)[1]
    )


def picture(data, index, layer):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data["frames"][index]["layers"][layer]))))


def unit_lines(folder):
    return (folder / "ledger.jsonl").read_text().splitlines(keepends=True)


def keep_lines(folder, is_kept):
    read = [(line, json.loads(line)) for line in unit_lines(folder)]
    kept = [line for line, value in read if "unit" not in value or is_kept(value["unit"])]
    (folder / "ledger.jsonl").write_text("".join(kept))


def test_it_says_what_the_summary_says(runs, page_file):
    text, summary = page_file.read_text(), json.loads((runs / "paper" / "summary.json").read_text())
    for share in summary["table1"].values():
        assert f">{percent(share)}</td>" in text
    for stage in summary["table2"]["stages"]:
        assert f'<th scope="row">{stage}</th>' in text
    data = data_of(text)
    assert [frame["effort"] for frame in data["frames"]] == [row["traced"] for row in summary["per_frame"]]
    names = [panel["name"] for panel in data["panels"]]
    assert names == ["velocity", "traced", "predictions", "score"]
    assert data["panels"][0]["traces"][0]["y"] == pytest.approx(
        [row["velocity_deg_s"] for row in summary["per_frame"]], abs=1e-4
    )


def test_nothing_comes_from_elsewhere(page_file):
    own = page_file.read_text().partition('id="data">')[0]
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:)""", own)
    assert "default-src 'none'" in own


def test_the_score_is_that_of_compare(runs, page_file):
    terms = Terms(viewing=Settings.from_tables(TABLES).viewing)
    found = compare(str(runs / "paper"), str(runs / "reference"), terms, Silence()).to_dict()
    frames = data_of(page_file.read_text())["frames"]
    scores = [row["score_jnd"] for row in found["per_frame"]]
    assert [frame["score"] for frame in frames] == pytest.approx(scores, rel=1e-5)
    assert [frame["psnr"] for frame in frames] == pytest.approx(
        [row["psnr_db"] for row in found["per_frame"]], abs=1e-4
    )
    assert f"{found['score_jnd']:.2f} JND" in page_file.read_text()


def test_the_pictures_are_those_of_the_files(runs, page_file):
    data = data_of(page_file.read_text())
    layers = read_exr(runs / "paper" / "frames" / "0004.exr")
    expected = 255.0 * srgb_encode(np.clip(layers["RGB"].astype(np.float32), 0.0, 1.0))
    shown = picture(data, 3, "result").astype(float)
    assert np.abs(shown - expected).mean() < 6.0  # WebP loses a little, most at edges of colour
    mapped = picture(data, 3, "source")
    assert set(np.unique(layers["source"])) >= {Provenance.REUSED, Provenance.SPECULAR}
    assert (mapped[layers["source"] == Provenance.REUSED][:, 3] == 0).all()
    for source, color in SOURCE_COLORS.items():
        assert (mapped[layers["source"] == source] == [*bytes.fromhex(color[1:]), 255]).all()


def test_without_a_reference_layers_are_missing_and_it_says_so(runs, tmp_path):
    notes, _, data = written(runs / "paper", tmp_path)
    assert [layer["key"] for layer in data["layers"]] == [1, 2, 4]
    assert any("no map of probability" in note for note in notes)


def test_without_the_metric_there_is_a_difference(runs, tmp_path):
    _, text, data = written(runs / "paper", tmp_path, reference=runs / "reference", has_metric=False)
    assert [layer["name"] for layer in data["layers"]] == ["result", "source", "velocity", "difference"]
    assert data["panels"][-1]["name"] == "psnr"
    assert ">pixels above 1 JND<" not in text


def test_a_running_run_is_shown_as_far_as_it_has_come(copied, tmp_path):
    keep_lines(copied, lambda unit: unit not in ("frame 9", "frame 10", "video"))
    with (copied / "ledger.jsonl").open("a") as ledger:
        ledger.write('{"unit": "frame 9", "fil')  # being written just now
    (copied / "summary.json").unlink()
    before = {file: file.read_bytes() for file in copied.rglob("*") if file.is_file()}
    lock = Lock(copied)
    try:
        notes, text, data = written(copied, tmp_path)
    finally:
        lock.release()
    assert "state-running" in text
    assert "8 of 10 frames finished; process" in text
    assert re.search(r"About \d+ s left, at the pace of the last 8 frames", text)
    assert [frame["number"] for frame in data["frames"]] == list(range(1, FRAMES + 1))
    assert [frame["number"] for frame in data["frames"] if frame["isRaw"]] == [9, 10]
    assert "2 frames are shown before they are filtered over time, which the run has still to do" in notes
    assert "velocity" not in data["frames"][-1]["layers"]
    assert not any("damaged" in note for note in notes)
    unchanged = {file: data for file, data in before.items() if file.name != "run.lock"}
    assert all(file.read_bytes() == data for file, data in unchanged.items())


def test_a_run_that_was_stopped_early(copied, tmp_path):
    keep_lines(copied, lambda unit: unit == "survey")
    notes, text, data = written(copied, tmp_path)
    assert "state-unfinished" in text
    assert "No frame to show yet" in text
    assert notes == ["there is no frame to show yet"]
    assert [panel["name"] for panel in data["panels"]] == ["velocity"]


def test_a_damaged_frame_is_named_and_left_out(copied, tmp_path):
    file = copied / "frames" / "0003.exr"
    file.write_bytes(file.read_bytes()[:500])
    notes, text, data = written(copied, tmp_path)
    assert [frame["number"] for frame in data["frames"]] == [1, 2, *range(4, FRAMES + 1)]
    assert any("frame 3 is left out" in note and "0003.exr" in note for note in notes)
    assert "frame 3 is left out" in text


def test_a_damaged_line_of_the_ledger_is_named_and_left_out(copied, tmp_path):
    lines = unit_lines(copied)
    number = next(i for i, line in enumerate(lines) if '"frame 5"' in line)
    lines[number] = lines[number][:40] + "\n"
    (copied / "ledger.jsonl").write_text("".join(lines))
    notes, _, data = written(copied, tmp_path)
    assert any(f"ledger.jsonl, line {number + 1} is damaged" in note for note in notes)
    assert data["frames"][4]["isRaw"]  # its line of before antialiasing is whole


def test_a_damaged_reference_leaves_the_frame(runs, copied, tmp_path):
    reference = shutil.copytree(runs / "reference", tmp_path / "reference")
    (reference / "frames" / "0002.exr").write_bytes(b"no image")
    notes, _, data = written(copied, tmp_path, reference=reference)
    assert any("frame 2 is shown without the reference" in note for note in notes)
    assert "difference" not in data["frames"][1]["layers"]
    assert data["frames"][1]["score"] is None
    assert "difference" in data["frames"][2]["layers"]


def test_what_is_no_run_is_refused(copied, tmp_path):
    with pytest.raises(RunFolderError, match="no folder"):
        written(tmp_path / "none", tmp_path)
    with pytest.raises(RunFolderError, match="no run folder"):
        written(tmp_path, tmp_path)
    (copied / "run.json").write_text("{")
    with pytest.raises(RunFolderError, match=r"run\.json is damaged"):
        written(copied, tmp_path)


def change_identity(folder, change):
    table = json.loads((folder / "run.json").read_text())
    change(table)
    (folder / "run.json").write_text(json.dumps(table))
    rest = [line for line in unit_lines(folder) if "unit" in json.loads(line)]
    (folder / "ledger.jsonl").write_text("".join(rest))  # without the checksum of run.json


def test_a_run_of_another_version(copied, tmp_path):
    def older(table):
        table["identity"]["versions"]["enfilade"] = "0.0.1"
        del table["identity"]["settings"]["viewing"]["persistence"]
        table["identity"]["settings"]["viewing"]["forgotten"] = 3

    change_identity(copied, older)
    notes, _, _ = written(copied, tmp_path)
    assert any("made with version 0.0.1" in note for note in notes)
    change_identity(copied, lambda table: table["identity"].pop("path"))
    with pytest.raises(RunFolderError, match=r"can't be shown: .* another version \(0\.0\.1"):
        written(copied, tmp_path)
    change_identity(copied, lambda table: table.update(format=99))
    with pytest.raises(RunFolderError, match="format 99"):
        written(copied, tmp_path)


def test_a_reference_of_the_bench_will_do(runs, tmp_path):
    def trimmed(table):
        table["identity"]["trace"] = {"spp": table["identity"].pop("settings")["trace"]["spp"]}

    reference = shutil.copytree(runs / "reference", tmp_path / "reference")
    change_identity(reference, trimmed)
    keep_lines(reference, lambda unit: unit.startswith("frame "))
    notes, text, data = written(runs / "paper", tmp_path, reference=reference, has_metric=False)
    assert "difference" in data["frames"][0]["layers"]
    assert "its paths a pixel" in text
    assert not any("not finished" in note for note in notes)


def test_a_reference_of_another_size_is_refused(runs, copied, tmp_path):
    change_identity(copied, lambda table: table["identity"]["path"].update(size=[64, 48]))
    with pytest.raises(RunFolderError, match="give one of equal size"):
        written(runs / "paper", tmp_path, reference=copied)


def test_chosen_frames(runs, tmp_path):
    _, _, data = written(runs / "paper", tmp_path, numbers=(2, 5))
    assert [frame["number"] for frame in data["frames"]] == [2, 5]
    with pytest.raises(SettingsError, match="has no frame 11"):
        written(runs / "paper", tmp_path, numbers=(2, 11))


def decoupled(folder):
    """Make a run one of the method that counts rays, as its ledger has it before any were sent."""
    change_identity(folder, lambda table: table["identity"].update(method="decoupled"))
    keep_lines(folder, lambda unit: unit == "survey")


def send_rays(folder):
    """One for each pixel of each frame."""
    path = json.loads((folder / "run.json").read_text())["identity"]["path"]
    count = path["size"][0] * path["size"][1] * len(path["frames"])
    with (folder / "ledger.jsonl").open("ab") as ledger:
        ledger.write(sealed({"unit": "draft 1", "files": {}, "frame": 1, "rays": {"drafts": count}}))


def test_a_method_that_counts_rays_traces_no_paths_also_before_it_has_counted_any(copied, tmp_path):
    decoupled(copied)
    _, text, data = written(copied, tmp_path)
    assert "<dt>paths a pixel</dt>" not in text
    assert "Pixels traced" not in text
    assert "<h2>Rays per pixel and frame</h2>" in text
    assert '<td class="sum">–</td>' in text
    assert data["unit"] == ""
    send_rays(copied)
    assert "<dt>rays a pixel</dt><dd>1.0</dd>" in written(copied, tmp_path)[1]


def test_a_reference_that_counts_rays_is_told_by_them(runs, tmp_path):
    reference = shutil.copytree(runs / "reference", tmp_path / "reference")
    change_identity(reference, lambda table: table["identity"].update(method="decoupled"))
    send_rays(reference)
    _, text, _ = written(runs / "paper", tmp_path, reference=reference, has_metric=False)
    assert "its paths a pixel" not in text
    assert re.search(r"its rays a pixel</th>\s*<td[^>]*>1\.0<", text)


def test_keyframes_are_named_where_other_frames_are_made_of_them(runs, tmp_path):
    kinds = [frame["kind"] for frame in written(runs / "paper", tmp_path)[2]["frames"]]
    assert (kinds[0], kinds[-1]) == ("keyframe", "keyframe")
    assert "in-between" in kinds
    _, _, data = written(runs / "reference", tmp_path)
    assert {frame["kind"] for frame in data["frames"]} == {""}


def test_a_page_that_can_not_be_kept_small_says_so(runs, tmp_path, monkeypatch):
    monkeypatch.setattr("enfilade.reports.page.LEAST_MB", 1.0)
    notes, text, _ = written(runs / "paper", tmp_path, max_mb=4.0)
    assert any("MB, more than the 4 that --max-mb asks for" in note for note in notes)
    assert "more than the 4 that --max-mb asks for" in text
    assert not any("--max-mb asks" in note for note in written(runs / "paper", tmp_path)[0])


def test_a_page_too_small_for_anything_is_refused(runs, tmp_path):
    for size in (1.0, float("nan")):
        with pytest.raises(SettingsError, match="give 8 or more"):
            written(runs / "paper", tmp_path, max_mb=size)


def test_where_there_is_little_room_frames_are_left_out_evenly(runs):
    seen = SeenRun(runs / "paper")
    view = open_view(VideoSettings(), 0.0)
    everything = encode_film(seen, seen.finished, None, view, Silence(), room_bytes=1e9)
    taken = sum(len(t) for f in everything.frames for t in f["layers"].values())
    film = encode_film(seen, seen.finished, None, view, Silence(), room_bytes=taken / 2.2)
    numbers = [frame["number"] for frame in film.frames]
    assert numbers[0] == 1
    assert len(numbers) < FRAMES / 2 + 1
    assert any(f"{len(numbers)} of 10 frames are on the page" in note for note in film.notes)
    assert sum(len(t) for f in film.frames for t in f["layers"].values()) <= taken / 2.2


def test_names_are_text_and_not_markup(runs, tmp_path):
    folder = shutil.copytree(runs / "paper", tmp_path / "<img src=x onerror=alert(1)>")
    _, text, _ = written(folder, tmp_path)
    assert "<img" not in text.partition('id="data">')[0]


def test_a_file_without_the_layers_of_a_frame(copied, tmp_path):
    # as of a run whose frames another program wrote anew: the checksum tells
    layers = read_exr(copied / "frames" / "0001.exr")
    write_exr(copied / "frames" / "0001.exr", {"RGB": layers["RGB"]})
    notes, _, _ = written(copied, tmp_path)
    assert any("0001.exr isn't what unit 'frame 1' wrote" in note for note in notes)
