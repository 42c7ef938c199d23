"""The commands from end to end, on a scene of one sphere."""

import json

import pytest

from enfilade.cli import farm, work
from enfilade.images import read_exr
from enfilade.runs.folder import RunFolder
from support.toys import flip


def test_render_continue_and_report(run, line, tmp_path):
    folder = tmp_path / "run"
    first = run(*line)
    assert first.exit_code == 0, first.output
    assert "Table 2" in first.stdout
    assert f"video   {folder}/video.mp4" in first.stdout
    assert sorted(file.name for file in (folder / "frames").iterdir()) == [f"000{n}.exr" for n in (1, 2, 3)]
    digest = RunFolder.read(folder).digest()
    (folder / "frames" / "0002.exr").unlink()
    again = json.loads(run(*line, "--json").stdout)
    assert again["frames"] == 3
    assert again["folder"] == str(folder)
    assert RunFolder.read(folder).digest() == digest
    assert "ends in .html" in run("report", folder, "--out", folder / "job.json").stderr
    assert "ends in .json" in run("farm", folder, "--out", folder / "frames.exr").stderr
    assert run("report", folder, "--quiet").stdout == f"report  {folder}/report.html\n"
    encoded = run("encode", folder, "--codec", "ffv1", "--exposure-ev", "1", "--quiet")
    assert encoded.stdout == f"video   {folder}/encoded.mkv\n"
    assert run("encode", folder, "--codec", "ffv1", "--quiet").exit_code == 2


def test_another_run_in_the_folder_is_refused(run, line):
    assert run(*line).exit_code == 0
    other = run(*line, "--seed", "5")
    assert other.exit_code == 2
    assert "settings.trace.seed: 0 there, 5 now" in other.stderr
    # Settings that the method does not read, and those of the video, do not matter.
    assert run(*line, "--codec", "ffv1").exit_code == 0


def test_prepare_shards_and_farm(run, line, tmp_path):
    folder = tmp_path / "run"
    begun = run(*line, "--prepare", "--json")
    assert json.loads(begun.stdout) == {"folder": str(folder), "method": "reference", "frames": 3}
    early = run("work", folder, "--pass", "frames", "--quiet")
    assert early.exit_code == 1
    assert "--pass analysis" in early.stderr
    template = run("farm", folder, "--shards", "2")
    assert template.exit_code == 0, template.output
    steps = json.loads((folder / "farm.template.json").read_text())["steps"]
    assert [step["name"] for step in steps] == ["analysis", "frames", "clips", "video"]
    arguments = steps[1]["script"]["actions"]["onRun"]["args"]
    assert arguments[-4:] == ["--pass", "frames", "--shard", "{{Task.Param.Shard}}/2"]
    for words in (["--pass", "analysis"], ["--pass", "frames", "--shard", "2/2"]):
        assert run("work", folder, *words, "--quiet").exit_code == 0
    assert len(list((folder / "frames").iterdir())) == 1
    progress = run("work", folder, "--pass", "frames", "--shard", "1/2", "--openjd")
    assert "openjd_progress: 100.0" in progress.stdout
    assert run("work", folder, "--quiet").exit_code == 0
    assert (folder / "video.mp4").exists()


def test_damaged_files_are_made_again_by_work(run, line, tmp_path):
    """As the message of a command that finds them says."""
    folder = tmp_path / "my run"
    assert run(*[folder if word == tmp_path / "run" else word for word in line]).exit_code == 0
    whole = RunFolder.read(folder).digest()
    flip(folder / "frames" / "0001.exr")
    damaged = run("report", folder)
    assert f"0001.exr is missing or damaged; `enfilade work '{folder}' --verify` makes it again" in (
        " ".join(damaged.output.split())
    )
    assert run("work", folder, "--verify", "--quiet").exit_code == 0
    assert RunFolder.read(folder).digest() == whole
    assert RunFolder.read(folder).damaged() == []
    assert "leave out --pass" in run("work", folder, "--verify", "--pass", "frames").stderr


