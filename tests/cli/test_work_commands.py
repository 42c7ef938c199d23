"""Commands that share a run: `render --prepare`, `work`, `farm`; and who does the work."""

import json

import drjit
import pytest

import scenes_analytic
from enfilade.cli import work
from enfilade.errors import EnfiladeError
from enfilade.pipeline.crew import Crew
from enfilade.store import Run
from enfilade.store.lock import Lock
from small_runs import RENDERER
from support.analytic_scene import write_scene

PAPER = ("--method", "paper")


@pytest.fixture
def begun(run, camera_path, tmp_path):
    scene = write_scene(tmp_path / "room.analytic", scenes_analytic.room())
    line = (
        "render",
        scene,
        *("--renderer", RENDERER),
        "--path",
        camera_path,
        "--device",
        "cpu",
        "--spp",
        "2",
        "--method",
        "paper",
        "--out",
        tmp_path / "run",
    )
    result = run(*line, "--prepare")
    assert result.exit_code == 0, result.output
    assert result.stdout == f"run     {tmp_path / 'run'}\n"
    assert not (tmp_path / "run" / "frames").exists()
    return line


def test_prepared_and_worked_on(run, begun, tmp_path, monkeypatch):
    monkeypatch.setattr("enfilade.pipeline.share.PATIENCE_S", 0.1)
    out = tmp_path / "run"
    held = Lock(out)
    assert run("work", out, "--quiet").exit_code == 2  # nobody has shared it
    held.release()
    early = run("work", out, "--step", "keyframes", "--quiet")
    assert early.exit_code == 1
    assert "--step plan" in early.stderr
    plan = run("work", out, "--step", "plan", "--openjd")
    assert plan.exit_code == 0, plan.output
    assert plan.stdout.splitlines()[0] == "openjd_status: plan"
    assert plan.stdout.splitlines()[-1] == "openjd_progress: 100.0"
    early = run("work", out, "--step", "frames", "--openjd")
    assert early.exit_code == 1
    assert early.stdout.startswith("waiting up to 0 s: 3 units of step 'frames' wait for ")
    held = Lock(out)
    for line in (("--step", "keyframes"), ()):
        late = run("work", out, *line, "--quiet")
        assert late.exit_code == 1
        assert "another command is writing" in late.stderr
    held.release()
    rest = run("work", out, "--quiet")
    assert rest.exit_code == 0, rest.output
    video, plot = out / "video.mp4", out / "plots" / "walkthrough.png"
    assert rest.stdout == f"video   {video}\nplot    {plot}\nrun     {out}\n"
    assert plot.exists()
    drawn = plot.read_bytes()
    plot.write_bytes(drawn[:1000])
    again = run(*begun, "--quiet", "--verify", "--json")
    assert again.exit_code == 0, again.output
    assert json.loads(again.stdout)["frames"] == 3
    assert plot.read_bytes() == drawn


