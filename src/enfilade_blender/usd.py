# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports USD, with the frame rate, which Blender's importer leaves out."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy

from enfilade_blender.failure import ExportError


def import_usd(file: str) -> None:
    """Import a stage into the empty scene. Frames are its time codes, and meshes those for renders.

    Raises
    ------
    ExportError
        This Blender does not read the units or the frame rate of stages.
    """
    known = bpy.ops.wm.usd_import.get_rna_type().properties
    rate = _time_codes_per_second(file)
    if rate is not None and not rate > 0.0:
        raise ExportError(f"its timeCodesPerSecond is {rate:g}", file, "give it a positive number")
    if rate is None or "apply_unit_conversion_scale" not in known:
        version = bpy.app.version_string
        what = f"Blender {version} does not read the units and the frame rate of USD"
        raise ExportError(what, file, "use Blender 4.5 or newer, such as that of `make blender`")
    subdivision = "import_subdiv" if "import_subdiv" in known else "import_subdivision"  # from Blender 5 on
    bpy.ops.wm.usd_import(filepath=file, import_proxy=False, **{subdivision: True})
    render = bpy.context.scene.render
    render.fps = max(math.ceil(rate), 1)
    render.fps_base = render.fps / rate


def _time_codes_per_second(file: str) -> float | None:
    """Frame rate of a stage; None where USD's modules are missing."""
    # They lie beside those of Blender's own interpreter.
    for folder in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python3*/site-packages"):
        if str(folder) not in sys.path:
            sys.path.append(str(folder))
    try:
        from pxr import Usd
    except ImportError:
        return None
    return float(Usd.Stage.Open(file).GetTimeCodesPerSecond())
