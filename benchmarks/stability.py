"""Popping and flicker of each configuration of a bench: broad errors, and their change over time.

    python benchmarks/stability.py BENCH [--block 8]

BENCH is the folder of a `python -m studies bench`. Encoded colours less those of the reference with the same
pixel filter, averaged over blocks of pixels, which removes grain: as RMS, and as RMS of the change from one
frame to the next, for the median and the worst frame. Popping at a keyframe is a worst frame far above the
median. The mean is that of linear radiance over all pixels and frames, over the reference's.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from sharpness import encoded, folder_of, frames_of, radiance


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("bench", type=Path)
    parser.add_argument("--block", type=int, default=8, help="width of a block, pixels")
    arguments = parser.parse_args()
    found = json.loads((arguments.bench / "bench.json").read_text())
    print(f"{'':<18}{'error':>10}{'change':>10}{'worst':>10}{'in frame':>10}{'mean':>10}")
    for configuration in found["configurations"]:
        references = frames_of(arguments.bench / "references" / configuration["pixel_filter"])
        files = frames_of(folder_of(arguments.bench, configuration))
        error, change, mean = broad_errors(files, references, arguments.block, found["exposure_ev"])
        worst = int(change.argmax())
        numbers = f"{error:>10.4f}{np.median(change):>10.4f}{change[worst]:>10.4f}"
        print(f"{configuration['name']:<18}{numbers}{files[worst + 1].stem:>10}{mean:>10.4f}")


def broad_errors(
    files: list[Path], references: list[Path], block: int, exposure_ev: float
) -> tuple[float, np.ndarray, float]:
    """RMS over all frames, RMS of the change from each frame to the next, and the ratio of the means."""
    errors, sums = [], np.zeros(2)
    for file, reference in zip(files, references, strict=True):
        one, other = radiance(file), radiance(reference)
        errors.append(averaged(encoded(one, exposure_ev) - encoded(other, exposure_ev), block))
        sums += one.mean(), other.mean()
    difference = np.array(errors)
    change = np.sqrt((np.diff(difference, axis=0) ** 2).mean(axis=(1, 2, 3)))
    return float(np.sqrt((difference**2).mean())), change, float(sums[0] / sums[1])


def averaged(image: np.ndarray, block: int) -> np.ndarray:
    """Means of square blocks; incomplete ones at the right and at the bottom are left out."""
    rows, columns = (size // block for size in image.shape[:2])
    whole = image[: rows * block, : columns * block]
    return whole.reshape(rows, block, columns, block, 3).mean(axis=(1, 3))


if __name__ == "__main__":
    main()
