"""The page contains the results of a run, in whatever state it is."""

import base64
import io
import json
import re
import shutil

import numpy as np
import pytest
from markupsafe import escape
from PIL import Image

import enfilade
from enfilade.comparison import CompareOptions, compare
from enfilade.errors import DamagedFileError, ImageError, RunFolderError, SettingsError
from enfilade.files import write_json
from enfilade.images import read_exr, write_exr
from enfilade.images.view import open_view
from enfilade.kernels.tone import srgb_encode
from enfilade.monitor import Silence
from enfilade.records import Provenance
from enfilade.reports.charts import PROVENANCE_COLORS
from enfilade.reports.film import Film
from enfilade.reports.page import write_report
from enfilade.reports.run import ReportedRun
from enfilade.reports.tables import percent
from enfilade.runs.folder import RunFolder
from enfilade.runs.lock import Lock
from enfilade.runs.statistics import statistics
from enfilade.settings import VideoSettings
from support.fake_blender import NOTE, RESULT
from support.synthetic_runs import FRAMES, SIZE, synthetic_run
from support.views import write_config


class Notes(Silence, list):
    """A monitor that keeps messages."""

    message = list.append


def written(folder, tmp_path, **terms):
    """Notes, text and data of a page."""
    notes = Notes()
    text = write_report(folder, out=tmp_path / "report.html", monitor=notes, **terms).read_text()
    return notes, text, data_of(text)


def test_what_blender_did_not_carry_over_is_listed(copied, tmp_path):
    """The importer's notes lie beside the scene that the job names."""
    scene = tmp_path / "scene"
    scene.mkdir()
    job = json.loads((copied / "job.json").read_text())
    (copied / "job.json").write_text(json.dumps({**job, "scene": {"file": str(scene / "scene.xml")}}))
    assert "Imported from" not in written(copied, tmp_path)[1]
    lost = [{"kind": "not-carried", **NOTE, "object": f"<b>{name}</b>"} for name in ("Sofa", "Chair")]
    table = {**RESULT, "source": "shot.blend", "notes": lost}
    (scene / "import.json").write_text(json.dumps(table))
    text = written(copied, tmp_path)[1]
    section = re.search(r'aria-labelledby="import-heading">(.*?)</section>', text, re.DOTALL)[1]
    assert "Imported from shot.blend" in section
    assert re.findall("<h3>(.*?)</h3>", section) == ["Not carried over"]
    assert "&lt;b&gt;Sofa&lt;/b&gt; / Noise Texture, &lt;b&gt;Chair&lt;/b&gt; / Noise Texture" in section
    (scene / "import.json").write_text("{")
    notes, text, _ = written(copied, tmp_path)
    assert "import.json is damaged" in notes[0]
    assert "Imported from" not in text


def data_of(text):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    return json.loads(found[1])


def numbers_of(data):
    return [frame["number"] for frame in data["frames"]]


def series_of(text, data):
    """Values of the charts by panel and series."""
    figures = re.findall(r"<figure>(.*?)</figure>", text, re.DOTALL)
    found = {}
    for figure, values in zip(figures, data["values"], strict=True):
        names = re.findall(r"</span> (.*?) <b></b>", figure)
        found[re.search(r'data-panel="(\w+)"', figure)[1]] = dict(zip(names, values, strict=True))
    return found


def picture(data, index, layer):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data["frames"][index]["layers"][layer]))))


