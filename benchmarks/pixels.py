"""Whether tracing a list of pixels costs in proportion to the list.

    python benchmarks/pixels.py [--size 640x480] [--spp 64] [--percent 5]

Writes the small ROOM into a temporary folder, traces all pixels of a frame and then a random share of
them, in turn, and prints the ratio of CPU times.
"""

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from enfilade.device import activate


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--percent", type=float, default=5.0)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    activate("auto")
    from enfilade.camera import load_path
    from enfilade.renderer import Purpose, RandomKey
    from enfilade.scene.opener import Scene
    from enfilade.settings import Settings
    from studies.scenes import write_scene

    width, height = map(int, arguments.size.split("x"))
    with tempfile.TemporaryDirectory() as folder:
        files = write_scene("room", Path(folder), preset="small")
        camera = load_path(files.path, size=(width, height)).cameras[30]
        renderer = Scene(files.scene).open(Settings())

    everything = np.arange(width * height, dtype=np.uint32)
    count = round(len(everything) * arguments.percent / 100.0)
    chosen = np.random.default_rng(1).choice(everything, count, replace=False)

    def seconds(pixels: np.ndarray) -> tuple[float, float]:
        wall, cpu = time.perf_counter(), time.process_time()
        renderer.trace(camera, pixels, RandomKey(0, 1, Purpose.FILL), spp=arguments.spp)
        return time.perf_counter() - wall, time.process_time() - cpu

    seconds(chosen)  # compiles
    ratios = []
    for _ in range(arguments.rounds):
        whole, part = seconds(everything), seconds(np.sort(chosen))
        ratios.append(100.0 * part[1] / whole[1])
        print(
            f"all: {whole[0]:.2f} s wall, {whole[1]:.2f} s CPU; "
            f"{arguments.percent:g} %: {part[0]:.2f} s wall, {part[1]:.2f} s CPU; ratio {ratios[-1]:.2f} %"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"median ratio of CPU times {np.median(ratios):.2f} %, peak memory {peak:.0f} MiB")


if __name__ == "__main__":
    main()
