"""Reproduce the paper's experiments on the generated scenes: `make case-studies`.

    python -m studies.cases [--preset full|small] [--scenes room atrium] [--items placement ...]

Measures all items that are not measured yet, and writes figures and tables into studies/cases/README.md
(preset `small`: into a copy of it beside the results). After an interruption the same command continues.
"""

import argparse
import sys
from pathlib import Path

from enfilade.cli.progress import watch
from enfilade.device import activate
from enfilade.errors import EnfiladeError, InputError
from studies.cases import SCENES

DOCUMENT = Path(__file__).resolve().parent / "README.md"


def main() -> int:
    """Measure the items and write the document."""
    activate("cpu")
    from studies.cases.document import check_blocks, write_document
    from studies.cases.extent import EXTENTS
    from studies.cases.runner import ITEMS, measure

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--preset", default="full", choices=list(EXTENTS))
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--items", nargs="+", default=list(ITEMS), choices=list(ITEMS))
    parser.add_argument("--out", type=Path, help="folder of the results; runs/case-studies/PRESET")
    parser.add_argument("--document", type=Path, help="the document to write")
    arguments = parser.parse_args()
    folder = arguments.out or Path("runs/case-studies") / arguments.preset
    target = arguments.document or (DOCUMENT if arguments.preset == "full" else folder / DOCUMENT.name)
    extent = EXTENTS[arguments.preset]
    try:
        check_blocks(DOCUMENT)
        with watch(quiet=False) as monitor:
            results = measure(arguments.scenes, arguments.items, extent, folder, monitor)
        files = write_document(results, extent, folder, DOCUMENT, target)
    except EnfiladeError as error:
        print(error, file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    print(*files, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
