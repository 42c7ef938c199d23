"""Faults: runs that are killed, stopped, damaged or short of disk end with the bytes of an undisturbed run.

    python benchmarks/faults.py [--quick] [--only kills bits ...] [--count 20] [--seed 1] [--jobs 2]

kills      SIGKILL for a command, for one of its workers, or by the process itself in the middle of a write
shards     several `enfilade work` commands at once, some of which are killed
executors  one, two and seven workers, in process, worker processes and Ray
cluster    Ray, with workers that are killed
stops      SIGSTOP for a worker, which is killed after the time limit of its task
disk       a small tmpfs that fills up and gets more room; needs root
bits       flipped bits and lost files, found by --verify or when they are used

Each trial interrupts a run of a small Mitsuba scene somewhere, continues it with the same command, and
compares the digest of its ledger, which has the checksums of all files. Trials run side by side (--jobs) with
a folder and random numbers of their own. The exit code is 1 if one byte differs, or a command fails for
another reason.
"""

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from enfilade.runs.folder import RunFolder
from enfilade.runs.job import read_job
from enfilade.runs.scheduler import passes_of

COUNTS = {"kills": 40, "shards": 6, "executors": 5, "cluster": 3, "stops": 4, "disk": 10, "bits": 20}
QUICK = {"kills": 8, "shards": 2, "executors": 5, "cluster": 1, "stops": 1, "disk": 3, "bits": 6}
POINTS = ("before fsync", "after fsync", "before rename", "after rename", "torn line")
EXECUTORS = (("in-process", 1), ("processes", 1), ("processes", 2), ("processes", 7), ("ray", 2))
LIMITS = ("--set", "limits.task_timeout_s=60", "--set", "limits.preflight_s=300")
ALONE = ("unshare", "-n", "sh", "-c", 'ip link set lo up && exec "$@"', "sh")  # Ray listens on all interfaces
TIMEOUT_S = 3600
DELIVERED = ("frames/", "clips/", "video")  # other files are made again only if they are read
SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="5"/></integrator>
  <shape type="rectangle">
    <transform name="to_world"><scale value="3"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
  </shape>
  <shape type="sphere">
    <point name="center" x="0.5" y="0" z="0.6"/><float name="radius" value="0.5"/>
    <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>
  </shape>
  <emitter type="constant"><rgb name="radiance" value="0.7"/></emitter>
  <emitter type="point"><point name="position" x="1" y="2" z="3"/><rgb name="intensity" value="6"/></emitter>
</scene>
"""


class WrongError(Exception):
    """A fault that changed the run, or a command that failed for another reason."""


@dataclass(frozen=True)
class Case:
    """A run to be disturbed.

    Attributes
    ----------
    inputs
        Scene, path and settings, as arguments of the command.
    digest
        Of the undisturbed run.
    seconds
        That it took.
    size
        Bytes of its files.
    """

    inputs: tuple[str, ...]
    digest: str
    seconds: float
    size: int


Trial = Callable[[Case, Path, random.Random, int], str]  # disturbs and continues a run; returns what it did


def main() -> int:
    """Try all; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer trials")
    parser.add_argument("--only", nargs="+", choices=TRIALS, default=list(TRIALS))
    parser.add_argument("--count", type=int, help="number of trials of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    arguments = parser.parse_args()
    counts = QUICK if arguments.quick else COUNTS
    tried, wrong = Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="faults-") as name, ThreadPoolExecutor(arguments.jobs) as pool:
        case = undisturbed(Path(name))
        print(f"an undisturbed run takes {case.seconds:.1f} s and {case.size} bytes", flush=True)
        begun = {
            pool.submit(one, kind, number, case, Path(name), arguments.seed): kind
            for kind in arguments.only
            for number in range(arguments.count or counts[kind])
        }
        for ended in as_completed(begun):
            what, is_right = ended.result()
            tried[begun[ended]] += 1
            wrong[begun[ended]] += not is_right
            print(f"  {begun[ended]}: {what}: {'as undisturbed' if is_right else 'WRONG'}", flush=True)
    for kind in arguments.only:
        print(f"{kind:10} {tried[kind] - wrong[kind]} of {tried[kind]} as undisturbed")
    return 1 if wrong.total() else 0


def one(kind: str, number: int, case: Case, folder: Path, seed: int) -> tuple[str, bool]:
    """Do a trial; returns its description, and whether the run is as undisturbed."""
    place, chance = folder / f"{kind}-{number}", random.Random(f"{seed} {kind} {number}")  # noqa: S311
    place.mkdir()
    try:
        return TRIALS[kind](case, place, chance, number), True
    except (WrongError, OSError, subprocess.SubprocessError, ValueError) as error:
        return f"{type(error).__name__}: {error}", False
    finally:
        shutil.rmtree(place, ignore_errors=True)


