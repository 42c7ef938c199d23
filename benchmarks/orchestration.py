"""The cost of restartable runs, and the gain of workers.

    python benchmarks/orchestration.py [length overhead workers ray] [--frames 2000]

length     a long run: memory and open files on the way; the time to continue it, and to refuse another run
overhead   the cost of a task besides its work, in process and in worker processes
workers    two workers of one thread against one, on a Mitsuba scene
ray        a local Ray cluster against worker processes, on tasks of more than 5 s

The exit code is 1 if a limit is missed. On a busy machine the times say more about the machine.
"""

import argparse
import dataclasses
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from enfilade.methods.analysis import Analysis
from enfilade.methods.base import FRAMES, Inputs, Method, Output, Pass, Task
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Silence

TESTS = str(Path(__file__).parents[1] / "tests")  # whose toys the commands render
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [TESTS, os.environ.get("PYTHONPATH")]))
TASKS = 1000
MOST_OVERHEAD_S = 0.01  # 1 % of a task of 1 s
LIMITED_FRAMES = 1000  # up to which the next two limits hold
MOST_CONTINUE_S, MOST_REFUSE_S = 2.0, 1.0
MOST_GROWTH = 1.1  # of memory from the second tenth of a run to the last but one
LEAST_GAIN = 1.7  # of two workers over one
MOST_RAY = 1.1  # times as long as worker processes take
SAMPLE_S = 0.25
RENDER = """
import sys
from pathlib import Path
from enfilade.device import activate
activate("cpu")
from enfilade.monitor import Silence
from enfilade.runs.render import render
from support.toys import slide, toy_job
folder, frames, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
job = toy_job(folder, path=slide(frames, size=(32, 24)), trace={"seed": seed})
render(job, folder / "run", Silence())
"""


class Idle(Method):
    """A method whose tasks do nothing."""

    name = "idle"
    passes = (Pass("idle"), Pass(FRAMES))

    def tasks(self, analysis: Analysis) -> Iterable[Task]:
        """One task a frame."""
        return [Task("idle", frame) for frame in range(len(analysis.path))]

    def run(self, task: Task, inputs: Inputs, walk: Walkthrough) -> Output:
        """Do nothing."""
        del task, inputs, walk
        return Output()


class Clock(Silence):
    """A monitor that keeps the moments at which tasks end."""

    def __init__(self) -> None:
        self.moments: list[float] = []

    def progress(self, name: str, done: int, total: int) -> None:
        """Keep the moment."""
        del name, done, total
        self.moments.append(time.perf_counter())


def main() -> int:
    """Measure and print; returns the exit code."""
    kinds = {"length": length, "overhead": overhead, "workers": gain, "ray": ray}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("kinds", nargs="*", choices=[*kinds, []], default=list(kinds))
    parser.add_argument("--frames", type=int, default=2000)
    arguments = parser.parse_args()
    print(f"{len(os.sched_getaffinity(0))} CPU cores, load {os.getloadavg()[0]:.1f}")
    missed = []
    for kind in arguments.kinds:
        with tempfile.TemporaryDirectory(prefix="orchestration-") as name:
            missed += list(kinds[kind](Path(name), arguments.frames))
    for text in missed:
        print(f"missed: {text}")
    return 1 if missed else 0


def length(folder: Path, frames: int) -> Iterator[str]:
    """Memory and open files of a long run; the time to continue it, and to refuse another run."""
    line = [sys.executable, "-c", RENDER, str(folder), str(frames)]
    with subprocess.Popen([*line, "0"]) as process:
        samples = []
        while process.poll() is None:
            samples.append(sample(process.pid, folder / "run" / "ledger.jsonl"))
            time.sleep(SAMPLE_S)
    if process.returncode:
        raise RuntimeError(f"exit code {process.returncode}")
    print(f"length: {frames} frames; largest memory in MiB and number of open files, by tenths of the ledger")
    found = [s for s in samples if s is not None]
    most, memory = max(size for size, _, _ in found), []
    for tenth in range(10):
        if here := [s for s in found if tenth * most / 10 <= s[0] <= (tenth + 1) * most / 10]:
            memory.append(max(m for _, m, _ in here))
            print(f"  {tenth + 1:2}  {memory[-1]:7.1f}  {max(f for _, _, f in here):3}")
    if (growth := memory[-2] / memory[1]) > MOST_GROWTH:
        yield f"memory grows {growth:.2f} times, limit {MOST_GROWTH}"
    start_s = seconds_of([sys.executable, "-c", "import enfilade.runs.render"])
    for what, seed, limit_s in (("continued", "0", MOST_CONTINUE_S), ("refused", "1", MOST_REFUSE_S)):
        seconds = seconds_of([*line, seed]) - start_s
        print(f"{what} in {seconds:.2f} s, without the start of Python")
        if frames <= LIMITED_FRAMES and seconds > limit_s:
            yield f"{what} in {seconds:.2f} s, limit {limit_s}"


