"""How many camera rays a second look up light: visibility, albedo and lookup.

    python benchmarks/lookups.py [--scene room] [--size 640x480] [--spp 4] [--repeats 20]

Prepares the light around one segment of ROOM or ATRIUM, then sends rays through the middle frame of it, a few
a pixel, and prints millions a second: at best, and in the median. What pages don't know is looked up in cells
or traced, as it is in a run. Making the rays is not counted.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FIRST, SPACING = 31, 8  # frames of the short walks, in which the camera moves
WARM_UP = 3  # repeats in which kernels are recorded


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scene", choices=("room", "atrium"), default="room")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--spp", type=int, default=4, help="rays a pixel, sent at once")
    parser.add_argument("--repeats", type=int, default=20)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        times, count, known = measured(Path(name), arguments)
    best, middle = (count / seconds / 1e6 for seconds in (min(times), statistics.median(times)))
    print(
        f"{arguments.scene} {arguments.size}: {count} rays, {known:.1%} of the lit pixels known to pages; "
        f"best {best:.1f}, median {middle:.1f} million a second"
    )


def measured(folder: Path, arguments: argparse.Namespace) -> tuple[list[float], int, float]:
    """Seconds of each repeat, rays of one, and which share of lit pixels the pages know."""
    line = [sys.executable, "-m", "enfilade", "scene", arguments.scene, "--out", str(folder / "scene")]
    subprocess.run(
        [*line, "--preset", "small", "--size", arguments.size], check=True, stdout=subprocess.DEVNULL
    )
    from enfilade.device import activate

    activate("cpu")  # before what binds Dr.Jit's types
    import drjit as dr
    import numpy as np

    from enfilade.camera import load_path
    from enfilade.kernels.estimate import Estimate
    from enfilade.monitor import Silence
    from enfilade.pipeline.job import Job
    from enfilade.pipeline.light import LightTable
    from enfilade.pipeline.survey import survey_path
    from enfilade.pipeline.units import segments_of
    from enfilade.pipeline.workshop import Workshop
    from enfilade.renderer import PixelFilter, Purpose
    from enfilade.settings import Settings
    from enfilade.store import Run

    width, height = map(int, arguments.size.split("x"))
    frames = tuple(range(FIRST, FIRST + SPACING + 1))
    path = load_path(folder / "scene" / "camera_path.json", size=(width, height), frames=frames)
    settings = Settings.from_tables({"light": {"spacing": SPACING, "paths": 4}})
    job = Job(folder / "scene" / "scene.xml", path, settings, "decoupled")
    renderer = job.open_renderer()
    times: list[float] = []
    with Run.open(folder / "run", job.identity(renderer)) as run:
        workshop = Workshop(job, renderer, run, Silence())
        table = LightTable(
            workshop, segments_of(job, survey_path(workshop.views, path, settings, Silence()))[0]
        )
        for segment in table.segments:
            table.prepare(segment)
        frame = SPACING // 2
        camera = path.cameras[frame]
        near, cache = table.around(frame)

        def seen(rays, rng):
            dr.eval(rays, rng)
            dr.sync_thread()
            begin = time.perf_counter()
            found = workshop.shader.seen(near, cache, rays, rng, pixel_angle=camera.pixel_angle)
            dr.eval(found)
            dr.sync_thread()
            times.append(time.perf_counter() - begin)
            return found

        pixels = np.arange(width * height, dtype=np.uint32)
        rays = Estimate(
            camera,
            pixels,
            seen,
            chunk=len(pixels) * arguments.spp,
            pixel_filter=PixelFilter.GAUSSIAN,
            random=workshop.random(frame, Purpose.DIFFUSE),
        )
        for _ in range(WARM_UP + arguments.repeats):
            rays.add(arguments.spp)
        is_known = np.array(near.pages[0].shape_indices) > 0
        has_diffuse = workshop.views[frame].geometry.has_diffuse.ravel()
    return times[WARM_UP:], len(pixels) * arguments.spp, float(is_known[has_diffuse].mean())


if __name__ == "__main__":
    main()
