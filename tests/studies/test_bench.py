"""The bench on a small room, from the command line to its files; and its baselines."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from enfilade.errors import SettingsError
from enfilade.images import read_exr
from enfilade.kernels.estimate import GAUSSIAN_RADIUS_PX, GAUSSIAN_SIGMA_PX
from enfilade.runs.folder import RunFolder
from enfilade.settings import (
    DecoupledSettings,
    KeyframeSettings,
    MaskSettings,
    Placement,
    ReferenceSettings,
    SampleFilter,
)
from studies.__main__ import main
from studies.bench.baselines import DenoiserSettings
from studies.bench.bench import _Bench, extrapolated, mean_cost, undecided
from studies.bench.configurations import configuration
from studies.bench.measures import QUALITIES
from studies.bench.measuring import FLIP_IS_MISSING, available, gaussian_of_box
from studies.bench.page import results_page
from studies.bench.suite import summary
from studies.bench.tables import bench_tables, cost_text
from support.console import as_text
from support.study_runs import room_files, room_job

MEASURES = ("aqm", "psnr", "flicker")
NAMES = ["traced-1", "traced-4", "denoised-2"]
SEEDED = "paper-16"


def frames_of(run):
    files = sorted((run / "frames").glob("*.exr"))
    return np.stack([read_exr(file)["RGB"].astype(float) for file in files])


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    """Arguments of a bench of three of four frames, 48x36; its folder is the last one."""
    folder = tmp_path_factory.mktemp("bench")
    flags = ("--reference-spp", 64, "--json", "--quiet")
    flags += ("--set", "masks.slow_deg_s=0.4")  # of a section that some configurations read
    flags += ("--seeds", 2, "--frames", "2-4", "--walkthrough", "1-4")
    only = [word for name in (*NAMES, SEEDED) for word in ("--only", name)]
    measures = [word for name in MEASURES for word in ("--measure", name)]
    words = ("bench", *room_files(folder, 4), *flags, *only, *measures, "--references", folder / "references")
    words += ("--out", folder / "bench")
    return [str(word) for word in words]


@pytest.fixture(scope="module")
def held(line):
    result = CliRunner().invoke(main, line)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout), Path(line[-1])


def test_every_configuration_is_rendered_charged_and_measured(held):
    found, folder = held
    assert [row["name"] for row in found["configurations"]] == [*NAMES, SEEDED]
    for row in found["configurations"][:-1]:
        assert [run["seed"] for run in row["seeds"]] == [0]
        cost = row["cost"]
        assert set(cost["stages"]) == {"frames", "trace", "files"}
        assert cost["start_cpu_s"] > 0.1  # at least Mitsuba's import
        stages = sum(stage["cpu_s"] for stage in cost["stages"].values())
        assert cost["cpu_s"] == pytest.approx(stages + cost["start_cpu_s"])
        assert cost["peak_mib"] > 50.0
        assert len(frames_of(folder / "configurations" / row["name"])) == 3  # the measured ones
        files = [folder / "scores" / f"{row['name']}{kind}.json" for kind in ("", ", box")]
        held_values = [json.loads(file.read_text())["values"] for file in files if file.is_file()]
        assert len(held_values) == (2 if row["pixel_filter"] == "box" else 1)
        values = row["values"]
        for name in MEASURES:
            assert values[name] == min((one[name] for one in held_values), key=QUALITIES[name].error)
        assert all(len(of) == len(found["windows"]) for of in values.values())
    assert json.loads((folder / "bench.json").read_text()) == found
    for name in ("bench.png", "crops.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    text = "".join(as_text(table) for table in bench_tables(found))
    assert all(name in text for name in (*NAMES, "noise floor"))


def test_the_page_of_results_has_a_row_for_each_configuration(held):
    found, _ = held
    benches = [found | {"split": "held-out"}]
    lines = results_page(benches, summary(benches), "2026-11-28").splitlines()
    tables = "\n".join(line for line in lines if line.startswith("|"))
    assert {line.count("|") for line in tables.splitlines()} == {5 + len(MEASURES), 4 + len(MEASURES)}
    assert all(tables.count(f"| `{name}` | ") >= 1 for name in [*NAMES, SEEDED])
    assert f"| 48x36 | held-out | 1 | `{SEEDED}` | " in tables
    assert f"| times, `{SEEDED}` |  |  | " in tables
    assert any(line.startswith("4 frames, 2-4 measured in ") for line in lines)


def test_methods_of_enfilade_are_rendered_with_several_seeds(held):
    """Their values and costs are the means; baselines have one seed (above)."""
    found, folder = held
    row = found["configurations"][-1]
    first, second = row["seeds"]
    assert (first["seed"], second["seed"]) == (0, 1)
    images = [frames_of(folder / "configurations" / name) for name in (SEEDED, f"{SEEDED}-seed-1")]
    assert not np.array_equal(*images)
    assert {len(frames) for frames in images} == {found["walkthrough_frames"]} == {4}
    for name in MEASURES:
        pairs = zip(first["values"][name], second["values"][name], strict=True)
        assert row["values"][name] == pytest.approx([(a + b) / 2.0 for a, b in pairs])
        assert first["values"][name] != second["values"][name]
    assert row["cost"]["cpu_s"] == pytest.approx((first["cpu_s"] + second["cpu_s"]) / 2.0)
    assert first["cpu_s"] != second["cpu_s"]
    assert row["cost"]["cpu_s"] == pytest.approx(
        sum(stage["cpu_s"] for stage in row["cost"]["stages"].values()) + row["cost"]["start_cpu_s"]
    )


def test_costs_of_baselines_are_extrapolated_to_all_frames_of_the_walkthrough():
    """The first task counts once; enfilade's methods render all frames, and single frames are multiples."""
    tasks = [{"trace": {"cpu_s": cpu_s}} for cpu_s in (5.0, 1.0, 2.0)]
    assert [one["trace"]["cpu_s"] for one in extrapolated(tasks, 3, 7)] == [5.0, 3.0, 6.0]
    assert list(extrapolated(tasks, 7, 7)) == tasks
    assert [one["trace"]["cpu_s"] for one in extrapolated(tasks[:1], 1, 4)] == [20.0]


