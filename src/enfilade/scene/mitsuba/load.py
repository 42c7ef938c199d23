"""Loading of a Mitsuba scene."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from enfilade.errors import SceneError
from enfilade.resource_limits import is_out_of_memory
from enfilade.scene.mitsuba.files import fingerprint, reason


def load_scene(file: Path) -> Any:
    """Load a scene of at least one shape and one emitter.

    Its shapes are those of the file. Symbolic links are followed first: Mitsuba looks for files beside the
    XML file. Scenes that nothing refers to are freed first: until then, Dr.Jit compiles their materials into
    every kernel.

    Raises
    ------
    SceneError
        The file is missing, malformed, or refused by Mitsuba; or a file that it names can't be read, or is an
        image with values that are not finite.
    MemoryError
    """
    gc.collect()
    threads = dr.thread_count()
    if threads == 1:  # Mitsuba waits for the tasks that read an OpenEXR file without running any of them
        dr.set_thread_count(2)
    try:
        scene = mi.load_file(str(file.resolve()), parallel=False, optimize=False)
    except (RuntimeError, UnicodeDecodeError) as error:
        if is_out_of_memory(str(error)):
            raise MemoryError(f"too little memory to load {file}") from error
        fingerprint(file)  # raises with the cause if a file is missing or can't be read
        raise SceneError(f"Mitsuba can't load {file}: {reason(error)}") from error
    finally:
        if threads == 1:
            dr.set_thread_count(1)
    if not isinstance(scene, mi.Scene):
        raise SceneError(f"{file} holds a {type(scene).__name__}, not a scene")
    if not scene.shapes():
        raise SceneError(f"{file} has no shapes: there is nothing to render")
    if empty := [s.id() for s in scene.shapes() if isinstance(s, mi.Mesh) and not s.face_count()]:
        raise SceneError(f"{file}: the mesh {empty[0]} has no triangles: leave it out")
    if not scene.emitters():
        raise SceneError(
            f"{file} has no light, every frame would be black: add an <emitter>; or, in Blender, a lamp or a "
            "world with light, and import it again"
        )
    parameters = mi.traverse(scene)
    for name in parameters.keys():  # noqa: SIM118  (values are fetched one by one: some can't be)
        if name.endswith(".data"):  # of bitmaps, environment maps and grids
            _check_finite(file, name.removesuffix(".data"), np.asarray(parameters[name]))
    return scene


def _check_finite(file: Path, name: str, values: Any) -> None:
    """Refuse an image with values that are NaN or infinite: paths that meet them would be left out."""
    is_bad = ~np.isfinite(values)
    if is_bad.any():
        row, column = np.argwhere(is_bad)[0][:2]
        height, width = values.shape[:2]
        owner = "" if name.startswith("object_") else f" of {name}"  # Mitsuba's names of what has none
        raise SceneError(
            f"{file}: an image{owner} has {is_bad.sum()} values that are NaN or infinite, first in row "
            f"{row}, column {column} of {width}x{height}; mend it"
        )
