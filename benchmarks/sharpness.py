"""Detail of the reference that each configuration of a bench preserves.

    python benchmarks/sharpness.py BENCH [--every 3]

BENCH is the folder of a `python -m studies bench`. By spatial frequency: the cross-spectrum of the encoded
luminance with that of the reference, over that of the configuration that was path traced with most paths.
Noise does not count, since it is not correlated; 1 is as sharp as path tracing. Configurations with another
pixel filter than the traced one are left out.
"""

import argparse
import itertools
import json
from pathlib import Path

import numpy as np

BANDS = (1 / 32, 1 / 16, 1 / 8, 3 / 16, 1 / 4, 3 / 8, 1 / 2)  # edges, cycles per pixel


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("bench", type=Path)
    parser.add_argument("--every", type=int, default=3, help="step between the frames that are measured")
    arguments = parser.parse_args()
    found = json.loads((arguments.bench / "bench.json").read_text())
    configurations = {c["name"]: c for c in found["configurations"]}
    traced = max((c for c in configurations.values() if c["family"] == "traced"), key=lambda c: c["spp"])
    bench, every, exposure_ev = arguments.bench, arguments.every, found["exposure_ev"]
    reference = spectra(bench / "references" / traced["pixel_filter"], every, exposure_ev)
    whole = shared(spectra(folder_of(bench, traced), every, exposure_ev), reference)
    edges = "".join(f"{low:>8.3f}-{high:.3f}" for low, high in itertools.pairwise(BANDS))
    print(f"{'cycles per pixel':<18}{edges}")
    for name, configuration in configurations.items():
        if configuration["pixel_filter"] != traced["pixel_filter"]:
            continue
        share = shared(spectra(folder_of(bench, configuration), every, exposure_ev), reference) / whole
        print(f"{name:<18}" + "".join(f"{value:>14.3f}" for value in share))


def folder_of(bench: Path, configuration: dict) -> Path:
    """Run folder of a configuration."""
    return bench / "configurations" / configuration["name"]


def frames_of(run: Path) -> list[Path]:
    """The frames of a run, in order."""
    return sorted((run / "frames").glob("*.exr"))


def radiance(file: Path) -> np.ndarray:
    """Linear colours of a frame, (H, W, 3)."""
    from enfilade.images import read_exr

    return read_exr(file)["RGB"].astype(np.float32)


def encoded(color: np.ndarray, exposure_ev: float) -> np.ndarray:
    """Colours as they are sent to a display."""
    from enfilade.kernels.tone import srgb_encode

    return srgb_encode(np.clip(color * np.float32(2.0**exposure_ev), 0.0, 1.0))


def spectra(folder: Path, every: int, exposure_ev: float) -> list[np.ndarray]:
    """Fourier transforms of the encoded luminance of some frames, windowed."""
    from enfilade.kernels.tone import luminance

    found = []
    for file in frames_of(folder)[::every]:
        image = luminance(encoded(radiance(file), exposure_ev))
        window = np.outer(np.hanning(image.shape[0]), np.hanning(image.shape[1]))
        found.append(np.fft.fft2((image - image.mean()) * window))
    return found


def shared(one: list[np.ndarray], other: list[np.ndarray]) -> np.ndarray:
    """Cross-spectrum of two sequences, by band of frequency."""
    cross = sum((a * np.conj(b)).real for a, b in zip(one, other, strict=True))
    rows, columns = (np.fft.fftfreq(size) for size in cross.shape)
    radius = np.hypot(rows[:, None], columns)
    return np.array([cross[(radius >= a) & (radius < b)].mean() for a, b in itertools.pairwise(BANDS)])


if __name__ == "__main__":
    main()
