"""Try to break runs: kill them, fill their disk, flip their bits; compare with a run left alone.

    python benchmarks/faults.py [--quick] [--only kills disk ...] [--count 20] [--seed 1]

kills      SIGKILL for a whole command, one of its workers, or the next two that do the same unit, at random
           moments, or for itself in the middle of write, fsync and rename; then resumed to the end
stops      SIGSTOP for a worker at random moments: it hangs, is ended, and another does its unit
executors  1, 2 and 7 workers, in process, worker processes and Ray; the last two of a Mitsuba scene
cluster    Ray, with workers killed while it works
disk       a disk that fills up at random points, then gets room; needs root, for a small tmpfs
bits       a flipped bit in a stored file, found by use or by --verify, and what made it done again
mitsuba    kills and flipped bits of a tiny Mitsuba scene by --method decoupled

All others are of a scene in closed form by --method paper. Fails when one byte of frames, video or ledger
(times left out) differs. --quick tries 5 kills, disks, bits and executors, and fewer of what takes longer.
Trials of all kinds go side by side, one for each core (--jobs), the longest first; each has a folder and
random numbers of its own.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import IO

FRAMES, SIZE = 48, "32x24"
EXECUTORS = [("ray", 2), ("processes", 7), ("processes", 2), ("processes", 1), ("in-process", 1)]
MORE_EXECUTORS = [*EXECUTORS, ("ray", 1), ("ray", 7)]
OF_MITSUBA = [("ray", 2), ("processes", 7)]
COUNTS = {
    "cluster": 1,
    "executors": len(MORE_EXECUTORS) + len(OF_MITSUBA),
    "stops": 10,
    "mitsuba": 10,
    "kills": 200,
    "disk": 50,
    "bits": 50,
}
QUICK = {
    "cluster": 1,
    "executors": len(EXECUTORS),
    "stops": 2,
    "mitsuba": 1,
    "kills": 5,
    "disk": 5,
    "bits": 5,
}
KINDS = tuple(COUNTS)  # those first whose trials take longest
CLUSTER, QUICK_CLUSTER = (10, 20000), (5, 6000)  # kills, and paths a pixel of 50 frames
POINTS = ("before fsync", "after fsync", "before rename", "after rename", "torn line")
STORED = ("keyframes", "cells", "drafts", "raw", "frames", "clips")
TIMEOUT_S = 1800  # a busy machine is no failure
NEED = "what is left will need about"
STOPPED_MIN = 0.05  # after which a worker that does nothing is ended
BESIDE = 1.5  # times longer a run takes beside others

Trial = Callable[[int, Path, random.Random], str | None]  # number, empty folder, chance: what went wrong


@dataclass
class Tally:
    """What was tried, and what went wrong."""

    tried: dict[str, int] = field(default_factory=dict)
    wrong: dict[str, list[str]] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    def note(self, kind: str, problem: str | None, seconds: float) -> None:
        """Count a try; a problem is printed at once."""
        self.seconds[kind] = self.seconds.get(kind, 0.0) + seconds
        self.tried[kind] = self.tried.get(kind, 0) + 1
        if problem:
            self.wrong.setdefault(kind, []).append(problem)
            print(f"  {kind}: {problem}", flush=True)


@dataclass(frozen=True)
class Work:
    """A run that can be made in any folder, and what it must come out as."""

    inputs: tuple[str, ...]
    whole: Path
    seconds: float

    @property
    def digest(self) -> str:
        """Of the run left alone."""
        return digest(self.whole)


class Made:
    """Work whose run that is left alone is made by the first trial that asks for it."""

    def __init__(self, make: Callable[[], Work]) -> None:
        self._make, self._first, self._made = make, Lock(), []

    def __call__(self) -> Work:
        """The work."""
        with self._first:
            if not self._made:
                self._made.append(self._make())
        return self._made[0]


def main() -> int:
    """Try all; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, help="so many kills, disks and bits, in place of 200, 50 and 50")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="trials at once")
    parser.add_argument("--json", type=Path, help="write the tally into this file")
    parser.add_argument("--die", help=argparse.SUPPRESS)
    arguments, rest = parser.parse_known_args()
    if arguments.die:
        return die_at(arguments.die, rest)
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="faults-") as name:
        try_all(Path(name), arguments, tally)
    for kind in (kind for kind in KINDS if kind in arguments.only):
        wrong = len(tally.wrong.get(kind, []))
        tried = tally.tried.get(kind, 0)
        text = tally.skipped.get(kind) or f"{tried - wrong} of {tried} as if nothing had happened"
        print(f"{kind:10} {text}, {tally.seconds.get(kind, 0.0):.0f} s of trials")
    if arguments.json:
        arguments.json.write_text(json.dumps(vars(tally), indent=2))
    return 1 if tally.wrong else 0


