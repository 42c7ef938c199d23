"""A run on a render farm: a job template of Open Job Description, or Slurm jobs through submitit.

Each job task is an ordinary `enfilade work` command on a run folder that all hosts see, and may be given to
any host again (https://github.com/OpenJobDescription, 2023-09).
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from enfilade.errors import EnfiladeError, SettingsError
from enfilade.runs.delivery import VIDEO, analysis_tasks, video_tasks
from enfilade.runs.job import read_job
from enfilade.runs.scheduler import passes_of

TEMPLATE = "farm.template.json"  # in the run folder
SPECIFICATION = "jobtemplate-2023-09"
FRAMES_PER_SHARD = 16  # by default
# A worker process of its own: a crash, or a kill for lack of memory, costs an attempt at one task.
WORKER = ("--executor", "processes", "--workers", "1")
TIMEOUT_MIN = 60
CORES = 8  # of a Slurm task: Slurm itself gives one
TIMEOUTS = 10  # times that a Slurm task is queued again; finished tasks of the run are not done again
MOST_TASKS = 1001  # of an array, if Slurm's settings are not known
CORE_OPTIONS = frozenset({"cpus_per_task", "slurm_cpus_per_task", "slurm_cpus_per_gpu", "slurm_exclusive"})
TAIL = 20  # lines of a command's output in the message that it failed


def template(folder: Path, shards: int | None = None) -> dict[str, Any]:
    """An Open Job Description template for a run that was begun.

    Parameters
    ----------
    folder
        The run.
    shards
        Shards of a pass; None: one for each 16 frames.

    Raises
    ------
    RunFolderError
        It holds no run.
    """
    steps: list[dict[str, Any]] = []
    for name, count in _shards(folder, shards).items():
        step: dict[str, Any] = {"name": name}
        if steps:
            step["dependencies"] = [{"dependsOn": steps[-1]["name"]}]
        if count > 1:
            shard = {"name": "Shard", "type": "INT", "range": f"1-{count}"}
            step["parameterSpace"] = {"taskParameterDefinitions": [shard]}
        words = _arguments(name, "{{Param.Run}}", "{{Task.Param.Shard}}", count)
        step["script"] = {"actions": {"onRun": {"command": "{{Param.Enfilade}}", "args": words}}}
        steps.append(step)
    return {
        "specificationVersion": SPECIFICATION,
        "name": f"enfilade {folder.resolve().name}"[:128],
        "parameterDefinitions": [
            {
                "name": "Run",
                "type": "STRING",
                "default": str(folder.resolve()),
                "description": "The run folder, by the name under which all hosts see it.",
            },
            {
                "name": "Enfilade",
                "type": "STRING",
                "default": _executable(),
                "description": "The command on the hosts.",
            },
        ],
        "steps": steps,
    }


class Command:
    """A command line for submitit; it is queued again if it runs out of time or is preempted.

    Parameters
    ----------
    line
    """

    def __init__(self, line: list[str]) -> None:
        self.line = line

    def __call__(self) -> None:
        """Run it; its output goes to the job's logs.

        Raises
        ------
        EnfiladeError
            It failed.
        """
        last: deque[str] = deque(maxlen=TAIL)
        started: list[subprocess.Popen[str]] = []

        # submitit ends the job by an exception from a signal handler. Handlers run in the main thread: in
        # another one the process is started and noted, or neither, and none is started after the end.
        lock, ended = threading.Lock(), threading.Event()

        def start() -> None:
            with lock:
                if not ended.is_set():
                    started.append(
                        subprocess.Popen(self.line, stderr=subprocess.PIPE, text=True, errors="replace")  # noqa: S603
                    )

        with ThreadPoolExecutor(1) as starter:
            try:
                starter.submit(start).result()
                for text in started[0].stderr or ():
                    sys.stderr.write(text)
                    last.append(text)
            except BaseException:
                with lock:
                    ended.set()
                for process in started:
                    process.kill()
                raise
            finally:
                for process in started:
                    with process:  # wait for it, and close its pipe
                        pass
        if code := started[0].returncode:
            raise EnfiladeError("".join(last).strip() or f"it ended with exit code {code}")

    def checkpoint(self) -> Any:
        """The same again: finished tasks of the run are not done again."""
        import submitit

        return submitit.helpers.DelayedSubmission(self)


def submit(
    folder: Path, cluster: str, shards: int | None, options: dict[str, Any], message: Callable[[str], object]
) -> list[str]:
    """Submit a run that was begun to Slurm, step by step, each after the one before.

    A step that fails removes the later ones from the queue.

    Parameters
    ----------
    folder
        The run.
    cluster
        ``slurm``, or ``local``: processes of this machine, one after the other.
    shards
        Shards of a pass; None: one for each 16 frames. They are submitted as several arrays if Slurm limits
        the size of an array.
    options
        Parameters of submitit's executor, such as ``slurm_partition``, ``timeout_min`` and ``cpus_per_task``,
        by default 8.
    message
        Receives a line on each job as soon as it is submitted.

    Returns
    -------
    list of str
        Numbers of the jobs; one for each array.

    Raises
    ------
    EnfiladeError
        submitit is not installed, Slurm refused a job, or a local one failed.
    SettingsError
        submitit knows no such parameter.
    RunFolderError
        It holds no run.
    """
    try:
        import submitit
    except ImportError as error:
        raise EnfiladeError("Slurm needs submitit: pip install submitit") from error
    made: list[str] = []
    previous: list[str] = []
    most = 1 if cluster == "local" else _most_tasks()  # one by one: each takes all cores, and memory
    run = str(folder.resolve())
    for name, count in _shards(folder, shards).items():
        numbers = range(1, count + 1)
        tasks = [Command([_executable(), *_arguments(name, run, number, count)]) for number in numbers]
        groups = [tasks[first : first + most] for first in range(0, len(tasks), most)]
        ids: list[str] = []
        for group in groups:
            executor = _executor(submitit, folder, cluster, options, previous)
            try:
                with executor.batch():
                    jobs = [executor.submit(task) for task in group]
                ids.append(jobs[0].job_id.partition("_")[0])
            except RuntimeError as error:  # of sbatch
                raise EnfiladeError(_refused(name, error, made)) from error
            made.append(ids[-1])
            message(f"{name:10} job {ids[-1]}, {len(group)} task{'s' if len(group) > 1 else ''}")
            if cluster == "local":
                _wait(name, jobs[0], submitit.core.utils.UncompletedJobError)
        previous = ids
    return made


def _executor(submitit: Any, folder: Path, cluster: str, options: dict[str, Any], previous: list[str]) -> Any:
    """The executor of the tasks of a step, after jobs of the step before."""
    given = {"timeout_min": TIMEOUT_MIN, **options}
    timeouts = given.pop("slurm_max_num_timeout", TIMEOUTS)
    if cluster == "slurm":
        if not CORE_OPTIONS & given.keys():
            given["cpus_per_task"] = CORES
        cores = given.get("slurm_cpus_per_task", given.get("cpus_per_task"))
        if cores is not None:  # srun doesn't ask sbatch how many
            given.setdefault("slurm_srun_args", [f"--cpus-per-task={cores}"])
        more = given.get("slurm_additional_parameters", {})
        if not isinstance(more, dict):
            raise SettingsError(f"--slurm slurm_additional_parameters={more}: write it like {{nice = 100}}")
        more = {"requeue": True, **more}
        if previous:
            more |= {"dependency": "afterok:" + ":".join(previous), "kill-on-invalid-dep": "yes"}
        given["slurm_additional_parameters"] = more
    try:
        executor = submitit.AutoExecutor(
            folder=folder / "slurm", cluster=cluster, slurm_max_num_timeout=timeouts
        )
        executor.update_parameters(**given)
    except (AssertionError, NameError, TypeError, ValueError) as error:  # unknown, or of a wrong type
        raise SettingsError(f"submitit refuses --slurm {' '.join(options)}: {error}") from error
    except RuntimeError as error:
        raise EnfiladeError(f"submitit: {error}") from error
    return executor


def _refused(step: str, error: Exception, made: list[str]) -> str:
    numbers = " ".join(made)
    after = (
        f"jobs {numbers} of the steps before are in the queue; `scancel {numbers}` removes them"
        if made
        else "nothing is in the queue"
    )
    return f"step {step!r} could not be submitted: {error}; {after}"


def _most_tasks() -> int:
    """Largest number of tasks in an array of Slurm."""
    scontrol = shutil.which("scontrol")
    if scontrol is None:
        return MOST_TASKS
    line = [scontrol, "show", "config"]
    output = subprocess.run(line, capture_output=True, text=True, check=False).stdout  # noqa: S603
    found = re.search(r"^MaxArraySize\s*=\s*(\d+)", output, re.MULTILINE)
    return max(int(found[1]), 1) if found else MOST_TASKS


def _wait(step: str, job: Any, uncompleted: type[Exception]) -> None:
    try:
        error = job.exception()
    except uncompleted as lost:
        error = lost
    if error is not None:
        raise EnfiladeError(f"step {step!r} failed: {error}")


def _shards(folder: Path, shards: int | None) -> dict[str, int]:
    """Number of shards of each pass, in order."""
    job = read_job(folder)
    frames = len(job.path)
    count = shards or max(math.ceil(frames / FRAMES_PER_SHARD), 1)
    tasks = Counter(task.pass_name for task in (*analysis_tasks(frames), *video_tasks(frames)))
    return {of.name: min(count, tasks.get(of.name, count)) if of.is_shared else 1 for of in passes_of(job)}


def _arguments(name: str, run: str, shard: int | str, count: int) -> list[str]:
    """Arguments of the command that does a shard of a pass."""
    words = ["work", run, "--openjd", *WORKER]
    if name != VIDEO.name:  # the last step does everything that is left, and writes the summary
        words += ["--pass", name]
    return [*words, "--shard", f"{shard}/{count}"] if count > 1 else words


def _executable() -> str:
    """The command of this installation."""
    own = Path(sys.executable).with_name("enfilade")
    return str(own) if own.exists() else "enfilade"
