"""Whether the memory of a run depends on the number of its frames.

    python benchmarks/memory.py [--size 1920x1080] [--frames 30 100]

Renders a textured wall and a ball with all passes of the paper's method, one process for each number of
frames, and prints the peak memory of each.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FPS = 30
SCENE = """<scene version="3.0.0">
<shape type="rectangle" id="wall">
  <transform name="to_world"><scale value="9"/></transform>
  <bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
    <transform name="to_uv"><scale value="16"/></transform>
  </texture></bsdf>
</shape>
<shape type="sphere" id="ball">
  <point name="center" x="0.5" y="0" z="1"/><float name="radius" value="0.5"/>
  <bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.2, 0.15"/></bsdf>
</shape>
<emitter type="constant"/>
</scene>"""


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
                f"{time.perf_counter() - begin:.0f} s, {summary['traced_percent']['total']:.1f} % traced"
            )
    print(f"ratio of the last to the first: {peaks[-1] / peaks[0]:.3f}")


def render(folder: Path, size: str, count: int) -> dict:
    """Render `count` frames in a process of its own; returns the run's summary."""
    scene, path = folder / "scene.xml", folder / "path.json"
    scene.write_text(SCENE)
    eyes = {at / FPS: [0.02 * at, 0.0, 4.0] for at in (0, count - 1)}
    keys = [{"time": t, "eye": e, "target": [e[0], 0, 0], "fov": 50} for t, e in eyes.items()]
    walk = {"format": "enfilade-path", "fps": FPS, "size": [int(n) for n in size.split("x")], "keys": keys}
    path.write_text(json.dumps(walk))
    command = [sys.executable, "-m", "enfilade", "render", scene, "--path", path, "--out", folder / "run"]
    flags = ["--method", "paper", "--spp", "4", "--quiet"]
    subprocess.run([*map(str, command), *flags], check=True, stdout=subprocess.DEVNULL)
    return json.loads((folder / "run" / "summary.json").read_text())


if __name__ == "__main__":
    main()
