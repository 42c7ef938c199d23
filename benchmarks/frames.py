"""Cost of a frame of the default method by itself, by image size.

    python benchmarks/frames.py [--scene atrium] [--sizes 320x180 640x480] [--frames 31-46] [--quality 10]

Renders some frames of ROOM or ATRIUM, one process for each size, and adds up the cost of the tasks that make
frames: keyframes and the video are left out. Prints seconds a frame as the median over frames, wall (CPU)
time, and the peak memory of the process.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from enfilade.runs.folder import RunFolder
from enfilade.runs.statistics import add_costs

PASSES = ("shading", "frames")
STAGES = (*PASSES, "gbuffer", "files")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scene", choices=("room", "atrium"), default="atrium")
    parser.add_argument(
        "--sizes", nargs="+", default=["320x180", "640x360", "640x480", "1280x720", "1920x1080"]
    )
    parser.add_argument("--frames", default="31-46")
    parser.add_argument("--quality", default="10")
    parser.add_argument("--layers", default="forward,backward,provenance", help="of the frames, or 'all'")
    arguments = parser.parse_args()
    headings = "".join(f"{name:>16}" for name in (*STAGES, "all"))
    print(f"seconds a frame, wall (CPU)   {headings}      MiB")
    with tempfile.TemporaryDirectory() as name:
        for size in arguments.sizes:
            scene, run = Path(name) / f"scene-{size}", Path(name) / size
            command("studies", "scene", arguments.scene, "--out", scene, "--preset", "small", "--size", size)
            flags = [
                "--frames",
                arguments.frames,
                "--quality",
                arguments.quality,
                "--layers",
                arguments.layers,
            ]
            files = [scene / "scene.xml", "--path", scene / "camera_path.json", "--out", run]
            command("enfilade", "render", *files, *flags, "--quiet")
            show(size, run)


def show(size: str, run: Path) -> None:
    """Print the cost of the frames of a run."""
    by_frame = defaultdict(list)
    for line in RunFolder.read(run).lines():
        if line["pass"] in PASSES:
            by_frame[line["frame"]].append(line["cost"])
    costs = [add_costs(tasks) for tasks in by_frame.values()]
    row = ""
    for stages in (*((stage,) for stage in STAGES), STAGES):
        wall, cpu = (
            statistics.median(sum(cost[stage][kind] for stage in stages if stage in cost) for cost in costs)
            for kind in ("wall_s", "cpu_s")
        )
        row += f"{f'{wall:.3f} ({cpu:.3f})':>16}"
    peak = json.loads((run / "summary.json").read_text())["peak_memory_bytes"] / 2**20
    print(f"{size:<30}{row}{peak:9.0f}", flush=True)


def command(module: str, *words: str | Path) -> None:
    """Run a command of ours in a process of its own."""
    line = [sys.executable, "-m", module, *map(str, words)]
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
