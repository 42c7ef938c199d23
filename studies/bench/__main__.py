"""Run the bench on the generated scenes and check the required ratios: `make bench`.

    python -m studies.bench [--scenes room atrium] [--size 320x180] [--frames 40] [--reference-spp 256]

Writes the small scenes, runs or continues the bench on each, prints missed requirements, and writes the
results of all scenes into studies/bench/results/, with machine and date.
"""

import argparse
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

from studies.bench.tables import ratio_text

HERE = Path(__file__).resolve().parent
PIXEL_M = 0.25 / 800.0  # pitch of the paper's screen, 640x480 on 25 cm: 28 pixels per degree at 0.5 m
BASELINE = "traced-256"
TIMES_TRACED = {"room": 30.0, "atrium": 15.0}  # times less CPU time than BASELINE, within 0.1 JND
TIMES_DENOISED = 3.0  # geometric mean over the measures, at equal quality; no measure below 1


def main() -> int:
    """Run the bench on each scene; the exit status is 1 where a requirement is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["room", "atrium"], choices=["room", "atrium"])
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--reference-spp", type=int, default=256)
    parser.add_argument("--out", type=Path, default=Path("runs/bench"))
    parser.add_argument("--keep", type=Path, default=HERE / "results", help="folder of the results")
    arguments, options = parser.parse_known_args()
    missing = []
    for scene in arguments.scenes:
        found = run(scene, arguments, options)
        arguments.keep.mkdir(parents=True, exist_ok=True)
        (arguments.keep / f"{scene}.json").write_text(json.dumps(found, indent=1) + "\n")
        missing += [f"{scene}: {text}" for text in missed(scene, found["ratios"])]
    print("\n".join(["", "Requirements missed:", *missing] if missing else ["", "All requirements are met."]))
    return 1 if missing else 0


def run(scene: str, arguments: argparse.Namespace, options: list[str]) -> dict[str, Any]:
    """Write a scene and run the bench on it, with further options of the command."""
    files, folder = arguments.out / "scenes" / scene, arguments.out / scene
    studies = [sys.executable, "-m", "studies"]
    write = [*studies, "scene", scene, "--preset", "small", "--size", arguments.size, "--out", files]
    subprocess.run([*map(str, write)], check=True, stdout=subprocess.DEVNULL)
    bench = [*studies, "bench", files / "scene.xml", "--path", files / "camera_path.json", "--out", folder]
    bench += ["--size", arguments.size, "--frames", f"11-{10 + arguments.frames}"]
    diagonal_m = math.hypot(*map(int, arguments.size.split("x"))) * PIXEL_M
    bench += [
        "--reference-spp",
        arguments.reference_spp,
        "--set",
        f"viewing.diagonal_m={diagonal_m}",
        *options,
    ]
    subprocess.run([*map(str, bench)], check=True)
    found: dict[str, Any] = json.loads((folder / "bench.json").read_text())
    return found


def missed(scene: str, ratios: dict[str, Any]) -> list[str]:
    """Messages about the requirements that the ratios of a bench miss."""
    found = []
    traced = ratios["traced"].get(BASELINE, {}).get("aqm")
    if traced is None or traced["kind"] == "at most" or traced["times"] < TIMES_TRACED[scene]:
        text = "none" if traced is None else ratio_text(traced)
        found.append(
            f"{TIMES_TRACED[scene]:g} times less CPU time than {BASELINE} within 0.1 JND; found {text}"
        )
    if denoised := ratios["denoised"]:
        if denoised["geometric_mean"] < TIMES_DENOISED or denoised["kind"] not in ("equal", "at least"):
            mean = ratio_text({"times": denoised["geometric_mean"], "kind": denoised["kind"]})
            found.append(f"{TIMES_DENOISED:g} times less CPU time than denoised; found {mean}")
        found += [
            f"no slower than denoised by any measure; by {name} {ratio_text(ratio)}"
            for name, ratio in denoised["by_measure"].items()
            if ratio["times"] < 1.0 or ratio["kind"] == "at most"
        ]
    else:
        found.append("no denoised baseline was rendered: pip install pyoidn")
    return found + [
        f"better than {name} at less cost" for name, better in ratios["paper"].items() if not better
    ]


if __name__ == "__main__":
    sys.exit(main())
