"""What a frame costs by itself, by its size: rays, and all that is none.

    python benchmarks/frames.py [--scene atrium] [--sizes 320x180 640x480] [--frames 31-46] [--quality 10]

Renders some frames of ROOM or ATRIUM with the default method, one process for each size, and adds up what
the ledger says of the units that make frames: what keyframes cost is left out, and so is the video. Prints
seconds a frame as the median over frames, wall time beside CPU time, and the peak memory of the process.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

RAYS = ("gather", "scatter")  # stages that send rays and look up light; all others are overhead
STAGES = (*RAYS, "pool", "geometry", "over time", "files")
UNITS = ("raw ", "frame ")  # a frame shaded by itself, and the one that is delivered


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scene", choices=("room", "atrium"), default="atrium")
    parser.add_argument(
        "--sizes", nargs="+", default=["320x180", "640x360", "640x480", "1280x720", "1920x1080"]
    )
    parser.add_argument("--frames", default="31-46")
    parser.add_argument("--quality", default="10")
    parser.add_argument(
        "--layers", default="forward,backward,source", help="of the delivered frames, or 'all'"
    )
    arguments = parser.parse_args()
    print(
        "seconds a frame, wall (CPU)   "
        + "".join(f"{name:>16}" for name in (*STAGES, "overhead", "all"))
        + "      MiB"
    )
    with tempfile.TemporaryDirectory() as name:
        for size in arguments.sizes:
            scene, run = Path(name) / f"scene-{size}", Path(name) / size
            enfilade("scene", arguments.scene, "--out", scene, "--preset", "small", "--size", size)
            files = [scene / "scene.xml", "--path", scene / "camera_path.json", "--out", run]
            flags = ["--frames", arguments.frames, "--quality", arguments.quality]
            enfilade("render", *files, *flags, "--output-layers", arguments.layers, "--quiet")
            show(size, run)


def show(size: str, run: Path) -> None:
    """Print what the frames of a run have cost."""
    costs = spent(run)
    kinds = {stage: (stage,) for stage in STAGES}
    kinds["overhead"] = tuple({stage for frame in costs for stage in frame} - set(RAYS))
    kinds["all"] = (*RAYS, *kinds["overhead"])
    row = ""
    for stages in kinds.values():
        wall, cpu = (
            statistics.median(sum(frame[stage][kind] for stage in stages) for frame in costs)
            for kind in (0, 1)
        )
        row += f"{f'{wall:.3f} ({cpu:.3f})':>16}"
    peak = json.loads((run / "summary.json").read_text())["peak_memory_bytes"] / 2**20
    print(f"{size:<30}{row}{peak:9.0f}", flush=True)


def spent(run: Path) -> list[dict[str, tuple[float, float]]]:
    """Wall and CPU time of each stage, for each frame of a run."""
    frames: dict[int, dict[str, tuple[float, float]]] = defaultdict(lambda: defaultdict(lambda: (0.0, 0.0)))
    for text in (run / "ledger.jsonl").read_text().splitlines():
        line = json.loads(text)
        if not line.get("unit", "").startswith(UNITS):
            continue
        costs = frames[line["frame"]]
        for stage, cost in line["cost"].items():
            wall, cpu = costs[stage]
            costs[stage] = wall + cost["wall_s"], cpu + cost["cpu_s"]
    return list(frames.values())


def enfilade(*words: str | Path) -> None:
    """Run a command of ours in a process of its own."""
    subprocess.run(
        [sys.executable, "-m", "enfilade", *map(str, words)], check=True, stdout=subprocess.DEVNULL
    )


if __name__ == "__main__":
    main()
