# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes what has no counterpart in Mitsuba: Cycles evaluates a node's output over the mesh, into a texture.

A value of images and colour corrections alone is baked once over the unit square of the images' coordinates.
Any other is baked for each object, over texture coordinates that are made for it; then all textures of the
material are, since a mesh has one set of coordinates in Mitsuba.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enfilade_blender.image_files import F32
from enfilade_blender.job import Job
from enfilade_blender.materials.bake_scene import BakeKind, BakeScene
from enfilade_blender.materials.image_pixels import fault, is_missing
from enfilade_blender.materials.links import depends_on_place, is_of_view, upstream
from enfilade_blender.materials.stand_ins import IMAGES
from enfilade_blender.materials.table import OBJECT_DATA, OBJECT_EFFECT
from enfilade_blender.materials.textures import Textures
from enfilade_blender.materials.values import (
    Add,
    AttributeValue,
    Bump,
    Constant,
    ImageValue,
    Lobe,
    Mix,
    NormalMap,
    Output,
    Principled,
    Procedural,
    ProceduralNormal,
    Shader,
    Texture,
    Value,
    normals_of,
    replaced,
    values_of,
)
from enfilade_blender.notes import Notes
from enfilade_blender.ply import Mesh
from enfilade_blender.records import Placed, Selection, View

BAKED_UV = "enfilade"
SMALLEST = 64  # pixels
PER_PIXEL = 2.0  # texels along an object for each pixel of its largest view
UNIFORM = 2e-3  # standard deviation below which a texture is a constant
UNIFORM_EXACT = 1e-6  # the same of heights: 0.001 of them may be a steep millimetre
CONSTANT_PX = 8
SEEN_COPIES = 10_000  # of a mesh whose sizes in the views are compared
FLAT = (0.5, 0.5, 1.0)  # a texel of a normal map
BORDER = 1e-4  # of an image, that coordinates may pass
UV_MAPS = 8  # that a mesh of Blender can have