def try_all(folder: Path, arguments: argparse.Namespace, tally: Tally) -> None:
    """Try every kind that was asked for, side by side."""
    counts = dict(QUICK if arguments.quick else COUNTS)
    if arguments.count:
        counts |= {kind: arguments.count for kind in counts if kind not in ("cluster", "executors")}
    work = analytic_work(folder)
    print(f"a run of {FRAMES} frames takes {work.seconds:.1f} s, digest {work.digest[:16]}", flush=True)
    if arguments.jobs > 1:
        work = replace(work, seconds=work.seconds * BESIDE)
    shiny = Made(partial(mitsuba_work, folder))
    trials: dict[str, Callable[[], Trial]] = {
        "cluster": lambda: cluster_trial(folder, *(QUICK_CLUSTER if arguments.quick else CLUSTER)),
        "executors": lambda: executor_trial(work, shiny),
        "stops": lambda: stop_trial(work),
        "mitsuba": lambda: mitsuba_trial(shiny),
        "kills": lambda: kill_trial(work),
        "disk": lambda: disk_trial(work, tally),
        "bits": lambda: bit_trial(work),
    }
    asked = {kind: trials[kind]() for kind in KINDS if kind in arguments.only}
    with ThreadPoolExecutor(arguments.jobs) as pool:
        begun = [
            pool.submit(one_of, kind, trial, number, folder, arguments.seed)
            for kind, trial in asked.items()
            for number in range(counts[kind])
        ]
        for ended in as_completed(begun):
            tally.note(*ended.result())


def one_of(kind: str, trial: Trial, number: int, folder: Path, seed: int) -> tuple[str, str | None, float]:
    """A trial of a kind, what went wrong in it, and the seconds it took."""
    place, begin = folder / f"{kind}-{number}", time.monotonic()
    place.mkdir()
    try:
        chance = random.Random(f"{seed} {kind} {number}")  # noqa: S311  (which moment, not a secret)
        problem = trial(number, place, chance)
    finally:
        shutil.rmtree(place, ignore_errors=True)
    return kind, problem, time.monotonic() - begin


# What is rendered.


def analytic_work(folder: Path) -> Work:
    """A noisy walk through a room with a mirror, in closed form, by the paper's method."""
    from analytic import BALL, RENDERER, WALL, AnalyticScene, Material, Sphere, write_scene
    from enfilade.records import SurfaceClass

    mirror = Sphere((-0.7, 0.3, 0.8), 0.4, Material((0.9, 0.9, 0.9), SurfaceClass.MIRROR), "mirror")
    scene = write_scene(folder / "wall.analytic", AnalyticScene((WALL, BALL, mirror), noise=0.1))
    path = walk(folder / "path.json")
    flags = ("--method", "paper", "--spp", "4", "--keyframes-spacing", "12", "--viewing-diagonal-m", "0.0125")
    return made(folder, "analytic", (str(scene), *RENDERER, "--path", str(path), *flags))


