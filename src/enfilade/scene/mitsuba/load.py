"""Loading of a Mitsuba scene."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from enfilade.arrays import lanes
from enfilade.device import active
from enfilade.errors import SceneError
from enfilade.resource_limits import is_out_of_memory
from enfilade.scene.mitsuba.bsdfs import classes
from enfilade.scene.mitsuba.files import OWN, files_beside, fingerprint, reason
from enfilade.scene.mitsuba.shapes import has_meaning

SCALE_TOLERANCE = 1e-4  # of the columns of a transform that does not scale
FLAT = 1e-6  # of the largest element: what is left of a column that depends on the others
# Emitters whose light Mitsuba 3.9.1 changes with the scale of their transform: directions get its length.
SCALED_EMITTERS = ("directional", "envmap", "projector", "sunsky")
SHEAR = 1e-4  # of UV maps below bump maps: V rises by a ten-thousandth of U


def load_scene(file: Path) -> Any:
    """Load a scene of at least one shape and one emitter.

    Its shapes are those of the file. Symbolic links are followed first: Mitsuba looks for files beside the
    XML file. Scenes that nothing refers to are freed first: until then, Dr.Jit compiles their materials into
    every kernel.

    Raises
    ------
    SceneError
        The file is missing, malformed, or refused by Mitsuba; or a file that it names can't be read, or is an
        image with values that are not finite; or a mesh has no triangles, or a shape no normals.
    MemoryError
    """
    gc.collect()
    threads = dr.thread_count()
    if threads == 1:  # Mitsuba waits for the tasks that read an OpenEXR file without running any of them
        dr.set_thread_count(2)
    try:
        scene = _instantiated(file)
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
    _check_content(file, scene)
    _shear_bump_maps(scene)
    if not scene.emitters():
        raise SceneError(
            f"{file} has no light, every frame would be black: add an <emitter>; or, in Blender, a lamp or a "
            "world with light, and import it again"
        )
    return scene


def _instantiated(file: Path) -> Any:
    """The object of a scene file; equal materials and textures are made once, however often they are written.

    Where the id of a BSDF has a meaning they are not: Mitsuba ignores ids when it compares.
    """
    config = mi.parser.ParserConfig(active().variant)
    config.parallel = config.merge_meshes = False
    with files_beside(file):
        state = mi.parser.parse_file(config, str(file.resolve()))
        config.merge_equivalent = not any(has_meaning(node.props.id()) for node in state.nodes)
        for node in state.nodes:
            _unscale(state, node)
        mi.parser.transform_all(config, state)
        return mi.parser.instantiate(config, state)


def _check_content(file: Path, scene: Any) -> None:
    """Check the meshes and images of a scene."""
    parameters = mi.traverse(scene)
    for node in parameters.hierarchy:
        if isinstance(node, mi.Mesh):
            _check_mesh(file, node)
    for name in parameters.keys():  # noqa: SIM118  (values are fetched one by one: some can't be)
        if name.endswith(".data"):  # of bitmaps, environment maps and grids
            _check_finite(file, name.removesuffix(".data"), np.asarray(parameters[name]))


def _check_mesh(file: Path, mesh: Any) -> None:
    """Refuse a mesh without triangles, and give vertices without a normal that of the triangles around them.

    Mitsuba's normals are NaN there: the triangles around would have no light at all.
    """
    if not mesh.face_count():
        raise SceneError(f"{file}: the mesh {mesh.id()} has no triangles: leave it out")
    if not mesh.has_vertex_normals():
        return
    normals = np.array(mesh.vertex_normals_buffer()).reshape(-1, 3)
    is_bad = ~(np.isfinite(normals).all(axis=1) & normals.any(axis=1))
    if not is_bad.any():
        return
    parameters = mi.traverse(mesh)
    if "vertex_normals" not in parameters:  # of a rectangle
        raise SceneError(
            f"{file}: the to_world of the shape {mesh.id()} leaves it no normals: does it scale by zero?"
        )

    _warn(
        f"{is_bad.sum()} of {len(normals)} vertices of the mesh {mesh.id()} have no normal, and get that "
        "of the triangles around them"
    )

    # Add up the normals of the triangles, weighted by their area.
    positions = np.array(mesh.vertex_positions_buffer()).reshape(-1, 3).astype(np.float64)
    triangles = np.array(mesh.faces_buffer()).reshape(-1, 3)
    first, second, third = positions[triangles].transpose(1, 0, 2)
    around = np.zeros_like(positions)
    for corner in triangles.T:
        np.add.at(around, corner, np.cross(second - first, third - first))
    length = np.linalg.norm(around, axis=1, keepdims=True)
    around = np.where(length > 0.0, around / np.maximum(length, np.finfo(np.float64).tiny), (0.0, 0.0, 1.0))
    parameters["vertex_normals"] = lanes(
        np.where(is_bad[:, None], around, normals).astype(np.float32).ravel()
    )
    parameters.update()


def _check_finite(file: Path, name: str, values: Any) -> None:
    """Refuse an image with values that are NaN or infinite: paths that meet them would be left out."""
    is_bad = ~np.isfinite(values)
    if is_bad.any():
        row, column = np.argwhere(is_bad)[0][-3:-1]  # of a slice, if it is a volume
        height, width = values.shape[-3:-1]
        owner = "" if name.startswith("object_") else f" of {name}"  # Mitsuba's names of what has none
        raise SceneError(
            f"{file}: an image{owner} has {is_bad.sum()} values that are NaN or infinite, first in row "
            f"{row}, column {column} of {width}x{height}; mend it"
        )


def _unscale(state: Any, node: Any) -> None:
    """Take scale and shear out of the transform of an emitter whose light they would change, and say so.

    The third column, along which lamps shine, keeps its direction.
    """
    properties = node.props
    if properties.plugin_name() not in SCALED_EMITTERS or "to_world" not in properties:
        return
    transform = properties["to_world"]
    matrix = np.array(transform.matrix, np.float64).reshape(4, 4)
    # Orthogonalize the columns, beginning with the third, by which the factor R has its signs.
    reordered = matrix[:3, 2::-1]
    q, r = np.linalg.qr(reordered)
    signs = np.where(np.diag(r) < 0.0, -1.0, 1.0)
    rotation = (q * signs)[:, ::-1]
    if np.allclose(matrix[:3, :3], rotation, rtol=0.0, atol=SCALE_TOLERANCE):
        return
    emitter = f"the {properties.plugin_name()} emitter {properties.id()}".rstrip()
    where = mi.parser.file_location(state, node)
    if np.abs(np.diag(r)).min() <= FLAT * np.abs(matrix[:3, :3]).max():
        raise SceneError(f"{where}: the to_world of {emitter} scales by zero")
    matrix[:3, :3] = rotation
    properties["to_world"] = type(transform)(matrix)
    _warn(
        f"{where}: the to_world of {emitter} has a scale, which would change its light: it is taken without "
        "the scale"
    )


def _warn(text: str) -> None:
    untyped: Any = mi  # its stubs lack the logger
    untyped.Log(mi.LogLevel.Warn, f"{OWN}{text}")


def _shear_bump_maps(scene: Any) -> None:
    """Shear the UV maps of meshes with bump maps, by less than can be seen.

    Where the height is constant and the U axis is parallel to the z axis of the world, Mitsuba 3.9.1
    evaluates the BSDF to NaN: it makes a tangent in the world orthogonal to a normal in the shading frame.
    """
    for mesh in mi.traverse(scene).hierarchy:
        if not isinstance(mesh, mi.Mesh) or "BumpMap" not in classes(mesh.bsdf()):
            continue
        parameters = mi.traverse(mesh)
        if "vertex_texcoords" in parameters:
            uv = np.array(parameters["vertex_texcoords"]).reshape(-1, 2)
            uv[:, 1] += SHEAR * uv[:, 0]
            parameters["vertex_texcoords"] = lanes(uv.ravel())
            parameters.update()
        elif "to_world" in parameters:  # of a rectangle
            x, y, z = np.abs(np.array(parameters["to_world"].matrix, np.float32).reshape(4, 4)[:3, 0])
            if max(x, y) < SHEAR * z:
                _warn(f"the rectangle {mesh.id()} loses light where its bump map is flat: write it as a mesh")
