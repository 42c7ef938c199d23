"""The bench on a scene in closed form, which costs next to nothing to trace."""

import dataclasses
import json
import shutil

import numpy as np
import pytest

from enfilade.comparison.measures import JUDGES, why_missing
from enfilade.errors import RunFolderError, SettingsError
from enfilade.images import open_sequence, read_exr
from enfilade.methods.denoise import why_no_denoiser
from enfilade.monitor import Silence
from enfilade.settings import Metering
from printed import as_text
from scenes_analytic import room, room_walk
from small_runs import Told, job_of
from studies.bench import bench as module
from studies.bench.bench import Terms, bench
from studies.bench.charts import plot_bench
from studies.bench.contestants import Preset, chosen, lineup, read_presets
from studies.bench.pictures import plot_crops, plot_slices, write_differences
from studies.bench.race import Spent
from studies.bench.tables import bench_tables

PRESETS = (
    Preset("paper-2", "paper", {"trace": {"spp": 2}}),
    Preset("paper-8", "paper", {"trace": {"spp": 8}}),
)
TERMS = Terms(reference_spp=64)


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    job = job_of(folder, room(), room_walk(5, size=(64, 48)), method="reference")
    everybody = lineup(job, traced=(1, 4), denoised=(2,), presets=PRESETS)
    told = Told()
    return job, everybody, folder / "bench", bench(job, everybody, TERMS, folder / "bench", told), told


def test_everybody_is_rendered_charged_and_judged(held):
    _, everybody, folder, found, _ = held
    able = [c.name for c in everybody if c.family != "denoised" or not why_no_denoiser()]
    assert [row["name"] for row in found["contestants"]] == able
    judges = [name for name in JUDGES if not why_missing(name)]
    for row in found["contestants"]:
        assert row["cost"]["cpu_s"] > 0.0
        assert row["cost"]["wall_s"] > 0.0
        assert 50.0 < row["cost"]["peak_mib"] < 4000.0
        assert row["cost"]["start_cpu_s"] > 0.0
        assert list(row["scores"]) == judges
        assert all(len(values) == 5 for values in row["per_frame"].values())
        assert row["per_frame"]["temporal"][0] is None
        assert len(list((folder / "contestants" / row["name"] / "frames").glob("*.exr"))) == 5
    assert json.loads((folder / "bench.json").read_text()) == json.loads(json.dumps(found))
    assert found["exposure_ev"] == 0.0


def test_more_paths_are_judged_better_and_the_box_has_its_own_reference(held):
    *_, found, _ = held
    rows = {row["name"]: row for row in found["contestants"]}
    for judge in found["judges"]:
        few, many = rows["traced-1"]["scores"][judge], rows["traced-4"]["scores"][judge]
        assert (many > few) == found["judges"][judge]["is_more_better"]
    assert rows["traced-4"]["pixel_filter"] == "gaussian"
    if "denoised-2" in rows:
        assert rows["denoised-2"]["pixel_filter"] == "box"
        assert set(found["reference"]["filters"]) == {"box", "gaussian"}
        assert {of["variant"] for of in found["reference"]["filters"].values()} == {"llvm"}
        assert set(rows["denoised-2"]["cost"]["stages"]) == {"start", "frames"}


def test_references_draw_other_random_numbers_than_contestants(held):
    _, _, folder, *_ = held
    runs = [json.loads((folder / place / "run.json").read_text()) for place in
            ("references/reference-gaussian", "contestants/traced-4")]  # fmt: skip
    assert runs[0]["identity"]["trace"]["seed"] != runs[1]["identity"]["trace"]["seed"]


def test_of_keyframes_minterpolate_keeps_the_colours(held):
    _, _, folder, found, _ = held
    name = next(row["name"] for row in found["contestants"] if row["family"] == "interpolated")
    for frame in (1, 5):
        both = [
            read_exr(folder / "contestants" / one / "frames" / f"{frame:04d}.exr")["RGB"]
            for one in (name, "traced-4")
        ]
        np.testing.assert_array_equal(*both)


def test_what_is_finished_is_not_done_again(held):
    job, everybody, folder, found, _ = held
    told = Told()
    again = bench(job, everybody, TERMS, folder, told)
    assert not told.stages
    assert again["contestants"] == found["contestants"]


def test_one_that_was_begun_anew_and_killed_is_finished(held, tmp_path):
    job, everybody, folder, found, _ = held
    shutil.copytree(folder, tmp_path / "bench")
    half = tmp_path / "bench" / "contestants" / "traced-1"
    lines = (half / "ledger.jsonl").read_text().splitlines(keepends=True)
    (half / "ledger.jsonl").write_text("".join(lines[:3]))
    for number in (4, 5):
        (half / "frames" / f"{number:04d}.exr").unlink()
    again = bench(job, everybody, TERMS, tmp_path / "bench", Told())
    assert len(list((half / "frames").glob("*.exr"))) == 5
    assert [row["scores"] for row in again["contestants"]] == [row["scores"] for row in found["contestants"]]


