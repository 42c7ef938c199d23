"""Mutated files: reading them ends well, or with an error of this package.

    python benchmarks/fuzz.py [--count 10000] [--seed 1]

OpenEXR images, camera paths (JSON), Mitsuba scenes (XML) and run folders are damaged at random and read by a
process of its own, with 2 GiB of memory and 10 s for each. A crash, another exception, a lack of memory or
time are failures; the seed of each is printed.
"""

import argparse
import contextlib
import json
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from enfilade.errors import EnfiladeError

MEMORY_BYTES, SECONDS = 2 << 30, 10
BATCH = 500  # files read by one process
IDENTITY = "identity.json"  # of the run that a folder holds
SPLICES = (
    b"\0" * 8,
    b"\xff" * 8,
    b"[" * 5000,
    b"1e999",
    b"-1",
    b"99999999999",
    b"../" * 20,
    b"\n",
    b'"',
    b"<!",
    b"NaN",
)


def main() -> int:
    """Read so many; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--batch", type=int, nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.batch:
        read_batch(*arguments.batch)
        return 0
    failures, first, end = [], arguments.seed, arguments.seed + arguments.count
    begin = time.monotonic()
    while first < end:
        last = min(first + BATCH, end)
        reached, problem = run_batch(first, last)
        if problem:
            failures.append(f"seed {reached}: {problem}")
            print(failures[-1], flush=True)
        first = reached + 1 if problem else last
    seconds = time.monotonic() - begin
    print(f"{arguments.count} mutated files, {len(failures)} failures, {seconds:.0f} s")
    return 1 if failures else 0


def run_batch(first: int, last: int) -> tuple[int, str | None]:
    """Let a process read a batch; returns the last seed that it began, and what went wrong."""
    line = [sys.executable, __file__, "--batch", str(first), str(last)]
    done = subprocess.run(line, capture_output=True, text=True, errors="replace", check=False)
    seeds = [int(text) for text in done.stdout.splitlines() if text.isdigit()]
    if done.returncode == 0:
        return last - 1, None
    reason = done.stderr.strip().splitlines()[-1:] or [""]
    return seeds[-1] if seeds else first, f"exit code {done.returncode}, {reason[0][:300]}"


def read_batch(first: int, last: int) -> None:
    """Read a batch, with bounded memory and time."""
    readers = all_readers()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name)
        for kind in readers:
            (folder / kind).mkdir()
        samples = {kind: make(folder / kind) for kind, (make, _) in readers.items()}
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        signal.signal(signal.SIGALRM, signal.SIG_DFL)  # which ends the process
        for seed in range(first, last):
            sys.stdout.write(f"{seed}\n")
            sys.stdout.flush()
            chance = random.Random(seed)  # noqa: S311  (which bytes, not a secret)
            kind = chance.choice(list(readers))
            file = samples[kind]
            whole = file.read_bytes()
            file.write_bytes(mutated(whole, chance))
            signal.alarm(SECONDS)
            try:
                readers[kind][1](file)
            except EnfiladeError:
                pass
            finally:
                signal.alarm(0)
                file.write_bytes(whole)


def mutated(data: bytes, chance: random.Random) -> bytes:
    """Damage a file in a few places."""
    out = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        at, size = chance.randrange(len(out) + 1), chance.randrange(1, 64)
        match chance.randrange(6):
            case 0 if at < len(out):
                out[at] ^= 1 << chance.randrange(8)
            case 1:
                out[at : at + size] = chance.randbytes(size)
            case 2:
                del out[at : at + size]
            case 3:
                out[at:at] = chance.choice(SPLICES)
            case 4:
                out[at:at] = out[at : at + size]
            case _:
                del out[at + chance.randrange(4000) :]
    return bytes(out)


def all_readers() -> dict[str, tuple[Callable[[Path], Path], Callable[[Path], object]]]:
    """By kind: what makes a sound file in a folder, and what reads it."""
    from enfilade.camera import load_path
    from enfilade.images import read_exr
    from enfilade.images.exr import read_attributes
    from enfilade.runs.job import read_job
    from enfilade.scene.mitsuba.files import check_scene
    from enfilade.settings import LimitSettings

    return {
        "exr": (make_exr, read_exr),
        "exr of a run": (lambda folder: make_exr(folder, is_portable=False), read_exr),
        "exr header": (make_exr, read_attributes),
        "path": (make_path, load_path),
        "scene": (make_scene, lambda file: check_scene(file, LimitSettings())),
        "run": (lambda folder: make_run(folder) / "run.json", read_run),
        "ledger": (lambda folder: make_run(folder) / "ledger.jsonl", read_run),
        "job": (lambda folder: make_run(folder) / "job.json", lambda file: read_job(file.parent)),
    }


def make_exr(folder: Path, *, is_portable: bool = True) -> Path:
    """An image of a few layers."""
    import numpy as np

    from enfilade.images import write_exr

    layers = {
        "RGB": np.ones((24, 32, 3), np.float16),
        "Z": np.random.default_rng(1).random((24, 32), np.float32),
    }
    write_exr(folder / "image.exr", layers, attributes={"note": "x"}, is_portable=is_portable)
    return folder / "image.exr"


def make_path(folder: Path) -> Path:
    """Keyed poses."""
    keys = [{"time": t, "eye": [t, 0, 4], "target": [t, 0, 0], "fov": 50} for t in (0, 0.5, 1)]
    table = {"format": "enfilade-path", "fps": 30, "size": [32, 24], "keys": keys}
    (folder / "path.json").write_text(json.dumps(table))
    return folder / "path.json"


def make_scene(folder: Path) -> Path:
    """A Mitsuba scene with an image, a film and parameters."""
    make_exr(folder)
    picture = '<texture type="bitmap"><string name="filename" value="$name"/></texture>'
    film = '<film type="hdrfilm"><integer name="width" value="32"/></film>'
    ball = f'<shape type="sphere"><bsdf type="diffuse">{picture}</bsdf></shape>'
    body = f'{ball}<sensor type="perspective">{film}</sensor>'
    text = f'<scene version="3.0.0"><default name="name" value="image.exr"/>{body}</scene>'
    (folder / "scene.xml").write_text(text)
    return folder / "scene.xml"


def make_run(folder: Path) -> Path:
    """A run folder with a few finished tasks."""
    from enfilade.camera import load_path
    from enfilade.runs.folder import RunFolder
    from enfilade.runs.job import Job
    from enfilade.runs.render import prepare
    from enfilade.scene.opener import Scene

    out = folder / "run"
    if not out.exists():
        job = Job(Scene(make_scene(folder)), load_path(make_path(folder)), method="reference")
        prepare(job, out)
        (folder / IDENTITY).write_text(json.dumps(job.identity()))
        counts = {"keyframe": 1, "reused": 0, "slow": 0, "specular": 0, "disoccluded": 0}
        with RunFolder.share(out) as run:
            for number in range(10):
                file = run.stem("frames", number).with_suffix(".exr")
                file.parent.mkdir(exist_ok=True)
                file.write_bytes(b"x" * number)
                line = {"pass": "frames", "frame": number, "provenance": counts, "cost": {}}
                run.finish({**line, "files": run.record_of([file])})
    return out


def read_run(file: Path) -> None:
    """Read a run as the report does, and continue a copy of it."""
    from enfilade.reports.run import ReportedRun
    from enfilade.runs.folder import RunFolder

    folder = file.parent
    copy = folder.with_name("copy")
    shutil.copytree(folder, copy)
    identity = json.loads((folder.parent / IDENTITY).read_text())
    try:
        with contextlib.suppress(EnfiladeError):
            ReportedRun(folder)
        with contextlib.suppress(EnfiladeError), RunFolder.create(copy, identity) as run:
            run.damaged()
            run.digest()
    finally:
        shutil.rmtree(copy)


if __name__ == "__main__":
    sys.exit(main())
