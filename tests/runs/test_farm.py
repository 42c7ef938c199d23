"""A run on a render farm: the template, and the jobs of Slurm."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from enfilade.cli import main
from enfilade.errors import EnfiladeError, SettingsError
from enfilade.files import write_json
from enfilade.runs import farm
from enfilade.runs.farm import Command, submit, template
from enfilade.runs.render import prepare
from support.toys import slide, toy_job, wait_for

OPENJD = Path(sys.executable).with_name("openjd")
STEPS = ["analysis", "light", "mean", "frames", "clips", "video"]


@pytest.fixture
def begun(tmp_path):
    prepare(toy_job(tmp_path, path=slide(20)), tmp_path / "run")
    return tmp_path / "run"


def test_the_template_is_one_of_open_job_description(begun):
    made = template(begun, 3)
    write_json(begun / "farm.json", made)
    assert [step["name"] for step in made["steps"]] == STEPS
    command = made["steps"][1]["script"]["actions"]["onRun"]
    options = "--openjd --executor processes --workers 1 --pass light --shard {{Task.Param.Shard}}/3"
    assert command["args"] == ["work", "{{Param.Run}}", *options.split()]
    assert "--pass" not in made["steps"][-1]["script"]["actions"]["onRun"]["args"]
    assert [shards(step) for step in made["steps"]] == ["1-2", "1-3", "1-3", "1-3", None, None]
    assert [shards(step) for step in template(begun)["steps"]] == [*["1-2"] * 4, None, None]
    if OPENJD.exists():
        line = [str(OPENJD), "check", str(begun / "farm.json")]
        done = subprocess.run(line, capture_output=True, text=True, check=False)  # noqa: S603
        assert done.returncode == 0, done.stdout


def shards(step):
    """Range of the shards of a step; None where it has only one."""
    return (
        step["parameterSpace"]["taskParameterDefinitions"][0]["range"] if "parameterSpace" in step else None
    )


class Cluster:
    """Stands for submitit: keeps when each task is submitted and when it is waited for."""

    def __init__(self, failing=""):
        self.failing, self.events, self.parameters, self.lines = failing, [], [], []
        self.core = SimpleNamespace(utils=SimpleNamespace(UncompletedJobError=TimeoutError))
        self.AutoExecutor = lambda **_: SimpleNamespace(
            update_parameters=lambda **given: self.parameters.append(given),
            batch=nullcontext,
            submit=self._submit,
        )

    def _submit(self, task):
        number = str(sum(what == "given" for what, _ in self.events))
        self.events.append(("given", number))
        self.lines.append(task.line[1:])
        return SimpleNamespace(job_id=number, exception=lambda: self._ended(number, task.line))

    def _ended(self, number, line):
        self.events.append(("ended", number))
        return RuntimeError("no memory") if self.failing in line else None


def test_tasks_on_this_machine_come_one_after_the_other(begun, monkeypatch):
    cluster, told = Cluster(), []
    monkeypatch.setitem(sys.modules, "submitit", cluster)
    jobs = submit(begun, "local", 3, {}, told.append)
    assert jobs == [str(n) for n in range(2 + 3 * 3 + 1 + 1)]
    assert cluster.events == [(what, job) for job in jobs for what in ("given", "ended")]
    options = "--openjd --executor processes --workers 1 --pass light --shard 3/3"
    assert cluster.lines[4] == ["work", str(begun), *options.split()]
    assert all("cpus_per_task" not in given for given in cluster.parameters)
    assert told[0] == "analysis   job 0, 1 task"
    monkeypatch.setitem(sys.modules, "submitit", Cluster(failing="mean"))
    with pytest.raises(EnfiladeError, match="step 'mean' failed: no memory"):
        submit(begun, "local", 3, {}, told.append)


SBATCH = """
n=$(ls "$SLURM_SEEN" | wc -l)
if [ "$n" -ge "$SLURM_REFUSES" ]; then echo "sbatch: error: QOSMaxSubmitJobPerUserLimit" >&2; exit 1; fi
cp "$1" "$SLURM_SEEN/$((100 + n))"
echo "Submitted batch job $((100 + n))"
"""
SCONTROL = """
if [ "$1" = requeue ]; then echo "$2" >> "$SLURM_REQUEUED"; else echo "MaxArraySize   = $SLURM_MOST"; fi
"""


@pytest.fixture
def slurm(tmp_path, monkeypatch):
    """Slurm's commands; returns the lines of each job's batch file, by its number."""
    pytest.importorskip("submitit")
    seen = tmp_path / "seen"
    for folder in (seen, tmp_path / "bin"):
        folder.mkdir()
    for name, text in (("sbatch", SBATCH), ("scontrol", SCONTROL), ("srun", "exit 1")):
        script(tmp_path / "bin" / name, text)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    facts = {"SEEN": seen, "REQUEUED": tmp_path / "requeued", "REFUSES": 99, "MOST": 1001}
    for name, value in facts.items():
        monkeypatch.setenv(f"SLURM_{name}", str(value))
    return lambda: {int(file.name): file.read_text().splitlines() for file in sorted(seen.iterdir())}


def script(file, text):
    file.write_text(f"#!/bin/sh\n{text}")
    file.chmod(0o755)


def asked(lines, option):
    """An option of a batch file."""
    found = [line for line in lines if line.startswith(f"#SBATCH --{option}")]
    return found[0].partition("=")[2] if found else None


def test_slurm_gets_each_step_as_an_array_that_waits_for_the_one_before(begun, slurm):
    told = []
    jobs = submit(begun, "slurm", 2, {"timeout_min": 5, "slurm_partition": "cpu"}, told.append)
    assert jobs == ["100", "101", "102", "103", "104", "105"]
    assert told[3:5] == ["frames     job 103, 2 tasks", "clips      job 104, 1 task"]
    for number, lines in slurm().items():
        before = f"afterok:{number - 1}" if number > 100 else None
        assert asked(lines, "dependency") == before
        assert asked(lines, "kill-on-invalid-dep") == (before and "yes")
        assert asked(lines, "array") == ("0-1%2" if number < 104 else None)
        assert (asked(lines, "cpus-per-task"), asked(lines, "time")) == ("8", "5")
        assert "#SBATCH --requeue" in lines
        assert any("srun" in line and "--cpus-per-task=8" in line for line in lines)
    submit(begun, "slurm", 1, {"cpus_per_task": 3}, print)
    submit(begun, "slurm", 1, {"slurm_exclusive": "user"}, print)
    cpus = {number: asked(lines, "cpus-per-task") for number, lines in slurm().items()}
    assert (cpus[106], cpus[112]) == ("3", None)


def test_parameters_of_submitit_may_be_lists_and_tables(begun, slurm):
    def run(*words):
        return CliRunner().invoke(main, [str(word) for word in words], prog_name="enfilade")

    line = ("farm", begun, "--submit", "slurm", "--shards", "1", "--slurm", 'slurm_setup=["module load x"]')
    line += ("--slurm", "slurm_use_srun=false", "--slurm", "slurm_account=007")
    line += ("--slurm", "slurm_additional_parameters={nice = 100}")
    assert run(*line).exit_code == 0
    lines = next(iter(slurm().values()))
    assert "module load x" in lines
    assert not any(text.startswith("srun") for text in lines)
    assert (asked(lines, "account"), asked(lines, "nice")) == ("007", "100")
    for wrong in ("slurm_setup=module load x", "slurm_additional_parameters=x"):
        refused = run("farm", begun, "--submit", "slurm", "--slurm", wrong)
        assert refused.exit_code == 2
        assert wrong.partition("=")[0].removeprefix("slurm_") in refused.stderr


def test_limits_of_slurm(begun, slurm, monkeypatch):
    monkeypatch.setenv("SLURM_MOST", "2")
    monkeypatch.setenv("SLURM_REFUSES", "6")
    told = []
    with pytest.raises(
        EnfiladeError, match=r"step 'mean' .*QOSMax.*; jobs 100 .* 105 .* `scancel 100 .*` removes"
    ):
        submit(begun, "slurm", 5, {}, told.append)
    assert told[1:5] == [
        "light      job 101, 2 tasks",
        "light      job 102, 2 tasks",
        "light      job 103, 1 task",
        "mean       job 104, 2 tasks",
    ]
    assert [asked(slurm()[job], "dependency") for job in (103, 104)] == ["afterok:100", "afterok:101:102:103"]
    with pytest.raises(SettingsError, match="Unknown argument 'queue'"):
        submit(begun, "slurm", 2, {"slurm_queue": "cpu"}, print)
    with pytest.raises(SettingsError, match="timeout_min"):
        submit(begun, "slurm", 2, {"timeout_min": "1h"}, print)


def test_a_command_that_has_just_been_started_ends_with_its_job(monkeypatch):
    class Popen(subprocess.Popen):
        """Out of time as soon as the process exists."""

        def __init__(self, *args, **options):
            super().__init__(*args, **options)
            started.append(self)
            os.kill(os.getpid(), signal.SIGUSR2)
            time.sleep(0.2)  # for the main thread to run the handler

    def out_of_time(*_):
        raise SystemExit

    started: list[subprocess.Popen] = []
    monkeypatch.setattr(farm.subprocess, "Popen", Popen)
    before = signal.signal(signal.SIGUSR2, out_of_time)
    try:
        with pytest.raises(SystemExit):
            farm.Command(["sleep", "3600"])()
        assert started[0].returncode == -signal.SIGKILL
    finally:
        signal.signal(signal.SIGUSR2, before)
        started[0].kill()


def test_a_command_that_is_out_of_time_is_queued_again(begun, slurm, tmp_path, monkeypatch):
    script(tmp_path / "enfilade", f"echo $$ > {tmp_path / 'pid'}; exec sleep 3600\n")
    monkeypatch.setattr(farm, "_executable", lambda: str(tmp_path / "enfilade"))
    submit(begun, "slurm", 1, {"timeout_min": 5}, print)
    facts = {"SUBMITIT_EXECUTOR": "slurm", "SLURM_JOB_ID": "100", "SLURM_JOB_NODELIST": "here"}
    line = [sys.executable, "-m", "submitit.core._submit", str(begun / "slurm")]
    with subprocess.Popen(line, env={**os.environ, **facts}, stderr=subprocess.PIPE, text=True) as job:  # noqa: S603
        wait_for(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text().strip())
        job.send_signal(signal.SIGUSR2)
        _, errors = job.communicate(timeout=120)
    assert (tmp_path / "requeued").read_text() == "100\n", errors
    assert not Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}").exists()
    assert (begun / "slurm" / "100_submitted.pkl").exists()
    assert not (begun / "slurm" / "100_0_result.pkl").exists()


def test_a_command_that_fails_is_reported_with_its_output(capfd):
    Command([sys.executable, "-c", "print('done')"])()
    with pytest.raises(EnfiladeError, match="wrong input"):
        Command([sys.executable, "-c", "import sys; sys.exit('wrong input')"])()
    assert capfd.readouterr() == ("done\n", "wrong input\n")
    with pytest.raises(EnfiladeError, match="exit code 3"):
        Command([sys.executable, "-c", "raise SystemExit(3)"])()
