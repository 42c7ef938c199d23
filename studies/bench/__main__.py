"""Run the bench on the generated scenes, or on a folder of scenes: `make bench`.

    python -m studies.bench [--quick] [--scene NAME ...] [--scenes FOLDER] [--sizes 320x180 1280x720]

Runs or continues the bench of each scene and size, prints the geometric means of the ratios by split, and
writes all results with date, machine and code as one JSON file, one page of tables and one of figures.
Further options go to `python -m studies bench`, such as --seeds, --reference-spp and --references.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from rich.table import Table

from enfilade.errors import EnfiladeError
from studies.bench.charts import plot_page
from studies.bench.measures import QUALITIES
from studies.bench.page import results_page
from studies.bench.suite import (
    GENERATED,
    LARGE_SCENES,
    QUICK,
    QUICK_SCENES,
    found_in,
    generated,
    is_large_size,
    run_case,
    summary,
)
from studies.bench.tables import print_table, ratio_text

FRAMES, MEASURED = 40, 8  # of a walkthrough; of them
REFERENCE_SPP, LARGE_REFERENCE_SPP = "512", "128"  # a window of a large image has 13 times as many pixels


def main() -> int:
    """Run the bench on each scene and size; the exit status is 1 where one fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--quick", action="store_true", help="two scenes, one size, few configurations")
    parser.add_argument(
        "--scene",
        nargs="+",
        choices=GENERATED,
        help="generated scenes; all by default, COURTYARD of large images",
    )
    parser.add_argument(
        "--scenes",
        type=Path,
        metavar="FOLDER",
        help="scenes of a folder; in place of the generated ones, or after those of --scene",
    )
    parser.add_argument("--sizes", nargs="+", default=None, help="320x180 1280x720 by default")
    parser.add_argument("--frames", type=int, default=FRAMES, help=f"of a walkthrough; {FRAMES} by default")
    parser.add_argument(
        "--measured",
        type=int,
        default=MEASURED,
        help=f"frames among them that are measured; {MEASURED} by default",
    )
    parser.add_argument("--out", type=Path, default=Path("runs/bench"))
    parser.add_argument(
        "--keep", type=Path, help="folder of the results; `results` in that of --out by default"
    )
    arguments, options = parser.parse_known_args()
    sizes = arguments.sizes or (["320x180"] if arguments.quick else ["320x180", "1280x720"])
    benches: list[dict[str, Any]] = []
    failed = []
    for size in sizes:
        is_large = is_large_size(size)
        names = QUICK_SCENES if arguments.quick else LARGE_SCENES if is_large else GENERATED
        try:
            chosen = arguments.scene or ([] if arguments.scenes else names)
            cases = generated(chosen, size, arguments.out / "scenes")
            cases += found_in(arguments.scenes) if arguments.scenes else []
        except EnfiladeError as error:
            parser.error(str(error))
        defaults = ["--reference-spp", LARGE_REFERENCE_SPP if is_large else REFERENCE_SPP]  # a later one wins
        is_chosen = any(option.startswith("--only") for option in options)
        only = QUICK if arguments.quick and not is_chosen else ()
        for case in cases:
            try:
                benches.append(
                    run_case(
                        case,
                        size,
                        arguments.frames,
                        arguments.measured,
                        only,
                        arguments.out,
                        [*defaults, *options],
                    )
                )
            except EnfiladeError as error:
                failed.append(str(error))
    if benches:
        keep(benches, arguments.keep or arguments.out / "results")
    print("\n".join(failed), file=sys.stderr)
    return 1 if failed else 0


def keep(benches: list[dict[str, Any]], folder: Path) -> None:
    """Write the results and the pages of figures and tables, named by their date; print the summary."""
    folder.mkdir(parents=True, exist_ok=True)
    means = summary(benches)
    file = folder / time.strftime("%Y-%m-%d-%H%M.json")
    file.write_text(json.dumps({"summary": means, "benches": benches}) + "\n")
    page = plot_page(benches, file.with_suffix(".png"))
    tables = file.with_suffix(".md")
    tables.write_text(results_page(benches, means, time.strftime("%Y-%m-%d")))
    measures = [name for name in QUALITIES if all(name in one["ratios"] for one in means)]
    table = Table(
        title="CPU time of the strongest baseline over ours, at equal quality: geometric means over scenes"
    )
    for heading in (
        "size",
        "split",
        "scenes",
        "configuration",
        *(QUALITIES[name].title for name in measures),
    ):
        table.add_column(heading)
    for one in means:
        cells = [ratio_text(one["ratios"][name]) for name in measures]
        table.add_row(one["size"], one["split"], str(len(one["scenes"])), one["configuration"], *cells)
    print_table(table)
    print(file, page, tables, sep="\n")


if __name__ == "__main__":
    sys.exit(main())