def test_charts_and_tables_have_the_figures_of_the_run(runs, page_file):
    text = page_file.read_text()
    summary = statistics(RunFolder.read(runs / "run"))
    assert "finished</span> all 10 frames and the video" in text
    for name in ("slow", "specular", "disoccluded", "keyframe"):
        assert f"<td>{percent(summary['traced_percent'][name])}</td>" in text
    for stage in ("gbuffer", "analysis", "probe", "frames", "video"):
        assert f'<th scope="row">{stage}</th>' in text
    series = series_of(text, data_of(text))
    assert list(series) == ["velocity", "rays", "quality", "time"]
    speeds = [row["velocity_deg_s"] for row in summary["per_frame"]]
    drawn = series["velocity"]["mean over the image"]
    assert drawn == pytest.approx(speeds, rel=1e-3)
    assert series["velocity"]["keyframes"] == [drawn[0], *[None] * 8, drawn[-1]]
    assert series["rays"]["probe rays"] == [2.0] * 10  # kinds of rays are words of the method
    assert series["time"]["probe"] == [0.75] * 10
    assert re.search(r'class="changed"><th scope="row" title="Seed[^"]*">seed</th><td>7 <small>\(0\)', text)
    assert '<th scope="row" title="">count</th><td>3</td>' in text  # of a section of the method


def test_nothing_comes_from_elsewhere(page_file):
    own = page_file.read_text().partition('id="data">')[0]
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:|#)""", own)
    assert "default-src 'none'" in own
    names = re.findall(r'\sid="([^"]*)"', own)
    assert len(names) == len(set(names))


def test_the_score_is_that_of_compare(runs, page_file):
    found = compare(runs / "run", runs / "reference", CompareOptions(), Silence()).to_dict()
    text = page_file.read_text()
    scores = [row["score_jnd"] for row in found["per_frame"]]
    assert series_of(text, data_of(text))["quality"]["score"] == pytest.approx(scores, abs=1e-3)
    assert f"{found['score_jnd']:.2f} JND" in text
    assert f"{found['psnr_db']:.2f} dB" in text


def test_the_remarks_of_the_comparison_are_notes(copied, tmp_path):
    """The run and the reference are of one method and seed, along other poses; a frame is negative."""
    path = {"size": list(SIZE), "fps": 24.0, "frames": list(FRAMES), "cuts": [6], "poses": "4567"}
    reference = synthetic_run(tmp_path / "reference", path=path)
    file = reference / "frames" / "0003.exr"
    layers = read_exr(file)
    layers["RGB"][5, 5] = -0.5
    write_exr(file, layers)
    notes, text, _ = written(copied, tmp_path, reference=reference)
    for part in (
        "from the reference",
        "different camera paths",
        "one method and --seed 7",
        "negative values",
    ):
        assert sum(part in note for note in notes) == 1
    assert len(notes) == 4
    assert all(str(escape(note)) in text for note in notes)


def test_the_comparison_has_the_view_of_the_video(copied, runs, tmp_path):
    pytest.importorskip("PyOpenColorIO")
    job = json.loads((copied / "job.json").read_text())
    before = series_of(*written(copied, tmp_path, reference=runs / "reference")[1:])["quality"]["score"]
    job["settings"]["video"]["ocio"] = write_config(tmp_path)
    write_json(copied / "job.json", job)
    plain = runs / "reference" / "frames"
    notes, text, data = written(copied, tmp_path, reference=plain)
    assert sum("the view default of " in note for note in notes) == 1
    scores = series_of(text, data)["quality"]["score"]
    assert scores != pytest.approx(before, rel=0.05)
    assert scores == pytest.approx([row.score for row in enfilade.compare(copied, plain).frames], abs=1e-3)


def test_a_second_reference_adds_the_noise_floor(runs, copied, tmp_path):
    second = synthetic_run(tmp_path / "second", noise=0.02)
    sources = {"reference": runs / "reference", "second_reference": second}
    _, text, data = written(copied, tmp_path, **sources)
    found = enfilade.compare(copied, runs / "reference", second_reference=second).to_dict()
    floor = found["noise_floor"]
    drawn = series_of(text, data)["quality"]["noise floor: reference against reference"]
    assert drawn == pytest.approx(floor["per_frame_jnd"], abs=1e-3)
    assert f"{floor['score_jnd']:.2f} JND" in text
    assert found["noise_note"].removeprefix("reference noise: ") in text
    assert str(second) in text
    with pytest.raises(SettingsError, match="--second-reference is given alone"):
        written(copied, tmp_path, second_reference=second)


