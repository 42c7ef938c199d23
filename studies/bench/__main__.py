"""Hold the bench on the generated scenes, and fail where an asked ratio is missed: `make bench`.

    python -m studies.bench [--scenes room atrium] [--size 320x180] [--frames 40] [--reference-spp 256]

Writes the small scenes, runs the bench on each (or goes on with it), prints what is asked and what was
found, and keeps the figures of all scenes in studies/bench/results/, with machine and date.
"""

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PIXEL_M = 0.25 / 800.0  # of the paper's screen, 640x480 on 25 cm: 28 a degree from half a metre
RIVAL = "traced-256"
ASKED_OF_TRACED = {"room": 30.0}  # times less CPU time than 256 paths a pixel on every frame, within 0.1 JND
ASKED_OF_TRACED_ELSEWHERE = 15.0
ASKED_OF_DENOISED = 3.0  # geometric mean over the judges, at equal quality; by no judge slower
OTHERS_SPP = 450  # paths a pixel of all contestants that trace every frame, roughly
CPU_S_PER_PATH = 4e-6  # on one of two busy hyperthreads
SIGNS = {"equal": "", "at least": "at least ", "at most": "at most ", None: "by bounds both ways "}
KEPT = (
    "date",
    "machine",
    "versions",
    "scene",
    "size",
    "fps",
    "frames",
    "pixels_per_degree",
    "exposure_ev",
    "reference",
    "judges",
)


def main() -> int:
    """Hold the bench on each scene; the exit status is 1 where anything asked is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["room", "atrium"], choices=["room", "atrium"])
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--reference-spp", type=int, default=256)
    parser.add_argument("--out", type=Path, default=Path("runs/bench"))
    parser.add_argument("--keep", type=Path, default=HERE / "results", help="where the figures are kept")
    arguments = parser.parse_args()
    print(forecast(arguments), flush=True)
    missed = []
    for scene in arguments.scenes:
        found = hold(scene, arguments)
        keep(found, arguments.keep / f"{scene}.json")
        missed += [f"{scene}: {text}" for text in judge(scene, found)]
    print("\n".join(["", "Missed:", *missed] if missed else ["", "All that is asked is met."]))
    return 1 if missed else 0


def forecast(arguments: argparse.Namespace) -> str:
    """Say how long it takes, roughly."""
    width, height = size_of(arguments)
    paths = width * height * arguments.frames * (2 * arguments.reference_spp + OTHERS_SPP)
    cores = len(os.sched_getaffinity(0))
    hours = len(arguments.scenes) * paths * CPU_S_PER_PATH / cores / 3600.0
    many = f"{len(arguments.scenes)} scenes of {arguments.frames} frames"
    return (
        f"{many}: about {hours:.1f} hours on {cores} cores "
        "when begun anew, most of it for the references; interrupted, the same command goes on."
    )


def size_of(arguments: argparse.Namespace) -> tuple[int, int]:
    """Width and height, pixels."""
    width, height = arguments.size.split("x")
    return int(width), int(height)


def hold(scene: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """Write a scene and run the bench on it."""
    files, folder = arguments.out / "scenes" / scene, arguments.out / scene
    studies = [sys.executable, "-m", "studies"]
    write = [*studies, "scene", scene, "--preset", "small", "--size", arguments.size, "--out", files]
    subprocess.run([*map(str, write)], check=True, stdout=subprocess.DEVNULL)
    run = [*studies, "bench", files / "scene.xml", "--path", files / "camera_path.json", "--out", folder]
    run += ["--size", arguments.size, "--frames", f"11-{10 + arguments.frames}"]
    diagonal_m = math.hypot(*size_of(arguments)) * PIXEL_M
    run += ["--reference-spp", arguments.reference_spp, "--viewing-diagonal-m", diagonal_m]
    subprocess.run([*map(str, run)], check=True)
    kept: dict[str, Any] = json.loads((folder / "bench.json").read_text())
    return kept


def judge(scene: str, found: dict[str, Any]) -> list[str]:
    """What is asked and missed, in words."""
    verdict, missed = found["verdict"], []
    asked = ASKED_OF_TRACED.get(scene, ASKED_OF_TRACED_ELSEWHERE)
    traced = verdict["traced"].get(RIVAL, {}).get("aqm")
    if traced is None or traced["kind"] == "at most" or traced["times"] < asked:
        missed.append(f"{asked:g} times less CPU time than {RIVAL} within 0.1 JND; found {_text(traced)}")
    denoised = verdict["denoised"]
    if not denoised:
        missed.append("no denoised rival took part: pip install 'enfilade[denoise]'")
    else:
        mean = denoised["geometric_mean"]
        if mean < ASKED_OF_DENOISED or denoised["kind"] not in ("equal", "at least"):
            sign = SIGNS[denoised["kind"]]
            missed.append(f"{ASKED_OF_DENOISED:g} times less CPU time than denoised; found {sign}{mean:.2f}")
        missed += [
            f"no slower than denoised by any judge; by {name} {_text(ratio)}"
            for name, ratio in denoised["by_judge"].items()
            if ratio["times"] < 1.0 or ratio["kind"] == "at most"
        ]
    missed += [f"better than {name} at less cost" for name, ours in verdict["paper"].items() if not ours]
    return missed


def keep(found: dict[str, Any], file: Path) -> None:
    """Keep the figures without those of each frame."""
    rows = [{key: value for key, value in row.items() if key != "per_frame"} for row in found["contestants"]]
    kept = {key: found[key] for key in KEPT} | {"contestants": rows, "verdict": found["verdict"]}
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(kept, indent=1) + "\n")


def _text(ratio: dict[str, Any] | None) -> str:
    if ratio is None:
        return "none"
    return f"{SIGNS[ratio['kind']]}{ratio['times']:.2f} (least {ratio['least']:.2f})"


if __name__ == "__main__":
    sys.exit(main())