def undisturbed(folder: Path) -> Case:
    """Render the run that others are compared with."""
    eyes = {0.0: -0.2, 0.5: 0.2}
    keys = [{"time": t, "eye": [x, 0, 4], "target": [x, 0, 0], "fov": 50} for t, x in eyes.items()]
    path = {"format": "enfilade-path", "fps": 24, "size": [32, 24], "keys": keys}
    (folder / "scene.xml").write_text(SCENE)
    (folder / "path.json").write_text(json.dumps(path))
    settings = ("--set", "keyframes.spacing=4", *LIMITS)
    inputs = (str(folder / "scene.xml"), "--path", str(folder / "path.json"), *settings)
    out = folder / "whole"
    finish(render(inputs, out))  # compiles kernels, which others find in a cache
    shutil.rmtree(out)
    begin = time.monotonic()
    finish(render(inputs, out))
    size = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    return Case(inputs, RunFolder.read(out).digest(), time.monotonic() - begin, size)


# Commands.


def render(inputs: tuple[str, ...], out: Path, *more: str) -> list[str]:
    """A command that begins or continues a run."""
    return [*ENFILADE, "render", *inputs, "--out", str(out), "--device", "cpu", "--quiet", *more]


def work(out: Path, *more: str) -> list[str]:
    """A command that works on a run that was begun."""
    return [*ENFILADE, "work", str(out), "--device", "cpu", "--quiet", *more]


ENFILADE = (sys.executable, "-m", "enfilade")


def start(line: list[str], errors: int = subprocess.DEVNULL) -> subprocess.Popen[str]:
    """Start a command in a process group of its own."""
    return subprocess.Popen(line, start_new_session=True, stdout=subprocess.DEVNULL, stderr=errors, text=True)


def finish(line: list[str], expected: str | None = None) -> None:
    """Let a command end: without an error, or with one whose message contains some words."""
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    if done.returncode and (expected is None or expected not in done.stderr):
        raise WrongError(f"exit code {done.returncode}: {done.stderr.strip()[-2000:]}")


def compare(case: Case, out: Path, what: str) -> str:
    """Compare a run with the undisturbed one."""
    run = RunFolder.read(out)
    if run.digest() != case.digest:
        raise WrongError(f"{what}: the ledger differs")
    if damaged := [name for name in run.damaged() if (out / name).exists() or name.startswith(DELIVERED)]:
        raise WrongError(f"{what}: {damaged[0]} differs")
    if left := list(out.rglob(".*writing-*")):
        raise WrongError(f"{what}: {left[0]} is left")
    return what


def continued(case: Case, out: Path, what: str, *more: str) -> str:
    """Continue a run to its end, and compare it."""
    try:
        finish(render(case.inputs, out, *more))
    except WrongError as error:
        raise WrongError(f"{what}: {error}") from error
    return compare(case, out, what)


def descendants(pid: int) -> dict[int, bytes]:
    """Processes below a process, with their command lines; without those of Python's own bookkeeping."""
    found: dict[int, bytes] = {}
    with contextlib.suppress(OSError):  # it has ended
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            line = Path(f"/proc/{child}/cmdline").read_bytes()
            if b"resource_tracker" not in line:
                found |= {int(child): line, **descendants(int(child))}
    return found


# Trials.


def kill(case: Case, place: Path, chance: random.Random, number: int) -> str:
    """Kill a command, or one of its workers, and continue the run."""
    out = place / "run"
    match number % 3:
        case 0:
            what = f"killed {chance.choice(POINTS)} number {chance.randrange(1, 100)}"
            where = what.removeprefix("killed ").replace(" number ", ":")
            line = [sys.executable, __file__, "--die", where, *render(case.inputs, out)[len(ENFILADE) :]]
            done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
            if done.returncode not in (0, -signal.SIGKILL):
                raise WrongError(f"{what}: exit code {done.returncode}: {done.stderr.strip()[-2000:]}")
        case 1:
            workers = chance.choice(
                (("--executor", "in-process"), ("--executor", "processes", "--workers", "2"))
            )
            moment_s = chance.uniform(0.1, 1.1) * case.seconds
            what = f"{workers[1]}, all killed after {moment_s:.2f} s"
            with start(render(case.inputs, out, *workers)) as process:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(moment_s)
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
        case _:
            what = struck(case, out, chance, signal.SIGKILL, "--executor", "processes", "--workers", "2")
            compare(case, out, what)  # the command must have continued by itself
    return continued(case, out, what)


def stop(case: Case, place: Path, chance: random.Random, _number: int) -> str:
    """Stop a worker: the command must replace it and end by itself."""
    out = place / "run"
    what = struck(case, out, chance, signal.SIGSTOP, "--executor", "processes", "--workers", "2")
    return compare(case, out, what)


def cluster(case: Case, place: Path, chance: random.Random, _number: int) -> str:
    """Kill a worker of Ray: the command must end by itself."""
    out, title = place / "run", b"ray::do_remotely"  # not an agent, whose node dies with it
    what = struck(case, out, chance, signal.SIGKILL, "--executor", "ray", "--workers", "2", title=title)
    return compare(case, out, what)