def test_the_pictures_are_those_of_the_files(runs, page_file):
    data = data_of(page_file.read_text())
    layers, other = (read_exr(runs / name / "frames" / "0004.exr") for name in ("run", "reference"))
    ours, theirs = (255.0 * srgb_encode(of["RGB"].astype(np.float32)) for of in (layers, other))
    assert np.abs(picture(data, 3, "result") - ours).mean() < 6.0  # WebP loses a little
    painted = picture(data, 3, "provenance")
    assert (painted[layers["provenance"] == Provenance.REUSED][:, 3] == 0).all()
    for name, color in PROVENANCE_COLORS.items():
        is_there = layers["provenance"] == Provenance[name.upper()]
        assert (painted[is_there] == [*bytes.fromhex(color[1:]), 255]).all()
    brightness, error = picture(data, 3, "difference").mean(axis=2), np.abs(ours - theirs).mean(axis=2)
    assert np.corrcoef(brightness.ravel(), error.ravel())[0, 1] > 0.7
    assert data["frames"][0]["kind"] == data["frames"][-1]["kind"] == "keyframe"
    assert data["frames"][3]["kind"] == ""


def test_without_a_reference_its_layers_are_missing(copied, tmp_path):
    notes, text, data = written(copied, tmp_path)
    assert [layer["name"] for layer in data["layers"]] == ["result", "provenance", "velocity"]
    assert "Difference from the reference" not in text
    assert notes == []
    assert enfilade.report(copied) == copied / "report.html"
    assert data_of((copied / "report.html").read_text()) == data


def test_a_run_without_its_video_is_not_finished(tmp_path):
    """Also with that of other settings, while the new one is encoded."""
    folder = synthetic_run(tmp_path / "run")
    before = (folder / "job.json").read_text()
    for name, other in (("codec", "ffv1"), ("quality", 20)):
        job = json.loads(before)
        job["settings"]["video"][name] = other
        write_json(folder / "job.json", job)
        assert "state state-unfinished" in written(folder, tmp_path)[1]
    (folder / "job.json").write_text(before)
    assert "state state-finished" in written(folder, tmp_path)[1]
    (folder / "video.mp4").unlink()
    assert "state state-unfinished" in written(folder, tmp_path)[1]


def test_a_running_run_is_shown_as_far_as_it_is_finished(tmp_path):
    folder = synthetic_run(tmp_path / "run", finished=(1, 2, 3, 5))
    with (folder / "ledger.jsonl").open("a") as ledger:
        ledger.write('{"pass": "frames", "fra')  # being written just now
    before = {file: file.read_bytes() for file in folder.rglob("*.[!l]*")}
    notes, text, data = written(folder, tmp_path)
    assert "state state-unfinished" in text
    assert "4 of 10 frames, last result" in text
    assert "rays per pixel so far" in text
    lock = Lock(folder)
    try:
        assert re.search(r"state-running.*4 of 10 frames, .*; process \d+ on", written(folder, tmp_path)[1])
    finally:
        lock.release()
    assert numbers_of(data) == [1, 2, 3, 5]
    assert notes == []
    notes, text, data = written(folder, tmp_path, reference=synthetic_run(tmp_path / "reference"))
    assert notes == ["6 frames are missing, so that the run is not compared with the reference"]
    assert "Difference from the reference" not in text
    assert numbers_of(data) == [1, 2, 3, 5]
    assert {file: file.read_bytes() for file in folder.rglob("*.[!l]*")} == before  # of all but run.lock


def test_before_the_first_frame(tmp_path):
    notes, text, data = written(synthetic_run(tmp_path / "run", finished=()), tmp_path)
    assert "No frame to show yet" in text
    assert notes == ["no frame is finished yet"]
    assert data["frames"] == data["values"] == []


