"""What it costs to keep a run restartable, and what workers gain.

    python benchmarks/orchestration.py [length overhead workers ray] [--frames 2000]

length     a long run: memory and open files on the way, then how fast it is resumed, and another run refused
overhead   what a unit costs beside its work, in process and in worker processes
workers    two workers of one thread against one, wall time of the tracing of a Mitsuba scene
ray        a local Ray cluster against worker processes, units of more than 5 s

Says which limits are missed, and fails then; on a busy machine that tells more of the machine.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

KINDS = ("length", "overhead", "workers", "ray")
UNITS = 1000
MOST_OVERHEAD_S = 0.01  # beside a unit's work: 1 % of a unit of 1 s
OF_LIMITS = 1000  # frames of a run, for which the next two hold
MOST_RESUME_S, MOST_REFUSAL_S = 2.0, 1.0
MOST_GROWTH = 1.1  # of memory from the second tenth of a run to the last but one: then the video is written
LEAST_GAIN = 1.7  # of two workers over one
MOST_RAY = 1.1  # times as long as worker processes take
SAMPLE_S = 0.25


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("kinds", nargs="*", choices=[*KINDS, []], default=list(KINDS))
    parser.add_argument("--frames", type=int, default=2000)
    arguments = parser.parse_args()
    print(f"{len(os.sched_getaffinity(0))} CPU cores, load {os.getloadavg()[0]:.1f}")
    measure = {
        "length": lambda folder: measure_length(folder, arguments.frames),
        "overhead": measure_overhead,
        "workers": measure_workers,
        "ray": measure_ray,
    }
    with tempfile.TemporaryDirectory(prefix="orchestration-") as name:
        missed = [text for kind in arguments.kinds for text in measure[kind](Path(name))]
    for text in missed:
        print(f"missed: {text}")
    return 1 if missed else 0


def measure_length(folder: Path, frames: int) -> Iterator[str]:
    """Memory and open files over a long run, then resuming and refusing it."""
    line = analytic(folder, frames)
    process = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    samples = []
    while process.poll() is None:
        samples.append(look(process.pid, folder / "run" / "ledger.jsonl"))
        time.sleep(SAMPLE_S)
    if process.returncode:
        raise RuntimeError(f"exit code {process.returncode}")
    print(f"length: {frames} frames; by tenths of the ledger, MiB of memory and open files at most")
    done = [s for s in samples if s is not None]
    most = max(size for size, _, _ in done)
    memory = []
    for tenth in range(10):
        here = [s for s in done if tenth * most / 10 <= s[0] <= (tenth + 1) * most / 10]
        if here:
            memory.append(max(m for _, m, _ in here))
            print(f"  {tenth + 1:2}  {memory[-1]:7.1f}  {max(f for _, _, f in here):3}")
    if (growth := memory[-2] / memory[1]) > MOST_GROWTH:
        yield f"memory grows {growth:.2f} times, {MOST_GROWTH} at most are asked"
    begin = time.perf_counter()
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    seconds = time.perf_counter() - begin
    print(f"resumed, with nothing left to do, in {seconds:.2f} s")
    if frames <= OF_LIMITS and seconds > MOST_RESUME_S:
        yield f"resuming takes {seconds:.2f} s, {MOST_RESUME_S} at most are asked"
    begin = time.perf_counter()
    other = subprocess.run([*line, "--spp", "3"], check=False, capture_output=True, text=True)
    seconds = time.perf_counter() - begin
    print(f"another run refused in {seconds:.2f} s: {other.stderr.splitlines()[1].strip()}")
    if frames <= OF_LIMITS and seconds > MOST_REFUSAL_S:
        yield f"refusing takes {seconds:.2f} s, {MOST_REFUSAL_S} at most is asked"


def look(pid: int, ledger: Path) -> tuple[int, float, int] | None:
    """Size of the ledger, memory in MiB and open files of a process; None where it has just ended."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
        return ledger.stat().st_size, pages * os.sysconf("SC_PAGE_SIZE") / 2**20, files
    except OSError:
        return None


def analytic(folder: Path, frames: int) -> list[str]:
    """Command of a run of small frames in closed form."""
    from analytic import BALL, RENDERER, WALL, AnalyticScene, write_scene

    scene = write_scene(folder / "wall.analytic", AnalyticScene((WALL, BALL), noise=0.1))
    path = folder / "path.json"
    eyes = {at / 30: [0.02 * at, 0.0, 4.0] for at in (0, frames - 1)}
    keys = [{"time": t, "eye": e, "target": [e[0], 0, 0], "fov": 50} for t, e in eyes.items()]
    path.write_text(json.dumps({"format": "enfilade-path", "fps": 30, "size": [32, 24], "keys": keys}))
    flags = [
        *RENDERER,
        "--method",
        "paper",
        "--spp",
        "2",
        "--viewing-diagonal-m",
        "0.0125",
        "--device",
        "cpu",
        "--quiet",
    ]
    out = ["--out", str(folder / "run")]
    return [sys.executable, "-m", "enfilade", "render", str(scene), "--path", str(path), *out, *flags]


