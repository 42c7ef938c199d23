# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes files: ``python tests/blender/corpus FOLDER [NAME ...]``, in Blender's Python; ``--list`` names
them."""

import os
import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parents[1])

from corpus import (  # noqa: E402
    details,
    edges,
    flat,
    lights,
    objects,
    office,
    overlooked,
    pitfalls,
    production,
    surfaces,
)
from corpus.stage import save  # noqa: E402


def cases(module):
    """The functions of a module that make files, by name."""
    own = {name: of for name, of in vars(module).items() if getattr(of, "__module__", "") == module.__name__}
    return {name: of for name, of in own.items() if not name.startswith("_")}


CASES = cases(surfaces) | cases(lights) | cases(objects)
UNLISTED = {}  # by `--list`
for module in (details, edges, flat, office, overlooked, pitfalls, production):
    UNLISTED |= cases(module)

if __name__ == "__main__":
    if sys.argv[1] == "--list":
        sys.stdout.write(" ".join(CASES))
        sys.exit()
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or CASES:
        after = (CASES | UNLISTED)[name](folder)
        save(folder, name)
        if after is not None:
            after()
    sys.stdout.flush()
    os._exit(0)