def test_a_scene_that_can_not_be_loaded_begins_no_run(run, camera_path, tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text('<scene version="3.0.0"><shape type="nonesuch"/><emitter type="constant"/></scene>')
    out = tmp_path / "run"
    result = run("render", scene, "--path", camera_path, "--out", out, "--device", "cpu", "--prepare")
    assert result.exit_code == 2
    assert "nonesuch" in result.stderr
    assert not out.exists()


def test_what_is_begun_is_told_as_json(run, begun, tmp_path):
    result = run(*begun, "--prepare", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told == {"folder": str(tmp_path / "run"), "method": "paper", "frames": 3}


@pytest.mark.parametrize(
    ("integrator", "wrong", "words", "right"),
    [
        ("path", ("--viewing-black-cd-m2", "200"), "less than peak_cd_m2", ()),
        ("path", ("--trace-max-depth", "3"), "depth 3, below 4; take --method paper", ()),
        ("direct", (), "not a path tracer; take --method paper", PAPER),
        ("direct", (*PAPER, "--trace-max-depth", "7"), "leave --trace-max-depth out", PAPER),
    ],
)
def test_what_is_refused_leaves_the_folder_to_the_corrected_command(
    run, camera_path, tmp_path, integrator, wrong, words, right
):
    scene, out = tmp_path / "scene.xml", tmp_path / "run"
    scene.write_text(
        f'<scene version="3.0.0"><integrator type="{integrator}"/><shape type="sphere"/>'
        '<emitter type="constant"/></scene>'
    )
    line = ("render", scene, "--path", camera_path, "--out", out, "--device", "cpu")
    refused = run(*line, *wrong)
    assert refused.exit_code == 2, refused.output
    assert words in refused.stderr
    assert run(*line, *wrong, "--prepare").exit_code == 2
    corrected = run(*line, *right, "--prepare")
    assert corrected.exit_code == 0, corrected.output


def test_a_farm_gets_a_template(run, begun, tmp_path):
    result = run("farm", tmp_path / "run", "--chunks", "2")
    assert result.exit_code == 0, result.output
    file = tmp_path / "run" / "farm.template.json"
    assert result.stdout == f"template {file}\n"
    steps = json.loads(file.read_text())["steps"]
    assert steps[2]["script"]["actions"]["onRun"]["args"] == [
        "work", "{{Param.Run}}", "--openjd", "--executor", "processes", "--workers", "1",
        "--step", "segments",
        "--chunk", "{{Task.Param.Chunk}}", "--of", "2",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("variant", "chosen"), [("cuda_ad_rgb", "gpu"), ("llvm_ad_rgb", "cpu"), (None, "auto")]
)
def test_a_run_is_gone_on_with_on_the_device_of_its_beginning(tmp_path, variant, chosen):
    if variant:
        Run.open(tmp_path, {"versions": {"variant": variant}}).close()
    assert work._device_of(tmp_path) == chosen


@pytest.mark.parametrize("command", ["work", "farm"])
def test_what_is_no_run_is_refused(run, tmp_path, command):
    result = run(command, tmp_path)
    assert result.exit_code == 2
    assert "job.json" in result.stderr
    assert "--prepare" in result.stderr
    result = run(command, tmp_path / "nope")
    assert result.exit_code == 2
    assert "there is no such folder; begin one with `enfilade render" in result.stderr


def test_jobs_that_slurm_took_are_printed_one_by_one(run, begun, tmp_path, monkeypatch):
    asked = []

    def submit(folder, cluster, chunks, options, tell):
        asked.append((folder, cluster, chunks, options))
        tell("plan       job 7, 1 task")
        raise EnfiladeError("step 'keyframes' could not be submitted")

    monkeypatch.setattr("enfilade.pipeline.farm.submit", submit)
    line = ("--submit", "slurm", "--slurm", "cpus_per_task=16", "--slurm", "slurm_partition=cpu")
    result = run("farm", tmp_path / "run", *line)
    assert asked == [(tmp_path / "run", "slurm", None, {"cpus_per_task": 16, "slurm_partition": "cpu"})]
    assert (result.exit_code, result.stdout) == (1, "plan       job 7, 1 task\n")


def test_farm_options_are_pairs(run, begun, tmp_path):
    result = run("farm", tmp_path / "run", "--submit", "local", "--slurm", "partition")
    assert result.exit_code == 2
    assert "'partition' is not KEY=VALUE" in result.stderr


def test_who_does_the_work(run, jobs, camera_path, tmp_path):
    line = ("render", "s.xml", "--path", camera_path, "--out", tmp_path / "run", "--json", "--quiet")
    assert run(*line).exit_code == 0
    assert (jobs.crew, jobs.is_verified) == (Crew(), False)
    assert (
        run(*line, "--executor", "ray:head:6379", "--workers", "3", "--threads", "2", "--verify").exit_code
        == 0
    )
    assert (jobs.crew, jobs.is_verified) == (Crew("ray:head:6379", 3, 2), True)
    refused = run(*line, "--executor", "threads")
    assert refused.exit_code == 2
    assert "choose one of in-process, processes, ray, ray:ADDRESS" in refused.stderr


@pytest.mark.parametrize("flags", [(), ("--executor", "in-process")])
def test_more_workers_than_this_process_are_refused(run, jobs, camera_path, tmp_path, flags):
    line = ("render", "s.xml", "--path", camera_path, "--out", tmp_path / "run", *flags)
    refused = run(*line, "--workers", "2")
    assert refused.exit_code == 2
    assert "--executor in-process, which is one worker; add --executor processes" in refused.stderr
    assert jobs.seen == []
    assert run(*line, "--workers", "1").exit_code == 0


def test_threads_are_those_of_this_process(run, jobs, camera_path, tmp_path):
    before = drjit.thread_count()
    line = ("render", "s.xml", "--path", camera_path, "--out", tmp_path / "run", "--threads")
    try:
        drjit.set_thread_count(3)
        for threads, expected in (("0", 3), ("2", 2)):
            assert run(*line, threads).exit_code == 0
            assert drjit.thread_count() == expected
        assert run(*line, "1", "--executor", "processes").exit_code == 0
        assert drjit.thread_count() == 2
    finally:
        drjit.set_thread_count(before)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (("work", "--chunk", "2"), "say which with --step"),
        (("work", "--of", "2"), "say which with --step"),
        (("farm", "--slurm", "cpus_per_task=16"), "add --submit slurm"),
        (("farm", "--out", "a.json", "--submit", "local"), "writes no template"),
        (("report", "--out", "a.html", "--serve"), "--out says nothing to --serve"),
        (("report", "--port", "8080"), "--port says nothing without --serve"),
    ],
)
def test_flags_that_would_say_nothing_are_refused(run, begun, tmp_path, monkeypatch, line, words):
    monkeypatch.setattr("enfilade.reports.live.Live.wait", lambda _: None)
    command, *flags = line
    refused = run(command, tmp_path / "run", *flags)
    assert refused.exit_code == 2, refused.output
    assert words in refused.stderr
    assert refused.stdout == ""


@pytest.mark.parametrize("command", [("render",), ("plan",)])
def test_a_scene_is_loaded_by_a_preflight_process_first(run, camera_path, tmp_path, command):
    scene = tmp_path / "scene.xml"
    scene.write_text(
        '<scene version="3.0.0"><shape type="sphere"/><emitter type="constant"/></scene>', encoding="utf-8"
    )
    more = ("--out", tmp_path / "run") if command == ("render",) else ()
    line = [*command, scene, "--path", camera_path, "--device", "cpu", "--limits-preflight-s", "0.1", *more]
    result = run(*line)
    assert result.exit_code == 2, result.output
    assert "was not loaded in 0.1 s" in result.stderr  # in which no Mitsuba starts
    assert not (tmp_path / "run").exists()