def idle(_spec: object, tell: object) -> object:
    """A worker that does nothing, at once."""
    del tell

    def do(kind: str, facts: object) -> None:
        del kind, facts

    return do


def hear_nothing(unit: object, what: str, value: object) -> None:
    """Reports of workers are of no interest here."""
    del unit, what, value


def measure_overhead(folder: Path) -> Iterator[str]:
    """Units that do nothing, but for a line in the ledger each."""
    from enfilade.executors import Graph, Recipe, Unit, open_executor, supervise
    from enfilade.store import Run

    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    for name in ("in-process", "processes"):
        with Run.open(folder / f"overhead-{name}", {"x": 1}) as run:
            executor = open_executor(
                name, Recipe("orchestration:idle"), hear_nothing, workers=2, logs=folder / "logs"
            )
            graph = Graph()
            for number in range(UNITS):
                needs = (f"u{number - 2}",) if number > 1 else ()
                graph.add(Unit(f"u{number}", "idle", needs=needs, order=(0, number)))

            def is_done(unit: Unit, to: Run = run) -> bool:
                to.record({"unit": unit.name, "files": {}, "cost": {}})
                return True

            begin = time.perf_counter()
            supervise(graph, executor, follow=lambda _: (), is_done=is_done, failed=lambda *_: None)
            seconds = (time.perf_counter() - begin) / UNITS
            executor.close()
            print(f"overhead, {name}: {1000 * seconds:.2f} ms a unit, its line on the disk included")
            if seconds > MOST_OVERHEAD_S:
                yield f"{name}, a unit costs {seconds:.4f} s, {MOST_OVERHEAD_S} at most are asked"


def mitsuba(folder: Path, spp: int, frames: str) -> list[str]:
    """Inputs of a run that traces every frame of ROOM."""
    from studies.scenes import write_scene

    files = write_scene("room", folder / "room", preset="small")
    flags = ["--size", "160x120", "--frames", frames, "--method", "reference", "--spp", str(spp)]
    line = [sys.executable, "-m", "enfilade", "render", str(files.scene), "--path", str(files.path)]
    return [*line, *flags, "--device", "cpu", "--quiet", "--threads", "1"]


def measure_workers(folder: Path) -> Iterator[str]:
    """The same frames by one worker and by two, each of one thread; and by two commands at once."""
    line = mitsuba(folder, 256, "20-35")
    seconds = {count: run_seconds(folder, line, "processes", count) for count in (1, 2)}
    halves = [mitsuba(folder, 256, frames) for frames in ("20-27", "28-35")]
    with ThreadPoolExecutor() as pool:
        waits = [
            pool.submit(run_seconds, folder / str(number), half, "in-process", 1)
            for number, half in enumerate(halves)
        ]
        apart = max(wait.result() for wait in waits)
    times = ", ".join(f"{count} workers {s:.1f} s" for count, s in seconds.items())
    print(f"workers: {times}, gain {seconds[1] / seconds[2]:.2f}")
    print(f"two commands at once, half of the frames each: {apart:.1f} s, gain {seconds[1] / apart:.2f}")
    if (gain := seconds[1] / seconds[2]) < LEAST_GAIN:
        yield f"two workers gain {gain:.2f}, {LEAST_GAIN} are asked"


def measure_ray(folder: Path) -> Iterator[str]:
    """The same long units by worker processes and by Ray."""
    line = mitsuba(folder, 512, "20-27")
    seconds = {name: run_seconds(folder, line, name, 2) for name in ("processes", "ray")}
    times = ", ".join(f"{name} {s:.1f} s" for name, s in seconds.items())
    ratio = seconds["ray"] / seconds["processes"]
    print(f"ray: {times}, overhead {100 * (ratio - 1):.1f} %")
    if ratio > MOST_RAY:
        yield f"Ray takes {ratio:.2f} times as long as processes, {MOST_RAY} at most are asked"


def run_seconds(folder: Path, line: list[str], executor: str, workers: int) -> float:
    """Wall time from the first frame of a run to its last, without starting and the video."""
    out = folder / "run"
    shutil.rmtree(out, ignore_errors=True)
    flags = ["--out", str(out), "--executor", executor, "--workers", str(workers)]
    process = subprocess.Popen([*line, *flags], stdout=subprocess.DEVNULL)
    moments: dict[int, float] = {}
    while process.poll() is None:
        count = sum(1 for _ in (out / "frames").glob("*.exr"))
        moments.setdefault(count, time.perf_counter())
        time.sleep(0.02)
    if process.returncode:
        raise RuntimeError(f"exit code {process.returncode}")
    first, last = min(c for c in moments if c >= workers), max(moments)
    units = last - first
    return (moments[last] - moments[first]) / units * last


if __name__ == "__main__":
    sys.exit(main())
