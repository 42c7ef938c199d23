"""Run the paper's experiments again on the generated scenes: `make case-studies`.

    python -m studies.cases [--preset full|small] [--scenes room atrium] [--items placement ...]

Renders and measures what is not measured yet (interrupted, the same command goes on), and writes the figures
and tables into studies/cases/README.md, with the preset `small` into a copy of it beside the results.
"""

import argparse
import os
import sys
from pathlib import Path

from enfilade.cli.progress import watch
from enfilade.device import activate
from enfilade.errors import EnfiladeError, InputError

HERE = Path(__file__).resolve().parent
DOCUMENT = HERE / "README.md"


def main() -> int:
    """Measure, draw, write."""
    activate("cpu")
    from studies.cases.document import check_blocks, write_document
    from studies.cases.runner import ITEMS, SCENES, forecast_s, measure
    from studies.cases.terms import TERMS

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--preset", default="full", choices=list(TERMS))
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--items", nargs="+", default=list(ITEMS), choices=list(ITEMS))
    parser.add_argument("--out", type=Path, help="where results are kept; runs/case-studies/PRESET")
    parser.add_argument("--document", type=Path, help="where to write the document")
    arguments = parser.parse_args()
    folder = arguments.out or Path("runs/case-studies") / arguments.preset
    target = arguments.document or (DOCUMENT if arguments.preset == "full" else folder / DOCUMENT.name)

    cores = len(os.sched_getaffinity(0))
    minutes = forecast_s(arguments.scenes, arguments.items, TERMS[arguments.preset], cores) / 60.0
    print(f"{' and '.join(arguments.scenes)}: about {minutes:.0f} minutes on {cores} cores when begun anew;")
    print("interrupted, the same command goes on.", flush=True)
    try:
        check_blocks(DOCUMENT)
        with watch(quiet=False) as monitor:
            found = measure(arguments.scenes, arguments.items, TERMS[arguments.preset], folder, monitor)
        files = write_document(found, TERMS[arguments.preset], folder, DOCUMENT, target)
    except EnfiladeError as error:
        print(error, file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    print(*files, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