def test_means_of_costs():
    one = {"cpu_s": 2.0, "peak_mib": 5.0, "kernels": 0, "stages": {"trace": {"cpu_s": 1.0, "wall_s": 1.0}}}
    two = {"cpu_s": 4.0, "peak_mib": 3.0, "kernels": 2, "stages": {"trace": {"cpu_s": 2.0, "wall_s": 1.5}}}
    assert mean_cost([one, two]) == {
        "cpu_s": 3.0, "peak_mib": 5.0, "kernels": 2, "stages": {"trace": {"cpu_s": 1.5, "wall_s": 1.25}},
    }  # fmt: skip


def test_more_paths_score_better_and_scores_near_the_noise_floor_are_undecided(held):
    found, _ = held
    rows = {row["name"]: row for row in found["configurations"]}
    for name in MEASURES:
        errors = [QUALITIES[name].error(rows[row]["values"][name]) for row in ("traced-1", "traced-4")]
        assert errors[0] > errors[1]
    assert set(found["reference"]["noise_floor"]) == {"aqm"}  # others do not contain the references' noise


@pytest.mark.parametrize(
    ("jod", "floor_jod", "is_undecided"),
    [(9.0, 9.9, False), (9.0, 9.0, True), (9.5, 9.0, True), (8.7, 9.0, True), (8.6, 9.0, False)],
)
def test_scores_up_to_a_third_above_the_floor_are_undecided(jod, floor_jod, is_undecided):
    """By the error: JOD rise with quality, and scores better than the floor are not decided either."""
    assert undecided({"cvvdp": [jod, jod], "psnr": [1.0, 1.0]}, {"cvvdp": [floor_jod, floor_jod]}) == (
        ["cvvdp"] if is_undecided else []
    )


def test_finished_configurations_are_not_rendered_again(held, line, run):
    found, folder = held
    made = {file: file.stat().st_mtime_ns for file in folder.rglob("*.exr")}
    again = json.loads(run(*line).stdout)
    assert again["configurations"] == found["configurations"]
    assert {file: file.stat().st_mtime_ns for file in folder.rglob("*.exr")} == made
    other = run(*line, "--seed", "7")
    assert other.exit_code == 2
    assert "holds another run" in other.stderr
    # A run of another machine, whose CPU time does not compare, is rendered again.
    file = folder / "costs" / "traced-4.json"
    cost = json.loads(file.read_text())
    file.write_text(json.dumps(cost | {"origin": {"machine": {"processor": "another", "cores": 2}}}))
    rendered = next((folder / "configurations" / "traced-4" / "frames").glob("*.exr"))
    run(*line)
    assert rendered.stat().st_mtime_ns != made[rendered]
    assert json.loads(file.read_text())["origin"] == cost["origin"]
    # So is a run that was interrupted, to the same end.
    lost = next((folder / "configurations" / "traced-4" / "frames").glob("*.exr"))
    lost.unlink()
    (folder / "configurations" / "traced-4" / "summary.json").unlink()
    again = json.loads(run(*line).stdout)
    assert lost.is_file()
    scores = [[row["values"] for row in of["configurations"]] for of in (again, found)]
    assert scores[0] == scores[1]