def mitsuba_work(folder: Path) -> Work:
    """A few small frames of ROOM, by keyframes of light."""
    from studies.scenes import write_scene

    files = write_scene("room", folder / "room", preset="small")
    flags = ("--size", "64x48", "--frames", "22-30", "--method", "decoupled", "--light-spacing", "4")
    more = ("--light-paths", "8", "--light-samples", "8")
    return made(folder, "mitsuba", (str(files.scene), "--path", str(files.path), *flags, *more))


def walk(file: Path, frames: int = FRAMES) -> Path:
    """A camera that slides to the right."""
    width, height = SIZE.split("x")
    eyes = {at / 30: [0.02 * at - 0.4, 0.0, 4.0] for at in (0, frames - 1)}
    keys = [{"time": t, "eye": e, "target": [e[0], 0, 0], "fov": 50} for t, e in eyes.items()]
    table = {"format": "enfilade-path", "fps": 30, "size": [int(width), int(height)], "keys": keys}
    file.write_text(json.dumps(table))
    return file


def made(folder: Path, name: str, inputs: tuple[str, ...]) -> Work:
    """Make the run that is left alone."""
    begin = time.monotonic()
    finish(inputs, folder / name)
    return Work(inputs, folder / name, time.monotonic() - begin)


def command(inputs: tuple[str, ...], out: Path, *more: str) -> list[str]:
    """The command line of a run."""
    flags = ["--out", str(out), "--device", "cpu", "--quiet", *more]
    return [sys.executable, "-m", "enfilade", "render", *inputs, *flags]