def test_a_contestant_can_be_added_and_one_begun_anew(held):
    job, everybody, folder, found, _ = held
    more = lineup(job, traced=(2,), denoised=(), presets=())[:1]
    told = Told()
    terms = dataclasses.replace(TERMS, redo=("traced-1",))
    again = bench(job, [*everybody[:1], *more], terms, folder, told)
    assert [row["name"] for row in again["contestants"]] == ["traced-1", "traced-2"]
    assert {stage.partition(":")[0] for stage in told.stages} - {"noise of the reference"} == {
        "traced-1",
        "traced-2",
    }
    # the same random numbers, so the same frames, and so the same verdicts
    assert again["contestants"][0]["scores"] == found["contestants"][0]["scores"]


def test_a_preset_of_the_same_name_with_other_settings_is_refused(held):
    job, _, folder, *_ = held
    other = lineup(job, traced=(), denoised=(), presets=(Preset("paper-2", "paper", {"trace": {"spp": 3}}),))
    with pytest.raises(RunFolderError, match=r"trace\.spp.*--redo paper-2"):
        bench(job, other, TERMS, folder, Silence())


def test_another_bench_is_refused(held):
    job, everybody, folder, *_ = held
    with pytest.raises(RunFolderError, match="reference_spp"):
        bench(job, everybody, Terms(reference_spp=32), folder, Silence())


def test_the_pictures_and_tables(held, tmp_path):
    _, _, folder, found, _ = held
    for file in (
        plot_bench(found, tmp_path / "bench.png"),
        plot_crops(found, folder, tmp_path / "crops.png"),
        plot_slices(found, folder, tmp_path / "slices.png"),
    ):
        assert file.read_bytes().startswith(b"\x89PNG")
    videos = [open_sequence(file) for file in write_differences(found, folder)]
    assert len(videos) == len(found["contestants"])
    assert all((len(video), video.width, video.height) == (5, 128, 48) for video in videos)
    text = "".join(as_text(table) for table in bench_tables(found))
    for row in found["contestants"]:
        assert row["name"] in text


def test_who_can_not_take_part_is_named(held, tmp_path, monkeypatch):
    job, *_ = held
    monkeypatch.setattr(module, "why_no_denoiser", lambda: "no denoiser here")
    reasons = {name: "" if name == "psnr" else f"no {name} here" for name in JUDGES}
    monkeypatch.setattr(module, "why_missing", reasons.get)
    told = Told()
    everybody = lineup(job, traced=(), denoised=(1,), presets=(Preset("light", "decoupled"), *PRESETS[:1]))
    found = bench(job, everybody, TERMS, tmp_path / "bench", told)
    assert [row["name"] for row in found["contestants"]] == ["paper-2"]
    *judges, denoised, light = found["left_out"]
    assert judges == [reason for reason in reasons.values() if reason]
    assert denoised == "path tracing, denoised does not take part: no denoiser here"
    assert light.startswith("decoupled does not take part:")
    assert "does not estimate lobes apart" in light
    assert told.said[: len(judges) + 2] == found["left_out"]
    assert list(found["judges"]) == ["psnr"]
    with pytest.raises(SettingsError, match="no flip here"):
        bench(job, everybody, Terms(64, judges=("flip",)), tmp_path / "other", told)
    with pytest.raises(SettingsError, match=r"nobody can take part.*does not estimate lobes apart"):
        bench(job, everybody[-2:-1], TERMS, tmp_path / "other", told)
    assert not (tmp_path / "other").exists()


def test_a_folder_of_another_path_or_another_eye_is_refused(held, tmp_path):
    job, everybody, folder, *_ = held
    turned = dataclasses.replace(job.path, cameras=job.path.cameras[::-1])
    still = dataclasses.replace(job.settings.metric, metering=Metering.NONE)
    for other in (
        dataclasses.replace(job, path=turned),
        dataclasses.replace(job, settings=dataclasses.replace(job.settings, metric=still)),
    ):
        with pytest.raises(RunFolderError, match=r"poses|metering"):
            bench(other, everybody, TERMS, folder, Told())