def sample(pid: int, ledger: Path) -> tuple[int, float, int] | None:
    """Size of the ledger, memory in MiB and open files of a process; None if it has just ended."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
        return ledger.stat().st_size, pages * os.sysconf("SC_PAGE_SIZE") / 2**20, files
    except OSError:
        return None


def seconds_of(line: list[str]) -> float:
    """Wall time of a command, which may fail."""
    begin = time.perf_counter()
    subprocess.run(line, capture_output=True, check=False)
    return time.perf_counter() - begin


def overhead(folder: Path, _frames: int) -> Iterator[str]:
    """Tasks that do nothing, with a line in the ledger for each."""
    from enfilade.device import activate

    activate("cpu")
    from enfilade.runs.executor import Workers
    from enfilade.runs.render import Shard, prepare, render_shard
    from support.toys import slide, toy_job

    job = dataclasses.replace(toy_job(folder, path=slide(TASKS)), method="orchestration:Idle")
    for name, workers in (("in-process", None), ("processes", 2)):
        run = folder / name
        prepare(job, run)
        render_shard(run, Shard("analysis"), Silence())
        clock = Clock()
        render_shard(run, Shard("idle"), clock, Workers(name, workers))
        seconds = (clock.moments[-1] - clock.moments[0]) / (TASKS - 1)
        print(f"overhead, {name}: {1000 * seconds:.2f} ms a task")
        if seconds > MOST_OVERHEAD_S:
            yield f"{name}: a task costs {seconds:.4f} s, limit {MOST_OVERHEAD_S}"


def gain(folder: Path, _frames: int) -> Iterator[str]:
    """The same frames by one worker and by two, each of one thread."""
    line = mitsuba(folder, 256, "20-35")
    one, two = (frame_seconds(folder, line, "processes", count) for count in (1, 2))
    print(f"workers: one {one:.1f} s, two {two:.1f} s, gain {one / two:.2f}")
    if one / two < LEAST_GAIN:
        yield f"two workers gain {one / two:.2f}, limit {LEAST_GAIN}"


def ray(folder: Path, _frames: int) -> Iterator[str]:
    """The same long tasks by worker processes and by Ray."""
    line = mitsuba(folder, 512, "20-27")
    processes, cluster = (frame_seconds(folder, line, name, 2) for name in ("processes", "ray"))
    ratio = cluster / processes
    print(f"ray: {cluster:.1f} s, worker processes {processes:.1f} s, overhead {100 * (ratio - 1):.1f} %")
    if ratio > MOST_RAY:
        yield f"Ray takes {ratio:.2f} times as long as processes, limit {MOST_RAY}"


def mitsuba(folder: Path, spp: int, frames: str) -> list[str]:
    """Command of a run that traces every frame of ROOM."""
    from studies.scenes import write_scene

    files = write_scene("room", folder / "room", preset="small")
    line = [sys.executable, "-m", "enfilade", "render", str(files.scene), "--path", str(files.path)]
    flags = ["--size", "160x120", "--frames", frames, "--method", "reference", "--spp", str(spp)]
    return [*line, *flags, "--device", "cpu", "--quiet", "--threads", "1"]


def frame_seconds(folder: Path, line: list[str], executor: str, workers: int) -> float:
    """Wall time from the first frame of a run to its last, without the start and the video."""
    out = folder / "run"
    shutil.rmtree(out, ignore_errors=True)
    flags = ["--out", str(out), "--executor", executor, "--workers", str(workers)]
    moments: dict[int, float] = {}
    with subprocess.Popen([*line, *flags], stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            moments.setdefault(sum(1 for _ in (out / "frames").glob("*.exr")), time.perf_counter())
            time.sleep(0.02)
    if process.returncode:
        raise RuntimeError(f"exit code {process.returncode}")
    first, last = min(count for count in moments if count >= workers), max(moments)
    return (moments[last] - moments[first]) / (last - first) * last


if __name__ == "__main__":
    sys.exit(main())
