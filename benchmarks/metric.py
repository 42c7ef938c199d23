"""Time and memory of the metric: `python benchmarks/metric.py [--repeats 5]`.

One table: CPU and wall time of a pair, of the first pair with the set-up, and the peak memory of the
process. Each row runs in a process of its own. All sizes have 27.93 px/deg; "sequence" adds motion vectors
and the change since the last frame.
"""

import argparse
import itertools
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

SIZES = ((640, 480), (1920, 1080), (3840, 2160))
MODES = ("paper", "modern")
CASES = ("still", "moving", "sequence")
KIB_PER_MIB = 1024


def measure(width: int, height: int, mode: str, case: str, repeats: int) -> dict[str, float]:
    """Compare one pair `repeats` times; the best time counts, since others use the machine too."""
    import numpy as np

    from enfilade.metric import Aqm, SequenceAqm
    from enfilade.viewing import Viewing

    rng = np.random.default_rng(1)
    reference = rng.uniform(5.0, 90.0, (height, width)).astype(np.float32)
    test = reference.copy()
    test[height // 4 : height // 2, width // 4 : width // 2] *= np.float32(0.8)
    maps = {}
    if case != "still":
        ramp = np.linspace(-20.0, 20.0, width, dtype=np.float32)
        maps["velocity"] = np.stack(np.broadcast_arrays(ramp, np.float32([[1.0]] * height)), -1)

    started = time.process_time()
    viewing = Viewing(640, 480).cropped(width, height)
    aqm = (Aqm.paper if mode == "paper" else Aqm.modern)(viewing)
    sequence = SequenceAqm(aqm)

    def pair() -> None:
        if case == "sequence":
            sequence.compare(
                test,
                reference,
                backward_flow_px=-maps["velocity"] * (viewing.pixels_per_degree / viewing.fps),
            )
        else:
            aqm.compare(test, reference, **maps)

    pair()
    first = time.process_time() - started
    times = []
    for _ in range(repeats):
        cpu, wall = time.process_time(), time.perf_counter()
        pair()
        times.append((time.process_time() - cpu, time.perf_counter() - wall))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "first_cpu_s": first,
        "cpu_s": min(cpu for cpu, _ in times),
        "wall_s": min(wall for _, wall in times),
        "peak_mib": peak / KIB_PER_MIB,
    }


def main() -> None:
    """Run every row in a process of its own and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--row", type=json.loads, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row is not None:
        print(json.dumps(measure(*options.row, options.repeats)))
        return
    print(
        f"{'size':>10}  {'mode':<7}  {'case':<16}  {'CPU s':>7}  {'wall s':>7}  {'first CPU s':>11}  peak MiB"
    )
    for width, height in SIZES:
        for mode, case in itertools.product(MODES, CASES):
            command = [sys.executable, str(Path(__file__).resolve())]
            command += ["--row", json.dumps([width, height, mode, case]), "--repeats", str(options.repeats)]
            output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            row = json.loads(output)
            print(
                f"{width}x{height:<5}".rjust(10)
                + f"  {mode:<7}  {case:<16}  {row['cpu_s']:7.3f}  {row['wall_s']:7.3f}"
                + f"  {row['first_cpu_s']:11.3f}  {row['peak_mib']:8.0f}"
            )


if __name__ == "__main__":
    main()