def struck(
    case: Case, out: Path, chance: random.Random, blow: signal.Signals, *more: str, title: bytes = b""
) -> str:
    """Run a command, with a signal for one of its workers once so many tasks are done; it must succeed."""
    tasks, what = chance.randrange(2, 40), "no worker was hit"
    prefix = ALONE if "ray" in more else ()
    with start([*prefix, *render(case.inputs, out, *more)], subprocess.PIPE) as process:
        while process.poll() is None and what.startswith("no"):
            time.sleep(0.01)
            ledger = out / "ledger.jsonl"
            if ledger.exists() and ledger.read_bytes().count(b"\n") >= tasks:
                found = [pid for pid, line in descendants(process.pid).items() if line.startswith(title)]
                with contextlib.suppress(IndexError, ProcessLookupError):  # there is none now
                    os.kill(victim := chance.choice(found), blow)
                    what = f"{blow.name} for worker {victim} after {tasks} tasks"
        _, errors = process.communicate(timeout=TIMEOUT_S)
    if process.returncode:
        raise WrongError(f"{what}: exit code {process.returncode}: {errors.strip()[-2000:]}")
    return what


def executor(case: Case, place: Path, _chance: random.Random, number: int) -> str:
    """Render by some workers."""
    name, workers = EXECUTORS[number % len(EXECUTORS)]
    prefix = ALONE if name == "ray" else ()
    finish([*prefix, *render(case.inputs, place / "run", "--executor", name, "--workers", str(workers))])
    return compare(case, place / "run", f"{name}, {workers} workers")


def shards(case: Case, place: Path, chance: random.Random, _number: int) -> str:
    """Share a run out: each pass by three commands at once, one of which may be killed; all are repeated."""
    out = place / "run"
    finish(render(case.inputs, out, "--prepare"))
    for of in passes_of(read_job(out))[:-1]:
        lines = [work(out, "--pass", of.name, "--shard", f"{number}/3") for number in (1, 2, 3)]
        processes = [start(line) for line in lines]
        if chance.random() < 0.5:
            time.sleep(chance.uniform(0.0, 0.3) * case.seconds)
            processes[chance.randrange(3)].kill()
        for process in processes:
            process.wait(TIMEOUT_S)
        for line in chance.sample(lines, 3):
            finish(line)
    finish(work(out))
    return compare(case, out, "shards")


def disk(case: Case, place: Path, chance: random.Random, _number: int) -> str:
    """Fill a small disk, make room, and continue the run."""
    if os.geteuid() != 0:
        return "skipped: only root can mount a tmpfs"
    size = chance.randrange(4096, case.size)
    with mounted(place / "disk", size):
        out = place / "disk" / "run"
        finish(render(case.inputs, out), "no room on the disk")
        remount = ["mount", "-o", f"remount,size={4 * case.size}", str(place / "disk")]
        subprocess.run(remount, check=True)
        return continued(case, out, f"a disk of {size} bytes")


@contextlib.contextmanager
def mounted(folder: Path, size: int) -> Iterator[None]:
    """A tmpfs of so many bytes."""
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def bits(case: Case, place: Path, chance: random.Random, number: int) -> str:
    """Damage files of a finished run, or of one that is killed, and continue it."""
    out = place / "run"
    finish(render(case.inputs, out))
    names = [name for line in RunFolder.read(out).lines() for name in line["files"]]
    name = chance.choice((*names, "ledger.jsonl", "run.json", "job.json"))
    file = out / name
    data = bytearray(file.read_bytes())
    if number % 3 == 0 and name in names:
        file.unlink()
        return continued(case, out, f"{name} is lost")
    place_of_bit = chance.randrange(8 * len(data))
    data[place_of_bit // 8] ^= 1 << place_of_bit % 8
    file.write_bytes(data)
    for later in names:  # tasks that read the file are done again
        if number % 3 == 1 and later.startswith(DELIVERED) and later != name:
            (out / later).unlink()
    return continued(case, out, f"bit {place_of_bit} of {name}", "--verify")


def die_at(where: str, arguments: list[str]) -> None:
    """Be the command, and kill this process at the n-th passage of a point."""
    point, _, number = where.partition(":")
    left, write = [int(number)], os.write

    def is_time() -> bool:
        left[0] -= 1
        return left[0] == 0

    def die() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def around(function: Callable, name: str) -> Callable:
        def instead(*values: object, **named: object) -> object:
            is_last = name in point and is_time()
            if is_last and point.startswith("before"):
                die()
            result = function(*values, **named)
            if is_last:
                die()
            return result

        return instead

    def torn(handle: int, data: bytes) -> int:
        if point == "torn line" and data.startswith(b'{"pass"') and is_time():
            write(handle, data[: len(data) // 2])
            die()
        return write(handle, data)

    os.write, os.fsync, Path.replace = torn, around(os.fsync, "fsync"), around(Path.replace, "rename")
    from enfilade.cli import main as enfilade

    enfilade(arguments, prog_name="enfilade")


TRIALS: dict[str, Trial] = {
    "kills": kill, "shards": shards, "executors": executor, "cluster": cluster, "stops": stop, "disk": disk,
    "bits": bits,
}  # fmt: skip


if __name__ == "__main__":
    if sys.argv[1:2] == ["--die"]:
        die_at(sys.argv[2], sys.argv[3:])
    else:
        sys.exit(main())