def test_plan(run, line, tmp_path):
    words = [str(word) for word in line if str(word) not in ("render", "--out", str(tmp_path / "run"))]
    plan = json.loads(run("plan", *words, "--json").stdout)
    assert plan["frames"] == [1, 2, 3]
    assert plan["cpu_seconds"] > 0.0
    drawn = run("plan", *words, "--plot", tmp_path / "plan.png")
    assert drawn.exit_code == 0, drawn.output
    assert (tmp_path / "plan.png").exists()
    named = [text.split("  ")[0] for text in drawn.stdout.splitlines() if not text.startswith(" ")]
    assert named == ["method", "time", "plot"]  # `reference` has no keyframes, and traces every pixel
    assert run("plan", *words, "--plot", tmp_path / "plan.svg").exit_code == 2


def test_default_method_and_aovs(run, line, tmp_path):
    words = [word for word in line if word not in ("--spp", "2", "--method", "reference")]
    result = run(*words, "--quality", "100", "--layers", "Z,shape_index")
    assert result.exit_code == 0, result.output
    layers = read_exr(tmp_path / "run" / "frames" / "0001.exr")
    assert set(layers) == {"RGB", "Z", "shape_index"}
    assert set(layers["shape_index"].ravel()) == {0, 1}


@pytest.mark.parametrize(
    ("integrator", "flags", "words"),
    [
        ("direct", ("--method", "decoupled"), "--method paper"),
        ("path", ("--method", "paper", "--spp", "1"), "--spp 2 or more"),
        ("path", ("--set", "viewing.black_cd_m2=200"), "less than peak_cd_m2"),
    ],
)
def test_refusals_leave_no_folder(run, scene, camera_path, tmp_path, integrator, flags, words):
    scene.write_text(scene.read_text().replace('"path"', f'"{integrator}"'))
    out = tmp_path / "run"
    refused = run("render", scene, "--path", camera_path, "--out", out, "--device", "auto", *flags)
    assert refused.exit_code == 2, refused.output
    assert words in refused.stderr
    assert not out.exists()


def test_scenes_are_loaded_by_a_preflight_process_first(run, line, tmp_path):
    result = run(*line, "--set", "limits.preflight_s=0.1")
    assert result.exit_code == 2, result.output
    assert "was not loaded in 0.1 s" in result.stderr  # Mitsuba takes longer to start
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("command", ["work", "farm", "report", "encode"])
def test_folders_without_a_run_are_refused(run, tmp_path, command):
    for folder in (tmp_path, tmp_path / "nowhere"):
        result = run(command, folder)
        assert result.exit_code == 2, result.output
        assert str(folder) in result.stderr


@pytest.mark.parametrize(
    ("variant", "chosen"), [("cuda_ad_rgb", "gpu"), ("llvm_ad_rgb", "cpu"), (None, "auto")]
)
def test_work_uses_the_device_of_the_run(tmp_path, variant, chosen):
    if variant:
        RunFolder.create(tmp_path, {"scene": {"variant": variant}}).close()
    assert work._device_of(tmp_path) == chosen


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("work", "run", "--shard", "1/2"), "--shard needs --pass"),
        (("work", "run", "--pass", "frames", "--shard", "half"), "write it like 1/4"),
        (("farm", "run", "--slurm", "a=1"), "--slurm needs --submit"),
        (("farm", "run", "--submit", "local", "--out", "x"), "--out has no effect"),
        (("farm", "run", "--submit", "local", "--slurm", "partition"), "'partition' is not KEY=VALUE"),
    ],
)
def test_contradictory_options_are_refused(run, words, message):
    result = run(*words)
    assert result.exit_code == 2
    assert message in result.stderr


def test_values_for_slurm_are_numbers_where_they_look_like_it():
    assert [farm._pair(f"a={value}") for value in ("60", "60m", "²")] == [("a", 60), ("a", "60m"), ("a", "²")]
