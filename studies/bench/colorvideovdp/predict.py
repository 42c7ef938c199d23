"""ColorVideoVDP of pairs of sequences, for the environment of `setup.sh`; imports nothing of enfilade.

predict.py PAIRS.npz     arrays `test` and `reference` (K, F, H, W, 3), sRGB-encoded 0..1; `fps`, `ppd`,
                         `peak_cd_m2`, `contrast`. Prints a JSON list of K scores, JOD.
predict.py --version     prints the versions
"""

import json
import sys
from importlib.metadata import version

import numpy as np
import pycvvdp
import torch


def main() -> None:
    """Print the scores of the pairs, or the versions."""
    torch.set_num_threads(1)
    if sys.argv[1] == "--version":
        print(f"ColorVideoVDP {version('cvvdp')}, PyTorch {torch.__version__}")
        return
    with np.load(sys.argv[1]) as given:
        arrays = {name: given[name] for name in given.files}
    height, width = arrays["test"].shape[2:4]
    screen = pycvvdp.vvdp_display_photo_eotf(
        float(arrays["peak_cd_m2"]), contrast=float(arrays["contrast"]), EOTF="sRGB", E_ambient=0
    )
    place = pycvvdp.vvdp_display_geometry([width, height], ppd=float(arrays["ppd"]))
    metric = pycvvdp.cvvdp(
        display_photometry=screen,
        display_geometry=place,
        heatmap=None,
        device=torch.device("cpu"),
        quiet=True,
    )
    scores = []
    with torch.no_grad():
        for test, reference in zip(arrays["test"], arrays["reference"], strict=True):
            rate = float(arrays["fps"]) if len(test) > 1 else 0.0  # of a single image
            pair = (test.astype(np.float32), reference.astype(np.float32))
            scores.append(float(metric.predict(*pair, dim_order="FHWC", frames_per_second=rate)[0]))
    print(json.dumps(scores))


main()