def finish(inputs: tuple[str, ...], out: Path, *more: str, prefix: tuple[str, ...] = ()) -> None:
    """Run to the end; anything but success is an error."""
    line = [*prefix, *command(inputs, out, *more)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    if done.returncode:
        raise RuntimeError(f"exit code {done.returncode}: {done.stderr.strip()[-2000:]}")


# What must be the same.


def digest(folder: Path) -> str:
    """Checksum of a run: its ledger without times, which has the checksums of its files."""
    from enfilade.store import Run

    return Run.existing(folder).digest()


def difference(work: Work, out: Path) -> str | None:
    """What is not as in the run left alone; None if nothing."""
    if digest(out) != work.digest:
        return f"another ledger in {out.name}"
    for file in stored(work.whole):
        other = out / file.relative_to(work.whole)
        if not other.exists() or sha(other) != sha(file):
            return f"another {other.relative_to(out)}"
    left = [f.name for f in out.rglob(".*.writing-*")]
    return f"left over: {left[0]}" if left else None


def stored(folder: Path) -> list[Path]:
    """Files of a run that its ledger knows."""
    files = [f for kind in STORED for f in (folder / kind).glob("[!.]*") if f.is_file()]
    return sorted([*files, *folder.glob("video.*")])


def sha(file: Path) -> str:
    """Checksum of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


# Kills.


def kill_trial(work: Work) -> Trial:
    """Kill a run somewhere, then let it go on to its end. What a kill misses does not count."""
    kills = (kill_at_point, kill_all, kill_worker, kill_two)

    def trial(number: int, folder: Path, chance: random.Random) -> str | None:
        out, what = folder / "run", None
        while what is None:  # it came too late
            shutil.rmtree(out, ignore_errors=True)
            what = kills[number % len(kills)](work, out, chance)
        problem = attempt(lambda: finish(work.inputs, out), work, out, what)
        has_failed = "exit code" in what and not what.endswith("exit code 0")
        return what if problem is None and has_failed else problem

    return trial


def attempt(act: Callable[[], None], work: Work, out: Path, what: str) -> str | None:
    """Do something, then compare; returns what went wrong."""
    try:
        act()
        problem = difference(work, out)
    except (RuntimeError, subprocess.TimeoutExpired, OSError, ValueError) as error:
        problem = str(error)
    return f"{what}: {problem}" if problem else None


def mitsuba_trial(shiny: Made) -> Trial:
    """Kills and flipped bits of a Mitsuba scene: the first four kill, then come two bits."""

    def trial(number: int, place: Path, chance: random.Random) -> str | None:
        kinds = [kill_trial(shiny())] * 4 + [bit_trial(shiny())] * 2
        return kinds[number % len(kinds)](number, place, chance)

    return trial


def kill_at_point(work: Work, out: Path, chance: random.Random) -> str | None:
    """The process kills itself in the middle of writing a file or a line."""
    point, number = chance.choice(POINTS), chance.randrange(1, 150)
    line = command(work.inputs, out)[3:]
    own = [sys.executable, __file__, "--die", f"{point}:{number}", *line]
    done = subprocess.run(own, capture_output=True, check=False, timeout=TIMEOUT_S)
    return struck(f"killed {point} number {number}", done.returncode)


def kill_all(work: Work, out: Path, chance: random.Random) -> str | None:
    """The whole process group is killed at a random moment, with or without workers."""
    who = chance.choice((("--executor", "in-process"), ("--executor", "processes", "--workers", "2")))
    moment = chance.uniform(0.1, 1.2) * work.seconds
    process = start(command(work.inputs, out, *who))
    try:
        process.wait(moment)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
    return struck(f"{who[1]}, all killed after {moment:.2f} s", process.wait())


def struck(what: str, code: int) -> str | None:
    """Say what was killed, and how it ended where that is not why; None where it had ended well before."""
    if code == 0:
        return None
    return what if code == -signal.SIGKILL else f"{what}, exit code {code}"


def kill_worker(work: Work, out: Path, chance: random.Random) -> str | None:
    """One worker is killed at a random moment; the command must go on by itself."""
    return strike_worker(work, out, chance, signal.SIGKILL)


def kill_two(work: Work, out: Path, chance: random.Random) -> str | None:
    """One worker is killed, and the next that is begun: most often in its place, with the same unit."""
    return strike_worker(work, out, chance, signal.SIGKILL, times=2)


def strike_worker(
    work: Work,
    out: Path,
    chance: random.Random,
    blow: signal.Signals,
    who: str = "processes",
    *,
    times: int = 1,
) -> str | None:
    """Workers get a signal, the first at a random moment; None where not all had a unit, and all is well."""
    moment, said = chance.uniform(0.3, 1.0) * work.seconds, out.with_name("said.txt")
    line = command(work.inputs, out, "--executor", who, "--workers", "2")
    with said.open("wb") as stream:
        process = start([word for word in line if word != "--quiet"], stream)
        time.sleep(moment)
        known: set[int] = set()
        for _ in range(times):
            if (worker := new_worker(process, known, chance)) is not None:
                kill(worker, blow)
        code = process.wait(TIMEOUT_S)
    had_units = said.read_bytes().count(b"it is tried again") >= times
    what = f"{blow.name} for {times} workers after {moment:.2f} s, exit code {code}"
    return what if had_units or code else None


def new_worker(process: subprocess.Popen[bytes], known: set[int], chance: random.Random) -> int | None:
    """Wait for workers that are not known yet, and choose one; None where the command ends first."""
    while process.poll() is None:
        found = {pid for pid in children(process.pid) if b"enfilade.executors.child" in cmdline(pid)}
        if fresh := sorted(found - known):
            known |= found
            return chance.choice(fresh)
        time.sleep(0.02)
    return None


def stop_trial(work: Work) -> Trial:
    """Stop a worker, so that it hangs; the command must end it and go on by itself."""

    def trial(_number: int, folder: Path, chance: random.Random) -> str | None:
        out, what = folder / "run", None
        while what is None:  # it came too early or too late
            shutil.rmtree(out, ignore_errors=True)
            what = strike_worker(work, out, chance, signal.SIGSTOP, f"processes,idle={STOPPED_MIN}")
        return attempt(lambda: None, work, out, what) if what.endswith("exit code 0") else what

    return trial


def start(line: list[str], said: IO[bytes] | int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    """A command in a process group of its own."""
    return subprocess.Popen(line, start_new_session=True, stdout=said, stderr=said)


def children(pid: int) -> list[int]:
    """Child processes of a process."""
    try:
        return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def kill(pid: int, blow: signal.Signals = signal.SIGKILL) -> None:
    """Kill a process that may have ended, or send it another signal."""
    try:
        os.kill(pid, blow)
    except ProcessLookupError:
        return


def die_at(where: str, arguments: list[str]) -> int:
    """Be the command, and kill this process at the n-th passage of a point."""
    point, _, number = where.partition(":")
    left = [int(number)]

    def passed() -> bool:
        left[0] -= 1
        return left[0] == 0

    def die() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def around(really: Callable, name: str) -> Callable:
        def instead(*values: object, **named: object) -> object:
            is_last = name in point and passed()
            if is_last and point.startswith("before"):
                die()
            result = really(*values, **named)
            if is_last:
                die()
            return result

        return instead

    def torn(handle: int, data: bytes) -> int:
        if point == "torn line" and data.startswith(b'{"unit"') and passed():
            really_write(handle, data[: len(data) // 2])
            die()
        return really_write(handle, data)

    really_write = os.write
    os.write = torn
    os.fsync = around(os.fsync, "fsync")
    Path.replace = around(Path.replace, "rename")
    from enfilade.cli import main as enfilade

    enfilade(arguments, prog_name="enfilade")
    return 0


# Executors.


def executor_trial(work: Work, shiny: Made) -> Trial:
    """The same run by one, two and seven workers of each executor, and another by two of them."""

    def trial(number: int, folder: Path, _chance: random.Random) -> str | None:
        name, workers = [*MORE_EXECUTORS, *OF_MITSUBA][number]
        of = work if number < len(MORE_EXECUTORS) else shiny()
        flags = ("--executor", name, "--workers", str(workers))
        prefix, out = alone() if name == "ray" else (), folder / "run"
        act = partial(finish, of.inputs, out, *flags, prefix=prefix)
        return attempt(act, of, out, f"{of.whole.name}, {name}, {workers} workers")

    return trial


def alone() -> tuple[str, ...]:
    """Prefix that runs a command in a network of its own: Ray listens on every interface it finds."""
    line = ("unshare", "-n", "sh", "-c", 'ip link set lo up && exec "$@"', "sh")
    works = subprocess.run([*line, "true"], capture_output=True, check=False).returncode == 0
    return line if works else ()


def cluster_trial(folder: Path, kills: int, spp: int) -> Trial:
    """Ray, whose workers are killed one after the other while 50 units are done."""
    from analytic import RENDERER

    scene = folder / "wall.analytic"

    def trial(_number: int, place: Path, _chance: random.Random) -> str | None:
        path = walk(place / "fifty.json", 50)
        inputs = (str(scene), *RENDERER, "--path", str(path), "--method", "reference", "--spp", str(spp))
        work, out = made(place, "whole", inputs), place / "run"
        process = start([*alone(), *command(inputs, out, "--executor", "ray", "--workers", "2")])
        ledger, killed, done = out / "ledger.jsonl", 0, 0
        while process.poll() is None and killed < kills:
            workers = [pid for pid in descendants(process.pid) if b"do_unit" in cmdline(pid)]
            lines = ledger.read_bytes().count(b"\n") if ledger.exists() else 0
            # Not faster than units are done: a machine on which nothing succeeds is given ever longer pauses.
            if workers and lines > done:
                kill(workers[0])
                killed, done = killed + 1, lines
            time.sleep(0.1)
        code = process.wait(TIMEOUT_S)
        problem = f"exit code {code}" if code else difference(work, out)
        if killed < kills:
            problem = f"only {killed} workers could be killed ({problem})"
        return f"{killed} workers killed: {problem}" if problem else None

    return trial


def descendants(pid: int) -> list[int]:
    """Processes that come of a process."""
    own = children(pid)
    return own + [p for child in own for p in descendants(child)]


def cmdline(pid: int) -> bytes:
    """Command line of a process, or nothing."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


# Disks.


def disk_trial(work: Work, tally: Tally) -> Trial:
    """A disk that fills up, then gets room."""
    need = sum(f.stat().st_size + 4096 for f in work.whole.rglob("*") if f.is_file()) // 1024

    def trial(_number: int, place: Path, chance: random.Random) -> str | None:
        size = chance.randrange(24, need)
        workers = chance.choice(((), ("--executor", "processes", "--workers", "2")))
        line = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", str(place)]
        mounted = subprocess.run(line, capture_output=True, text=True, check=False)
        if mounted.returncode:
            why = mounted.stderr.strip()
            tally.skipped["disk"] = f"skipped: only who can mount a small disk can fill it ({why})"
            return None
        try:
            return fill(work, place, size, workers)
        finally:
            subprocess.run(["umount", "-l", str(place)], check=True)

    return trial


def fill(work: Work, place: Path, size: int, workers: tuple[str, ...]) -> str | None:
    """Run into a full disk, look at what is there, make room, go on."""
    out, what = place / "run", f"disk of {size} KiB, {workers[1:2] or 'in-process'}"
    line = command(work.inputs, out, *workers)
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    told = done.stderr.strip()[-300:]
    if done.returncode != 0 and ("no room" not in told or done.returncode != 1):
        return f"{what}: exit code {done.returncode}, {told}"
    is_rendered = (out / "plots").exists()
    if done.returncode and (out / "frames").exists() and not is_rendered and NEED not in told:
        return f"{what}: not said how much is needed: {told}"
    whole = {f.relative_to(work.whole): sha(f) for f in stored(work.whole)}
    for file in stored(out):
        if sha(file) != whole[file.relative_to(out)]:
            return f"{what}: a partial {file.relative_to(out)}"
    if done.returncode == 0:
        return None if difference(work, out) is None else f"{what}: finished, with a difference"
    subprocess.run(["mount", "-o", "remount,size=64m", str(place)], check=True)
    return attempt(lambda: finish(work.inputs, out, *workers), work, out, what)


# Bits.


def bit_trial(work: Work) -> Trial:
    """A flipped bit, found when its file is used, or by --verify."""

    def trial(number: int, folder: Path, chance: random.Random) -> str | None:
        out, is_used = folder / "run", number % 2 == 0
        shutil.copytree(work.whole, out)
        there = tuple(kind for kind in STORED if (out / kind).is_dir())
        kinds = ("raw", "frames", "clips", "") if is_used else (*there, "video", "")
        file = chance.choice(candidates(out, chance.choice(kinds)))
        if is_used:
            forget_users(out, file)
        flip(file, chance)
        how = () if is_used else ("--verify",)
        what = f"a bit of {file.relative_to(out)} flipped, {'used' if is_used else 'verified'}"
        return attempt(lambda: finish(work.inputs, out, *how), work, out, what)

    return trial


def candidates(out: Path, kind: str) -> list[Path]:
    """Files of a kind; of none, the run's own."""
    match kind:
        case "":
            return [out / "run.json", out / "ledger.jsonl", out / "job.json"]
        case "video":
            return list(out.glob("video.*"))
        case _:
            return sorted((out / kind).iterdir())


def forget_users(out: Path, file: Path) -> None:
    """Remove what is made of a file, so that it is used again."""
    if file.parent.name == "raw":
        (out / "frames" / file.name).unlink()
    elif file.parent.name in ("frames", "clips"):
        clips = (out / "clips").iterdir() if file.parent.name == "frames" else ()
        for made in [*out.glob("video.*"), *clips]:
            made.unlink()


def flip(file: Path, chance: random.Random) -> None:
    """Flip a bit."""
    data = bytearray(file.read_bytes())
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    file.write_bytes(data)


if __name__ == "__main__":
    sys.exit(main())