class Bakery:
    """Bakes procedural values.

    Parameters
    ----------
    job, selection, views, textures, notes
    """

    def __init__(
        self, job: Job, selection: Selection, views: list[View], textures: Textures, notes: Notes
    ) -> None:
        self._job, self._selection, self._views = job, selection, views
        self._textures, self._notes = textures, notes
        self._of_uv: dict[Any, Value] = {}
        self._scene: BakeScene | None = None

    def resolve(
        self, shader: Shader, material: Any, mesh: Mesh, placed: Placed, copies: list[np.ndarray]
    ) -> tuple[Shader, Mesh, bool]:
        """A shader without procedural values, its mesh, and whether it is the mesh's own.

        `copies` are the matrices of all objects that share the result.
        """
        read = {v.name or mesh.active_colour for v in values_of(shader) if isinstance(v, AttributeValue)}
        shader = replaced(shader, lambda value: _of_mesh(value, mesh, has_several=len(read) > 1))
        self._note_lost(shader, material, mesh, placed)
        wanted = [value for value in values_of(shader) if isinstance(value, Procedural | ProceduralNormal)]
        read_maps = [uv_map for value in values_of(shader) for uv_map in _uv_maps(value)]
        uv_maps = {uv_map or mesh.active_uv for uv_map in [*read_maps, *_tangents(shader)]}
        if not wanted and len(uv_maps) <= 1:
            return shader, mesh, False
        if len(uv_maps) <= 1 and all(isinstance(v, Procedural) and v.uv_map is not None for v in wanted):
            return replaced(shader, lambda value: self._over_uv(value, material)), mesh, False
        side = self._resolution(copies, mesh)
        shader = self._with_baked_normals(shader)
        mesh = _with_room(mesh, shader)
        with self._stage().mesh(mesh, placed) as canvas:
            mesh = replace(mesh, uvs={**mesh.uvs, BAKED_UV: canvas.unwrap()}, active_uv=BAKED_UV)
            own = replaced(shader, lambda value: self._over_mesh(value, material, canvas, placed, side))
        return own, mesh, True

    def _stage(self) -> BakeScene:
        if self._scene is None:
            self._scene = BakeScene(self._job.bake_samples, self._selection.frames[0])
        return self._scene

    def _over_uv(self, value: Any, material: Any) -> Any:
        if not isinstance(value, Procedural) or value.uv_map is None:
            return value
        groups = tuple(group.as_pointer() for group in value.output.groups)
        key = value.output.socket.as_pointer(), groups, value.is_number, value.is_exact
        if key not in self._of_uv:
            sizes = [max(image.size) for image in _images(value.output)]
            wanted = max([CONSTANT_PX, *sizes])
            with self._stage().square(value.uv_map, value.matrix) as canvas:
                pixels, _ = canvas.bake(value.output, material, self._limited(wanted), _kind(value))
            stored = self._stored(pixels, None, value, material.name, value.uv_map, wanted)
            if isinstance(stored, Texture):
                stored = replace(stored, matrix=value.matrix)
            self._of_uv[key] = stored
        return self._of_uv[key]

    def _over_mesh(self, value: Any, material: Any, canvas: Any, placed: Placed, wanted: int) -> Any:
        if isinstance(value, Constant | AttributeValue | Texture):
            return value
        is_lost = isinstance(value, ImageValue) and self._textures.is_missing(value)
        if is_lost or (isinstance(value, Procedural) and _is_missing(value.output.node)):
            return Constant((0.5, 0.5, 0.5))
        pixels, covered = canvas.bake(value.output, material, self._limited(wanted), _kind(value))
        if isinstance(value, ProceduralNormal):
            pixels = np.where(covered[..., None], np.clip(pixels, 0.0, 1.0), FLAT)
            file = self._textures.write(
                f"{placed.name} normal", pixels.astype(np.float32), raw=True, is_exact=True
            )
            name = f"{material.name}, {placed.name}"
            self._note(value.output, name, wanted)
            if is_of_view(value.output):
                self._note_view(value.output, name)
            return NormalMap(Texture(file, BAKED_UV, FLAT, raw=True), 1.0, value.output)
        return self._stored(pixels, covered, value, f"{material.name}, {placed.name}", BAKED_UV, wanted)

    def _with_baked_normals(self, shader: Shader) -> Shader:
        """The shader whose normal maps are to be baked: an image's tangents are those of its own UV map.

        Heights of images are interpolated by the bake, and stored with all digits.
        """
        if isinstance(shader, Mix | Add):
            first, second = (self._with_baked_normals(part) for part in (shader.first, shader.second))
            return replace(shader, first=first, second=second)
        if not isinstance(shader, Principled | Lobe) or not isinstance(shader.normal, NormalMap | Bump):
            return shader
        normal, image = shader.normal, shader.normal.image
        if isinstance(image, ImageValue) and self._textures.is_missing(image):
            return shader
        if isinstance(normal, NormalMap) or normal.strength < 1.0:
            return replace(shader, normal=ProceduralNormal(normal.output))
        if isinstance(image, ImageValue):
            heights = Procedural(image.output, is_number=True, is_exact=True)
            return replace(shader, normal=replace(normal, image=heights))
        return shader

    def _note_lost(self, shader: Shader, material: Any, mesh: Mesh, placed: Placed) -> None:
        """Note what a bake on a copy of the object, or the object's file, lacks."""
        for value in values_of(shader):
            if not isinstance(value, Procedural | ProceduralNormal | AttributeValue):
                continue
            for found in upstream(value.output):
                what = _lost(found, mesh, placed)
                if what:
                    self._notes.add("approximated", material.name, found.node.name, what, OBJECT_EFFECT)

    def _stored(
        self, pixels: F32, covered: Any, value: Procedural | ImageValue, name: str, uv_map: str, wanted: int
    ) -> Value:
        """A baked value: a constant where it is uniform, else a file; texels off the mesh are its mean."""
        output = value.output
        is_exact = value.is_exact if isinstance(value, Procedural) else value.image.is_float
        if isinstance(value, Procedural) and value.is_of_view:
            self._note_view(output, name)
        inside = pixels[covered] if covered is not None and covered.any() else pixels.reshape(-1, 3)
        mean = inside.mean(axis=0)
        colour = (float(mean[0]), float(mean[1]), float(mean[2]))
        if inside.std(axis=0).max() <= (UNIFORM_EXACT if is_exact else UNIFORM) * max(1.0, float(mean.max())):
            return Constant(colour)
        if covered is not None:
            pixels = np.where(covered[..., None], pixels, mean)
        is_data = output.socket.type != "RGBA" or bool(pixels.max() > 1.0)
        pixels = pixels if is_exact else np.maximum(pixels, 0.0)
        file = self._textures.write(f"{name} {output.node.name}", pixels, raw=is_data, is_exact=is_exact)
        self._note(output, name, wanted)
        return Texture(file, uv_map, colour, raw=is_data or file.endswith(".exr"))

    def _limited(self, wanted: int) -> int:
        return min(wanted, self._job.bake_px)

    def _note(self, output: Output, name: str, wanted: int) -> None:
        node, size = f"{output.node.name}: {output.socket.name}", self._limited(wanted)
        what, effect = f"baked to {size}x{size} pixels", "detail is limited to its pixels"
        if size < wanted:
            effect = f"it is blurred: {wanted} are needed, and blender.bake_px is {size}"
        self._notes.add("baked", name, node, what, effect)

    def _note_view(self, output: Output, name: str) -> None:
        effect = "the surface looks the same from all directions"
        self._notes.add("approximated", name, output.node.name, "it depends on the view", effect)

    def _resolution(self, copies: list[np.ndarray], mesh: Mesh) -> int:
        """Side of a baked texture, a power of two, by the largest size of a mesh's copies in the views."""
        if not self._views:
            return self._job.bake_px
        bounds = np.stack([mesh.positions.min(axis=0), mesh.positions.max(axis=0)])
        matrices = np.array(copies[:: max(len(copies) // SEEN_COPIES, 1)])
        ends = bounds @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]
        centres, radii = ends.mean(axis=1), 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)
        nearest = 0.0
        for view in self._views[:: max(len(self._views) // 64, 1)]:
            distances = np.linalg.norm(view.pose[:3, 3] - centres, axis=-1) - radii
            distances = np.maximum(np.maximum(distances, 0.25 * radii), 1e-6)
            focal = 0.5 * view.projection[1, 1] * self._selection.size[1]
            nearest = max(nearest, float((2.0 * radii / distances * focal).max()))
        return 2 ** int(np.ceil(np.log2(max(nearest * PER_PIXEL, SMALLEST))))


def _kind(value: Any) -> BakeKind:
    """What is baked of a value."""
    if isinstance(value, ProceduralNormal):
        return "normal"
    return "number" if isinstance(value, Procedural) and value.is_number else "colour"


def _of_mesh(value: Any, mesh: Mesh, *, has_several: bool) -> Any:
    """A value of a mesh: attributes that are UV maps rather than a colour, or several, are baked.

    So are images of the extension Clip whose border lies on the mesh: Mitsuba has no such texture.
    """
    if isinstance(value, ImageValue) and value.node.extension == "CLIP":
        uv, matrix = mesh.uvs.get(value.uv_map or mesh.active_uv, np.zeros(2)), np.array(value.matrix)
        place = uv @ matrix[:2, :2].T + matrix[:2, 2]
        is_beyond = np.abs(place - 0.5).max(initial=0.0) > 0.5 + BORDER
        return Procedural(value.output) if is_beyond else value
    if not isinstance(value, AttributeValue):
        return value
    is_uv = value.name in mesh.uvs and value.name not in mesh.colours
    return Procedural(value.output) if is_uv or has_several else value


def _lost(found: Output, mesh: Mesh, placed: Placed) -> str:
    """What is approximated of an output that depends on the object; empty for others."""
    node, name = found.node, found.socket.name
    if _is_missing(node):
        is_sequence = node.image is not None and node.image.source == "SEQUENCE"
        what = "the first frame of its image sequence" if is_sequence else "its image"
        return f"{what} {fault(node.image)}, and is taken as a mid grey"
    if getattr(node, "from_instancer", False):
        return "its coordinates of the instancer are taken as 0"
    if node.type == "OBJECT_INFO" and name == "Random":
        return "its Random is another number than in Cycles, the same for all copies"
    if node.type == "NEW_GEOMETRY" and name == "Random Per Island":
        return "its Random Per Island are other numbers than in Cycles"
    if len(placed.matrices) > 1 and depends_on_place(found):
        return (
            f"of {len(placed.matrices)} copies of {placed.name} the first one's place in the world is taken"
        )
    if node.type == "ATTRIBUTE" and node.attribute_type != "GEOMETRY":
        return f"the property {node.attribute_name} is taken as 0"
    attribute = {"ATTRIBUTE": "attribute_name", "VERTEX_COLOR": "layer_name"}.get(node.type)
    layer = getattr(node, attribute) if attribute else ""
    if layer and layer not in mesh.uvs and layer not in mesh.colours:
        return f"the mesh has no attribute {layer} of vertices, corners or faces; it is taken as 0"
    return OBJECT_DATA.get(node.type, "")


def _is_missing(node: Any) -> bool:
    """Whether a node is an image without pixels."""
    return node.type in IMAGES and is_missing(node.image, node.image_user)


def _with_room(mesh: Mesh, shader: Shader) -> Mesh:
    """The mesh with one of Blender's UV maps free; the active one and those that are read are kept."""
    if len(mesh.uvs) < UV_MAPS:
        return mesh
    outputs = [value.output for value in values_of(shader) if not isinstance(value, Constant | Texture)]
    nodes = [found.node for output in outputs for found in upstream(output)]
    read = {getattr(node, name, "") for node in nodes for name in ("uv_map", "attribute_name")}
    first = sorted(mesh.uvs, key=lambda name: (name != mesh.active_uv, name not in read))
    return replace(mesh, uvs={name: mesh.uvs[name] for name in first[: UV_MAPS - 1]})


def _images(output: Output) -> list[Any]:
    """Images that an output depends on."""
    nodes = [found.node for found in upstream(output) if found.node.type == "TEX_IMAGE"]
    return [node.image for node in nodes if node.image is not None]


def _uv_maps(value: Any) -> list[str]:
    """UV map that a value looks images up by; empty for other values."""
    if isinstance(value, ImageValue):
        return [value.uv_map]
    is_of_uv = isinstance(value, Procedural) and value.uv_map is not None and _images(value.output)
    return [value.uv_map] if is_of_uv else []


def _tangents(shader: Shader) -> list[str]:
    """UV maps along which normal maps are turned; in Mitsuba they are those of the images."""
    return [normal.output.node.uv_map for normal in normals_of(shader) if isinstance(normal, NormalMap)]