def test_lost_and_damaged_files(copied, tmp_path):
    (copied / "frames" / "0003.exr").write_bytes(b"no image")
    (copied / "frames" / "0004.exr").unlink()
    notes, text, data = written(copied, tmp_path)
    assert numbers_of(data) == [1, 2, *range(5, 11)]
    assert notes == ["the files of these frames are missing or damaged: 3, 4"]
    assert notes[0] in text
    file = copied / "frames" / "0005.exr"
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    with pytest.raises(DamagedFileError, match=r"0005\.exr is missing or damaged"):
        written(copied, tmp_path)
    (copied / "ledger.jsonl").write_text((copied / "ledger.jsonl").read_text().replace("0005.exr", "9.exr"))
    notes, _, data = written(copied, tmp_path)
    assert any("ledger.jsonl: line 12 is damaged" in note for note in notes)
    assert numbers_of(data) == [1, 2, *range(6, 11)]


def test_refused(runs, copied, tmp_path):
    for folder in (tmp_path / "none", tmp_path):
        with pytest.raises(RunFolderError, match="no run folder"):
            written(folder, tmp_path)
    for size in (0.5, float("nan")):
        with pytest.raises(SettingsError, match="give 1 or more"):
            written(copied, tmp_path, max_mb=size)
    with pytest.raises(ImageError, match="run has the frame 4"):
        written(copied, tmp_path, reference=synthetic_run(tmp_path / "part", finished=(1, 2, 3)))
    (copied / "job.json").write_text("{}")
    with pytest.raises(RunFolderError, match=r"job\.json is damaged"):
        written(copied, tmp_path)


def film_of(folder, max_bytes):
    film = Film(ReportedRun(folder), open_view(VideoSettings(), 0.0), None, max_bytes, Silence())
    return film, sum(len(text) for frame in film.frames for text in frame["layers"].values())


def test_where_there_is_little_room_frames_are_left_out_evenly(runs):
    most = film_of(runs / "run", 1e9)[1] / 2.5
    film, size = film_of(runs / "run", most)
    numbers = numbers_of({"frames": film.frames})
    assert (numbers[0], numbers[-1]) == (1, 10)
    assert np.ptp(np.diff(numbers)[:-1]) == 0
    assert film.notes == [
        f"the player has {len(numbers)} of 10 frames, to keep the page small; charts and tables have all"
    ]
    assert size <= 1.1 * most


def test_no_frame_is_left_out_where_scaling_is_enough(runs, monkeypatch):
    whole = film_of(runs / "run", 1e9)[1]
    monkeypatch.setattr("enfilade.reports.film.LEAST_WIDTH_PX", 16)
    for part in np.linspace(0.2, 0.7, 20):
        assert len(film_of(runs / "run", part * whole)[0].frames) == 10


def test_wide_pictures_are_scaled(runs, monkeypatch):
    monkeypatch.setattr("enfilade.reports.film.WIDEST_PX", 32)
    film, _ = film_of(runs / "run", 1e9)
    assert film.size == (32, 24)
    assert picture({"frames": film.frames}, 1, "provenance").shape == (24, 32, 4)
    assert film.notes == ["pictures are scaled from 64x48 to 32x24 pixels"]


def test_names_are_text_and_not_markup(runs, tmp_path):
    folder = shutil.copytree(runs / "run", tmp_path / "<img src=x onerror=alert(1)>")
    identity = {"method": {"name": "<b>", "revision": 1}}
    for run in (folder, synthetic_run(tmp_path / "b", metadata={"rays": {"<img>": 1}}, **identity)):
        _, text, _ = written(run, tmp_path)
        assert "<img" not in text.partition('id="data">')[0]
        assert "<b>" not in text.partition("<dd>")[2].partition("</dd>")[0]


def test_methods_without_rays_or_layers(tmp_path):
    folder = synthetic_run(tmp_path / "run", metadata={"dropped": 2}, layers=["RGB"])
    notes, text, data = written(folder, tmp_path)
    assert list(series_of(text, data)) == ["velocity", "traced", "time"]
    assert [layer["name"] for layer in data["layers"]] == ["result"]
    assert notes == ["20 samples were NaN or infinite and were left out"]
    assert "Rays per pixel" not in text
