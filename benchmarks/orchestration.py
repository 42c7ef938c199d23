"""The cost of restartable runs: memory and open files of a long run, and the time of a task besides its work.

    python benchmarks/orchestration.py [length overhead] [--frames 2000]

length     a long run: memory and open files on the way; the time to continue it, and to refuse another run
overhead   the cost of a task besides its work, in process and in worker processes

The exit code is 1 if a limit is missed. On a busy machine the times say more about the machine.
"""

import argparse
import dataclasses
import os
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
sys.path.insert(0, TESTS)
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [TESTS, os.environ.get("PYTHONPATH")]))
TASKS = 1000
MOST_OVERHEAD_S = 0.01  # 1 % of a task of 1 s
LIMITED_FRAMES = 1000  # up to which the next two limits hold
MOST_CONTINUE_S, MOST_REFUSE_S = 2.0, 1.0
MOST_GROWTH_KIB = 16.0  # of memory a frame, from the second tenth of a run to the last but one
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
    kinds = {"length": length, "overhead": overhead}
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
    growth = 1024.0 * (memory[-2] - memory[1]) / (0.7 * frames)
    print(f"memory grows by {growth:.1f} KiB a frame")
    if growth > MOST_GROWTH_KIB:
        yield f"memory grows by {growth:.1f} KiB a frame, limit {MOST_GROWTH_KIB}"
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


if __name__ == "__main__":
    sys.exit(main())
