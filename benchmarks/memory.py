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
    scene, path = folder / "wall.analytic.json", folder / "path.json"
    scene.write_text(scene_text())
    width, height = size.split("x")
    eyes = {at / FPS: [0.02 * at, 0.0, 4.0] for at in (0, count - 1)}
    keys = [{"time": t, "eye": e, "target": [e[0], 0, 0], "fov": 50} for t, e in eyes.items()]
    walk = {"format": "enfilade-path", "fps": FPS, "size": [int(width), int(height)], "keys": keys}
    path.write_text(json.dumps(walk))
    command = [sys.executable, "-m", "enfilade", "render", scene, "--path", path, "--out", folder / "run"]
    flags = ["--method", "paper", "--spp", "4", "--quiet"]
    subprocess.run([*map(str, command), *flags], check=True, stdout=subprocess.DEVNULL)
    return json.loads((folder / "run" / "summary.json").read_text())


def scene_text() -> str:
    """A wall and a ball, as a file of the analytic backend."""
    from enfilade.scene.analytic_scene import AnalyticScene, Material, Plane, Sphere, Waves
    from enfilade.scene.analytic_scene import scene_text as text_of

    wall = Plane((0, 0, 0), (0, 0, 1), Material(Waves((0.2, 0.3, 0.5), (0.9, 0.7, 0.4), period=1.3)), "wall")
    ball = Sphere((0.5, 0.0, 1.0), 0.5, Material((0.7, 0.2, 0.15)), "ball")
    return text_of(AnalyticScene((wall, ball)))


if __name__ == "__main__":
    main()
