"""Measure whether the memory of a run depends on the number of its frames.

    python benchmarks/memory.py [--size 1920x1080] [--frames 30 100]

Renders a textured wall and a ball, which cost next to nothing to trace, with the whole method of the
paper; one process for each number of frames; prints the peak memory of each.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FPS = 30


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--frames", type=int, nargs="+", default=[30, 100])
    arguments = parser.parse_args()
    peaks = []
    for count in arguments.frames:
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            summary = render(Path(folder), arguments.size, count)
            peaks.append(summary["peak_memory_bytes"] / 2**20)
            print(
                f"{count} frames of {arguments.size}: {peaks[-1]:.0f} MiB, "
                f"{time.perf_counter() - begin:.0f} s, {summary['table1']['total']:.1f} % traced"
            )
    print(f"ratio of the last to the first: {peaks[-1] / peaks[0]:.3f}")


def render(folder: Path, size: str, count: int) -> dict:
    """Render `count` frames in a process of its own; returns the run's summary."""
    from analytic import BALL, RENDERER, WALL, AnalyticScene, write_scene

    scene = write_scene(folder / "wall.analytic", AnalyticScene((WALL, BALL)))
    path = folder / "path.json"
    width, height = size.split("x")
    eyes = {at / FPS: [0.02 * at, 0.0, 4.0] for at in (0, count - 1)}
    keys = [{"time": t, "eye": e, "target": [e[0], 0, 0], "fov": 50} for t, e in eyes.items()]
    walk = {"format": "enfilade-path", "fps": FPS, "size": [int(width), int(height)], "keys": keys}
    path.write_text(json.dumps(walk))
    command = [sys.executable, "-m", "enfilade", "render", scene, "--path", path, "--out", folder / "run"]
    flags = [*RENDERER, "--method", "paper", "--spp", "4", "--quiet"]
    subprocess.run([*map(str, command), *flags], check=True, stdout=subprocess.DEVNULL)
    return json.loads((folder / "run" / "summary.json").read_text())


if __name__ == "__main__":
    main()
