"""Camera rays a second that look up cached irradiance: visibility, albedo and lookup.

    python benchmarks/lookups.py [--scene room] [--size 640x480] [--spp 4] [--repeats 20]

Renders one segment of ROOM or ATRIUM by the method `decoupled`, then sends rays through its middle frame, a
few a pixel, and prints millions a second: the best, and the median. Misses are looked up in the hash grid or
path traced, as in a run. The generation of the rays is not counted.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from enfilade.device import activate

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
    activate("cpu")  # before the modules that bind Dr.Jit's types
    with tempfile.TemporaryDirectory() as name:
        times, count, known = measured(Path(name), arguments)
    best, middle = (count / seconds / 1e6 for seconds in (min(times), statistics.median(times)))
    print(
        f"{arguments.scene} {arguments.size}: {count} rays, {known:.1%} of the diffuse pixels in images; "
        f"best {best:.1f}, median {middle:.1f} million a second"
    )


def measured(folder: Path, arguments: argparse.Namespace) -> tuple[list[float], int, float]:
    """Seconds of each repeat, rays of one, and the share of diffuse pixels that irradiance images know."""
    import drjit as dr
    import numpy as np

    from enfilade.camera import load_path
    from enfilade.kernels.estimate import Estimate
    from enfilade.methods.decoupled.integrator import Integrator
    from enfilade.methods.decoupled.shot import ShotContext
    from enfilade.methods.decoupled.virtual_images import VirtualImages
    from enfilade.methods.walkthrough import Walkthrough
    from enfilade.monitor import Silence
    from enfilade.renderer import PixelFilter, Purpose
    from enfilade.runs.folder import RunFolder
    from enfilade.runs.job import Job
    from enfilade.runs.render import render
    from enfilade.scene.opener import Scene
    from enfilade.settings import KeyframeSettings, Settings
    from studies.scenes import write_scene

    width, height = map(int, arguments.size.split("x"))
    files = write_scene(arguments.scene, folder / "scene", preset="small")
    path = load_path(files.path, size=(width, height), frames=tuple(range(FIRST, FIRST + SPACING + 1)))
    job = Job(Scene(files.scene), path, Settings(KeyframeSettings(spacing=SPACING)))
    render(job, folder / "run", Silence())
    renderer, frame = job.open_renderer(), SPACING // 2
    walk = Walkthrough(path, job.rendering_settings(), renderer)
    inputs = Results(job, RunFolder.read(folder / "run"))
    segments = inputs.analysis.segments(SPACING)[0]
    integrator = Integrator(renderer)
    shot = ShotContext(0, segments, inputs, walk, integrator, VirtualImages(renderer))
    cache = shot.shading_cache(frame)
    times: list[float] = []

    def radiance(rays, sampler):
        dr.eval(rays, sampler)
        dr.sync_thread()
        begin = time.perf_counter()
        found = integrator.diffuse_radiance(cache, rays, sampler, pixel_angle=path.cameras[frame].pixel_angle)
        dr.eval(found)
        dr.sync_thread()
        times.append(time.perf_counter() - begin)
        return found

    pixels = np.arange(width * height, dtype=np.uint32)
    rays = Estimate(
        path.cameras[frame],
        pixels,
        radiance,
        chunk=len(pixels) * arguments.spp,
        pixel_filter=PixelFilter.GAUSSIAN,
        random=walk.random(frame, Purpose.DIFFUSE),
    )
    for _ in range(WARM_UP + arguments.repeats):
        rays.add(arguments.spp)
    is_known = np.array(cache.view.shape_indices) > 0
    has_diffuse = walk.view(frame).geometry.has_diffuse.ravel()
    return times[WARM_UP:], len(pixels) * arguments.spp, float(is_known[has_diffuse].mean())


class Results:
    """Results of a finished run, as :class:`enfilade.methods.base.Inputs`."""

    def __init__(self, job, run) -> None:
        from enfilade.runs.worker import analysis_of

        self._run, self._numbers = run, job.path.numbers
        self._records = {of.name: of.record for of in job.opened_method().passes}
        self.analysis = analysis_of(job, run)

    def record(self, pass_name, frame):
        """The record of a pass for a frame."""
        from enfilade.images.records import read_record

        return read_record(self._run.file_of(pass_name, self._numbers[frame]), self._records[pass_name])

    def facts(self, pass_name, frame):
        """The facts of a task."""
        return self._run.line(pass_name, self._numbers[frame])


if __name__ == "__main__":
    main()
