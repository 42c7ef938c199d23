"""Can the bench tell small errors from none? `python -m studies.bench.injected FOLDER [--spp 1024]`.

FOLDER holds a finished bench. Its windows are traced again by the references' own tracer, with other random
numbers, and measured as they are and with an injected error:

* ``brighter``: the largest object of the windows 3 % brighter,
* ``blurred``: irradiance (colour over albedo of diffuse surfaces) blurred within each shape, sigma 2 pixels;
  it also changes textures where the albedo varies within a pixel,
* ``repeated``: the middle frame replaced by the one before.

Without an error the score is that of the noise of so many paths.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from enfilade.device import activate
from enfilade.monitor import Silence
from enfilade.records import F32, Geometry

ERRORS = ("none", "brighter", "blurred", "repeated")
SEED = 0x7F4A7C15  # unlike the references'
GAIN = 1.03
SIGMA_PX = 2.0


def brightened(image: F32, shape_index: npt.NDArray[np.uint32], chosen: int) -> F32:
    """An image with one object 3 % brighter."""
    return np.where((shape_index == chosen)[..., None], image * np.float32(GAIN), image)


def blurred(image: F32, geometry: Geometry, crop: Any) -> F32:
    """An image whose irradiance is blurred within each diffuse shape."""
    albedo, index, is_diffuse = (
        crop(a) for a in (geometry.albedo, geometry.shape_index, geometry.has_diffuse)
    )
    found = image.copy()
    irradiance = image / np.maximum(albedo, 1e-3)
    for shape in np.unique(index[is_diffuse]):
        mask = is_diffuse & (index == shape)
        weight = gaussian_filter(mask.astype(np.float64), SIGMA_PX)
        mean = np.stack(
            [gaussian_filter(np.where(mask, c, 0.0), SIGMA_PX) for c in np.moveaxis(irradiance, 2, 0)], 2
        )
        found[mask] = (mean / np.maximum(weight, 1e-9)[..., None] * albedo)[mask]
    return found


def main() -> None:
    """Measure the injected errors and print their scores."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--references", type=Path, default=Path("runs/references"))
    parser.add_argument("--spp", type=int, default=1024)
    arguments = parser.parse_args()
    activate("cpu")
    from enfilade.methods.walkthrough import Walkthrough
    from enfilade.runs.job import read_job
    from enfilade.settings import SampleFilter
    from studies.bench.measures import QUALITIES
    from studies.bench.measuring import available, measure
    from studies.bench.references import References
    from studies.bench.tables import score_text
    from studies.bench.windows import windows_of

    found = json.loads((arguments.folder / "bench.json").read_text())
    job = read_job(arguments.folder / "configurations" / found["configurations"][0]["name"])
    job = replace(job, path=job.path.select(found["frames"]))  # the measured ones
    windows = windows_of(found["windows"])
    traced = References(arguments.references, job, windows, seed=SEED)
    traced.grow(arguments.spp, Silence())
    references = References(arguments.references, job, windows)
    walk = Walkthrough(job.path, job.settings, job.open_renderer())
    middle = len(job.path) // 2
    indices = np.concatenate([w.crop(walk.view(middle).geometry.shape_index).ravel() for w in windows])
    largest = int(np.bincount(indices[indices > 0]).argmax())

    def source(error: str) -> Any:
        def images(frame: int) -> Sequence[F32]:
            shown = frame - 1 if error == "repeated" and frame == middle else frame
            clean = traced.read(shown).denoised[SampleFilter.GAUSSIAN][2]
            geometry = walk.view(shown).geometry
            if error == "brighter":
                pairs = zip(clean, windows, strict=True)
                return [brightened(image, w.crop(geometry.shape_index), largest) for image, w in pairs]
            if error == "blurred":
                return [blurred(image, geometry, w.crop) for image, w in zip(clean, windows, strict=True)]
            return list(clean)

        return images

    names = available((), job)[0]
    arguments_of = (references, windows, job)
    floor = measure(None, *arguments_of, [name for name in names if QUALITIES[name].has_noise], Silence())
    print("error", *names, sep="\t")
    print("floor", *(score_text(name, floor[name]) if name in floor else "" for name in names), sep="\t")
    for error in ERRORS:
        values = measure(source(error), *arguments_of, names, Silence())
        print(error, *(score_text(name, values[name]) for name in names), sep="\t", flush=True)


if __name__ == "__main__":
    main()
