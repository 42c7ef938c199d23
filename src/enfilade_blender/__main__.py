# SPDX-License-Identifier: GPL-3.0-or-later
"""The program: ``python enfilade_blender JOB.json``, or ``blender --python __main__.py -- JOB.json``.

The package is loaded from its folder, without a folder on the path of modules: beside it may lie packages
for another Python, and Blender's scripts must not find modules of this program under their own names.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import traceback
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


def _load_package() -> None:
    sys.path = [entry for entry in sys.path if Path(entry).resolve() != FOLDER]
    spec = importlib.util.spec_from_file_location(
        "enfilade_blender", FOLDER / "__init__.py", submodule_search_locations=[str(FOLDER)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"{FOLDER} is incomplete")
    package = importlib.util.module_from_spec(spec)
    sys.modules["enfilade_blender"] = package
    spec.loader.exec_module(package)


if __name__ == "__main__":
    _load_package()
    from enfilade_blender.run import run_job

    code = 1
    try:
        code = run_job(Path(sys.argv[-1]))
    finally:
        if sys.exc_info()[1] is not None:
            traceback.print_exc()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)  # bpy may hang at its end