def test_of_one_frame_no_flicker_is_counted(tmp_path):
    job = job_of(tmp_path, room(), room_walk(1, size=(32, 24)), method="reference")
    traced = lineup(job, traced=(1,), denoised=(), presets=())[:1]
    told, terms = Told(), Terms(4, judges=("psnr", "temporal"))
    found = bench(job, traced, terms, tmp_path / "bench", told)
    assert list(found["judges"]) == list(found["contestants"][0]["scores"]) == ["psnr"]
    assert list(found["reference"]["floor"]) == ["psnr"]
    assert "'temporal' is left out" in found["left_out"][0]
    assert found["left_out"] == told.said
    with pytest.raises(SettingsError, match="give it consecutive frames, or let others judge"):
        bench(job, traced, Terms(4, judges=("temporal",)), tmp_path / "bench", told)


def test_a_contestant_that_fails_says_why(held, tmp_path):
    job, *_ = held
    settings = dataclasses.replace(job.settings.trace, spp=1)
    bad = dataclasses.replace(job, settings=dataclasses.replace(job.settings, trace=settings))
    everybody = lineup(bad, traced=(), denoised=(), presets=(Preset("light", "decoupled"),))
    with pytest.raises(SettingsError, match="does not estimate lobes apart"):
        bench(bad, everybody, TERMS, tmp_path / "bench", Silence())


class Impatient(Told):
    """Presses Ctrl-C after some frames."""

    def __init__(self, frames):
        super().__init__()
        self._left = frames

    def advance(self, count=1):
        self._left -= count
        if self._left < 0:
            raise KeyboardInterrupt


def test_an_interrupted_contestant_goes_on_and_all_its_sessions_are_charged(held, tmp_path):
    job, everybody, _, found, _ = held
    name, place = "traced-4", tmp_path / "bench"
    only = [c for c in everybody if c.name == name]
    with pytest.raises(KeyboardInterrupt):  # after the reference and two frames
        bench(job, only, TERMS, place, Impatient(5 + 2))
    made = {f: f.stat().st_mtime_ns for f in (place / "contestants" / name / "frames").glob("[0-9]*.exr")}
    assert 2 <= len(made) <= 5
    row = bench(job, only, TERMS, place, Silence())["contestants"][0]
    assert all(file.stat().st_mtime_ns == at for file, at in made.items())
    assert row["cost"]["sessions"] == 2
    first = json.loads((place / "spent" / name / "0000.json").read_text())
    assert row["cost"]["cpu_s"] > first["cpu_s"]
    assert row["scores"] == next(r for r in found["contestants"] if r["name"] == name)["scores"]


def test_presets_of_a_file(tmp_path):
    file = tmp_path / "presets.toml"
    file.write_text('[fine]\nmethod = "decoupled"\ntrace = { spp = 64 }\n[old]\nmethod = "paper"\n')
    assert read_presets(file) == (Preset("fine", "decoupled", {"trace": {"spp": 64}}), Preset("old", "paper"))
    for text, message in (
        ("[a]\n", "needs method"),
        ("", "no preset"),
        ('["../x"]\nmethod = "paper"\n', "folder"),
    ):
        file.write_text(text)
        with pytest.raises(SettingsError, match=message):
            read_presets(file)


def test_contestants_are_chosen_by_pattern(held):
    _, everybody, *_ = held
    assert [c.name for c in chosen(everybody, ["traced-*", "paper-8"])] == ["traced-1", "traced-4", "paper-8"]
    assert chosen(everybody, []) == everybody
    with pytest.raises(SettingsError, match="no contestant is called 'x'; there are: traced-1"):
        chosen(everybody, ["x"])


def test_sessions_add_up_and_starts_and_videos_are_not_charged():
    first = Spent({"start": (5.0, 6.0), "frames": (10.0, 11.0)}, 100, 1)
    second = Spent({"start": (4.0, 4.0), "frames": (1.0, 2.0), "video": (7.0, 7.0)}, 300, 1)
    both = first + second
    assert (both.cpu_s, both.wall_s, both.peak_bytes, both.sessions) == (11.0, 13.0, 300, 2)
    assert Spent.from_dict(json.loads(json.dumps(both.to_dict()))).stages == both.stages


def test_the_floor_is_what_a_perfect_contestant_would_get(held, tmp_path):
    job, _, _, found, _ = held
    floor = found["reference"]["floor"]
    rows = {row["name"]: row["scores"] for row in found["contestants"]}
    for judge in found["judges"]:
        assert (floor[judge] > rows["traced-4"][judge]) == found["judges"][judge]["is_more_better"]
    # Four times the paths in the reference, half the noise: 6 dB, less what clipping takes.
    more = bench(
        job, lineup(job, traced=(4,), denoised=(), presets=()), Terms(256, ("psnr",)), tmp_path, Silence()
    )
    assert more["reference"]["floor"]["psnr"] - floor["psnr"] == pytest.approx(6.0, abs=1.0)
