"""A run for a render farm: a job template of Open Job Description, or Slurm jobs through submitit.

Each task is an ordinary command on a run folder that all hosts see. A task that fails is given to any host
again: what is in the folder is not done again. (https://github.com/OpenJobDescription, 2023-09.)
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

from enfilade.codec import write_json
from enfilade.errors import EnfiladeError
from enfilade.pipeline.job import read_job
from enfilade.pipeline.units import CLIPS_STEP, STEPS, clips_of

TEMPLATE = "farm.template.json"  # in the run folder
SPECIFICATION = "jobtemplate-2023-09"
FRAMES_A_CHUNK = 16  # where nothing else is asked for
LAST = "video"  # the step that does all that is left


def chunks_for(frames: int) -> int:
    """How many tasks share a step, where nothing else is asked for."""
    return max(math.ceil(frames / FRAMES_A_CHUNK), 1)


def write_template(folder: Path, file: Path, chunks: int | None = None) -> None:
    """Write an Open Job Description template for a run that was begun.

    Parameters
    ----------
    folder
        The run.
    file
    chunks
        How many tasks share a step; None: one for each 16 frames.

    Raises
    ------
    RunFolderError
        It holds no run, or the file can't be written.
    """
    write_json(file, template(folder, chunks))


def template(folder: Path, chunks: int | None = None) -> dict[str, Any]:
    """See :func:`write_template`."""
    job = read_job(folder)
    count = chunks or chunks_for(len(job.path))
    steps: list[dict[str, Any]] = []
    for step in STEPS[job.method]:
        most = len(clips_of(job)) if step.name == CLIPS_STEP else count
        steps.append(_step(step.name, steps, min(count, most) if step.is_shared else 1))
    steps.append(_step(LAST, steps, 0))
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


def submit(folder: Path, cluster: str, chunks: int | None, options: dict[str, Any]) -> list[str]:
    """Give a run that was begun to Slurm, step by step, each after the one before.

    Parameters
    ----------
    folder
        The run.
    cluster
        ``slurm``, or ``local``: processes of this machine, one after the other, waited for.
    chunks
        How many tasks share a step; None: one for each 16 frames.
    options
        More parameters of submitit's executor, such as ``slurm_partition`` and ``timeout_min``.

    Returns
    -------
    list of str
        Numbers of the jobs.

    Raises
    ------
    EnfiladeError
        submitit is not installed, or a local job failed.
    RunFolderError
        It holds no run.
    """
    try:
        import submitit
    except ImportError as error:
        raise EnfiladeError("Slurm needs submitit: pip install 'enfilade[farm]'") from error
    made: list[Any] = []
    previous: list[Any] = []
    for step in template(folder, chunks)["steps"]:
        executor = submitit.AutoExecutor(folder=folder / "slurm", cluster=cluster)
        after = {"dependency": "afterok:" + ":".join(job.job_id for job in previous)} if previous else {}
        more = {"slurm_additional_parameters": after} if after else {}
        executor.update_parameters(**{"timeout_min": 60, **options, **more})
        tasks = [submitit.helpers.CommandFunction(line) for line in _lines(step, folder)]
        if cluster == "local":
            for task in tasks:  # one by one: each takes all cores, and memory for a scene
                made.append(executor.submit(task))
                _wait(step["name"], made[-1], submitit.core.utils.UncompletedJobError)
            continue
        with executor.batch():
            previous = [executor.submit(task) for task in tasks]
        made += previous
    return [job.job_id for job in made]


def _wait(step: str, job: Any, uncompleted: type[Exception]) -> None:
    try:
        error = job.exception()
    except uncompleted as lost:
        error = lost
    if error is not None:
        raise EnfiladeError(f"step {step!r} failed: {error}")


def _step(name: str, before: list[dict[str, Any]], count: int) -> dict[str, Any]:
    arguments = ["work", "{{Param.Run}}", "--openjd"]
    step: dict[str, Any] = {"name": name}
    if before:
        step["dependencies"] = [{"dependsOn": before[-1]["name"]}]
    if count:
        arguments += ["--step", name]
    if count > 1:
        chunk = {"name": "Chunk", "type": "INT", "range": f"1-{count}"}
        step["parameterSpace"] = {"taskParameterDefinitions": [chunk]}
        arguments += ["--chunk", "{{Task.Param.Chunk}}", "--of", str(count)]
    step["script"] = {"actions": {"onRun": {"command": "{{Param.Enfilade}}", "args": arguments}}}
    return step


def _lines(step: dict[str, Any], folder: Path) -> list[list[str]]:
    """Command lines of a step's tasks."""
    space = step.get("parameterSpace", {"taskParameterDefinitions": [{"range": "1-1"}]})
    last = int(space["taskParameterDefinitions"][0]["range"].partition("-")[2])
    values = {"{{Param.Run}}": str(folder.resolve())}
    return [
        [
            _executable(),
            *(
                (values | {"{{Task.Param.Chunk}}": str(chunk)}).get(word, word)
                for word in step["script"]["actions"]["onRun"]["args"]
            ),
        ]
        for chunk in range(1, last + 1)
    ]


def _executable() -> str:
    """The command of this installation."""
    own = Path(sys.executable).with_name("enfilade")
    return str(own) if own.exists() else "enfilade"