@pytest.mark.parametrize(("compiled", "runs"), [((0,), 1), ((40, 3, 0), 3), ((40, 3, 2), 3)])
def test_a_run_that_compiles_kernels_is_repeated(tmp_path, monkeypatch, compiled, runs):
    """Up to three times; then the tables say so."""
    job = room_job(tmp_path, 2)
    left = list(compiled)

    def rendered(device, function, job, folder, **options):
        assert not folder.exists()
        with RunFolder.create(folder, job.identity()):
            pass
        return {"cpu_s": 2.0, "kernels": left.pop(0), "peak_mib": 1.0}

    monkeypatch.setattr("studies.bench.bench.alone", rendered)
    one = configuration("traced-1", job)
    _Bench(one.job, 2, tmp_path, None, (), (), quiet=True)._render(one, tmp_path / "run")
    assert len(compiled) - len(left) == runs
    cost = json.loads((tmp_path / "costs" / "traced-1.json").read_text())["cost"]
    assert cost_text(cost | {"cpu_s": 2.0}, 2) == ("1.00 †" if compiled[-1] else "1.00")


def test_measured_frames_are_some_of_the_walkthrough(run, line):
    result = run(*line, "--walkthrough", "3-4")
    assert result.exit_code == 2
    assert "measured frames 2 are not among --walkthrough 3-4" in result.stderr


@pytest.mark.parametrize("name", ["best", "denoised", "denoised-0", "denoised-2.5", "denoised-2-slow",
                                  "traced-4-fast", "paper-16-uniform", "decoupled-10-fast"])  # fmt: skip
def test_an_unknown_configuration_is_refused(run, line, name):
    result = run(*line, "--only", name)
    assert result.exit_code == 2
    assert f"no configuration is called '{name}'; there are traced-N, denoised-N, denoised-N-fast" in (
        " ".join(result.stderr.split())
    )


def test_missing_measures_are_reported(tmp_path, monkeypatch):
    job = room_job(tmp_path, 2, method="reference")
    monkeypatch.setattr("studies.bench.measuring.find_spec", lambda _: None)
    monkeypatch.setattr("studies.bench.colorvideovdp.why_missing", lambda: "no cvvdp")
    assert available((), job) == (["aqm", "psnr", "relrmse", "flicker"], ["no cvvdp", FLIP_IS_MISSING])
    with pytest.raises(SettingsError, match=r"no measure 'ssim'; known are: cvvdp"):
        available(("ssim",), job)
    with pytest.raises(SettingsError, match=FLIP_IS_MISSING):
        available(("flip",), job)


def test_filtered_boxes_have_the_variance_of_the_gaussian_filter():
    image = np.zeros((9, 9, 3), np.float32)
    image[4, 4] = 1.0
    found = gaussian_of_box(image)[..., 0].astype(np.float64)
    assert found.sum() == pytest.approx(1.0)
    x = np.arange(9) - 4.0
    box = 1.0 / 12.0
    ends = np.linspace(-GAUSSIAN_RADIUS_PX, GAUSSIAN_RADIUS_PX, 10_001)
    weights = np.exp(-0.5 * np.square(ends / GAUSSIAN_SIGMA_PX))
    wanted = np.average(np.square(ends), weights=weights)
    assert (found.sum(axis=0) * x**2).sum() + box == pytest.approx(wanted, rel=0.01)


def test_a_single_frame_has_no_changes_to_measure(tmp_path):
    names, left_out = available((), room_job(tmp_path, 1))
    assert "flicker" not in names
    assert any("flicker is left out" in text for text in left_out)
    assert set(names) < set(QUALITIES)


def test_configurations_by_name(tmp_path):
    job = room_job(tmp_path, 2)
    names = ("denoised-2-fast", "denoised-2-accumulated", "paper-16", "decoupled-7.5")
    denoised, accumulated, paper, decoupled = (configuration(name, job) for name in names)
    assert (denoised.job.settings[DenoiserSettings].quality, accumulated.variant) == ("fast", "accumulated")
    assert accumulated.job.settings[DenoiserSettings].accumulation == "before"
    assert denoised.job.settings[ReferenceSettings].pixel_filter is denoised.pixel_filter is SampleFilter.BOX
    assert (denoised.spp, paper.spp) == (2, 16)
    assert decoupled.job.settings[DecoupledSettings].quality == 7.5
    assert not decoupled.is_baseline
    unsplit, uniform = (configuration(f"paper-16-{name}", job).job for name in ("unsplit", "uniform-6"))
    assert unsplit.settings[MaskSettings].split_percent == 100.0
    assert unsplit.settings[KeyframeSettings] == job.settings[KeyframeSettings]
    assert uniform.settings[KeyframeSettings].placement is Placement.UNIFORM
    assert uniform.settings[KeyframeSettings].spacing == 6
