"""Is light lost or gained? `python -m studies.bench.energy FOLDER ... [--configuration decoupled-60 ...]`.

FOLDER holds a finished bench. Prints the mean luminance of all windows and measured frames over that of the
reference, of all pixels and of each shape that covers more than 1000 of them. The error of the reference is
half the difference of its halves.
"""

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.table import Table

from enfilade.device import activate
from enfilade.kernels.tone import luminance
from enfilade.records import F32

MIN_PIXELS = 1000  # of a shape, in all windows and frames
TOLERANCE = 0.02  # shapes that differ by more are listed


@dataclass(frozen=True)
class Energy:
    """Light of some pixels over that of the reference.

    Attributes
    ----------
    name : str
        Of the shape.
    pixels : int
    ratio : float
        Of the mean luminances.
    error : float
        Of the reference, relative.
    """

    name: str
    pixels: int
    ratio: float
    error: float


def energy_of(
    image: F32, halves: F32, index: npt.NDArray[np.uint32], names: tuple[str, ...]
) -> tuple[Energy, list[Energy]]:
    """Energy of all pixels, and of the shapes that cover more than :data:`MIN_PIXELS`.

    Parameters
    ----------
    image : (N, 3) float32
    halves : (2, N, 3) float32
        Of the reference.
    index : (N,) uint32
        Number of the shape of each pixel, 0 for none.
    names
        Of the shapes, from 1 on.
    """
    shown, *both = (np.bincount(index, luminance(of), len(names) + 1) for of in (image, *halves))
    pixels = np.bincount(index, minlength=len(names) + 1)

    def energy(name: str, where: slice | int) -> Energy:
        one, other = (float(np.sum(of[where])) for of in both)
        mean = 0.5 * (one + other)
        return Energy(
            name,
            int(np.sum(pixels[where])),
            float(np.sum(shown[where])) / mean,
            0.5 * abs(one - other) / mean,
        )

    shapes = [k for k in np.flatnonzero(pixels > MIN_PIXELS) if k and both[0][k] + both[1][k] > 0.0]
    return energy("all", slice(None)), [energy(names[k - 1], int(k)) for k in shapes]


def main() -> None:
    """Print the energy of each bench."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--configuration", nargs="+", default=["decoupled-60", "decoupled-10"])
    parser.add_argument("--references", type=Path, default=Path("runs/references"))
    arguments = parser.parse_args()
    activate("cpu")
    from enfilade.methods.walkthrough import Walkthrough
    from enfilade.runs.job import read_job
    from enfilade.settings import SampleFilter
    from studies.bench.measuring import windows_of_run
    from studies.bench.references import References
    from studies.bench.tables import print_table
    from studies.bench.windows import windows_of

    table = Table(title=f"Light over that of the reference; shapes of more than {MIN_PIXELS} pixels")
    for heading in ("scene", "configuration", "all, %", f"beyond {TOLERANCE:.0%}", "largest differences, %"):
        table.add_column(heading)
    for folder in arguments.folders:
        found = json.loads((folder / "bench.json").read_text())
        windows = windows_of(found["windows"])
        for name in arguments.configuration:
            run = folder / "configurations" / name
            job = read_job(run)
            job = replace(job, path=job.path.select(found["frames"]))
            references = References(arguments.references, job, windows)
            walk = Walkthrough(job.path, job.settings, job.open_renderer())
            shown = windows_of_run(run, job.path, windows, is_filtered=False)
            frames = range(len(job.path))
            images = np.concatenate([np.stack(shown(f)).reshape(-1, 3) for f in frames])
            halves = np.concatenate(
                [references.read(f).halves[SampleFilter.GAUSSIAN].reshape(2, -1, 3) for f in frames], axis=1
            )
            index = np.concatenate(
                [w.crop(walk.view(f).geometry.shape_index).ravel() for f in frames for w in windows]
            )
            whole, shapes = energy_of(images, halves, index, walk.renderer.describe().shapes)
            far = sorted(
                (s for s in shapes if abs(s.ratio - 1.0) > TOLERANCE), key=lambda s: -abs(s.ratio - 1.0)
            )
            largest = ", ".join(f"{s.name} {_percent(s)} ({s.pixels} px)" for s in far[:3])
            table.add_row(folder.name, name, _percent(whole), f"{len(far)} of {len(shapes)}", largest)
    print_table(table)


def _percent(of: Energy) -> str:
    return f"{100.0 * (of.ratio - 1.0):+.1f} ± {100.0 * of.error:.1f}"


if __name__ == "__main__":
    main()
