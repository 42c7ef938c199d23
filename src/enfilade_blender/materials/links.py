# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows the links of node trees, and tells what an output depends on.

Groups, reroutes and muted nodes are seen through.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from enfilade_blender.materials import mapping, table
from enfilade_blender.materials.values import (
    IDENTITY,
    Matrix3,
    Output,
    Procedural,
    ProceduralNormal,
    Shader,
    values_of,
)

PLAIN_SPACES = ("sRGB", "Non-Color", "Linear Rec.709", "Raw", "Linear")
PLAIN_SOURCES = ("FILE", "GENERATED")


def follow(socket: Any, groups: tuple[Any, ...]) -> Any:
    """The output that feeds an input, as :class:`Output`; without one, the socket whose default holds."""
    while True:
        links = (
            [link for link in socket.links if link.is_valid and not link.is_muted] if socket.is_linked else []
        )
        if not links:
            return socket
        source = links[0].from_socket
        node = source.node
        if node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.mute:
            inner = [link.from_socket for link in node.internal_links if link.to_socket == source]
            if not inner:
                return socket
            socket = inner[0]
        elif node.type == "GROUP" and node.node_tree is not None:
            ends = [n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT"]
            end = next((n for n in ends if n.is_active_output), ends[0] if ends else None)
            if end is None:
                return source
            socket, groups = _by_identifier(end.inputs, source), (*groups, node)
        elif node.type == "GROUP_INPUT" and groups:
            socket, groups = _by_identifier(groups[-1].inputs, source), groups[:-1]
        else:
            return Output(source, groups)


def image_coordinates(node: Any, groups: tuple[Any, ...]) -> tuple[str, Matrix3] | None:
    """UV map and affine map of an image texture, or None where a bitmap can't look it up so."""
    image = node.image
    if image is None:
        return "", IDENTITY
    is_plain = (
        node.projection == "FLAT"
        and _is_unmapped(node.texture_mapping)
        and image.source in PLAIN_SOURCES
        and image.colorspace_settings.name in PLAIN_SPACES
    )
    return uv_coordinates(node.inputs["Vector"], groups) if is_plain else None


def _is_unmapped(own: Any) -> bool:
    """Whether an image node's own mapping, which Blender shows no more, leaves coordinates as they are."""
    numbers = (*own.translation, *own.rotation, *own.scale)
    axes = own.mapping_x + own.mapping_y + own.mapping_z
    return numbers == (0, 0, 0, 0, 0, 0, 1, 1, 1) and axes == "XYZ" and not (own.use_min or own.use_max)


def uv_coordinates(socket: Any, groups: tuple[Any, ...]) -> tuple[str, Matrix3] | None:
    """UV map and affine map of coordinates, or None where they are not of a UV map."""
    found = follow(socket, groups)
    if not isinstance(found, Output):
        return "", IDENTITY
    node = found.node
    if node.type == "UVMAP" and not node.from_instancer:
        return node.uv_map, IDENTITY
    if node.type == "TEX_COORD" and found.socket.name == "UV" and not node.from_instancer:
        return "", IDENTITY
    if node.type != "MAPPING" or node.vector_type == "NORMAL" or not node.inputs["Vector"].is_linked:
        return None
    inner = uv_coordinates(node.inputs["Vector"], found.groups)
    location, rotation, scale = (_constant_vector(node.inputs[i], found.groups) for i in (1, 2, 3))
    if node.vector_type == "VECTOR":
        location = (0.0, 0.0, 0.0)
    if inner is None or location is None or rotation is None or scale is None:
        return None
    own = mapping.uv_matrix(node.vector_type, location, rotation, scale)
    return inner[0], mapping.product(own, inner[1])


def _constant_vector(socket: Any, groups: tuple[Any, ...]) -> tuple[float, float, float] | None:
    """A finite vector that is the same everywhere, of numbers, vectors and colours; None of any other."""
    numbers = _constant_numbers(socket, groups)
    if len(numbers) == 1:
        numbers *= 3
    return numbers if len(numbers) == 3 and all(map(math.isfinite, numbers)) else None


def _constant_numbers(socket: Any, groups: tuple[Any, ...]) -> tuple[float, ...]:
    """One number, or three of a vector or colour; none where it is no constant."""
    found = follow(socket, groups)
    if isinstance(found, Output) and found.node.type == "COMBXYZ":
        parts = [_constant_numbers(part, found.groups) for part in found.node.inputs]
        return tuple(part[0] for part in parts if len(part) == 1)
    if isinstance(found, Output) and found.node.type not in ("RGB", "VALUE"):
        return ()
    value = (found.socket if isinstance(found, Output) else found).default_value
    return (float(value),) if isinstance(value, int | float) else tuple(value)[:3]


def upstream(output: Output, *, below_images: bool = True) -> Iterator[Output]:
    """An output and all outputs that it depends on, those of the coordinates of images included."""
    seen: set[Any] = set()
    waiting = [output]
    while waiting:
        current = waiting.pop()
        key = current.socket.as_pointer(), tuple(group.as_pointer() for group in current.groups)
        if key in seen:
            continue
        seen.add(key)
        yield current
        if current.node.type == "TEX_IMAGE" and not below_images:
            continue
        for socket in current.node.inputs:
            found = follow(socket, current.groups) if socket.enabled else socket
            if isinstance(found, Output):
                waiting.append(found)


def is_of_place(shader: Shader) -> bool:
    """Whether a baked value or normal of a shader depends on where in the world a copy of its object is."""
    return any(depends_on_place(found) for found in _read(shader))


def is_of_object(shader: Shader) -> bool:
    """Whether a baked value or normal of a shader differs between objects of one mesh."""
    return any(depends_on_place(found) or found.node.type == "OBJECT_INFO" for found in _read(shader))


def _read(shader: Shader) -> Iterator[Output]:
    """Outputs that the baked values and normals of a shader depend on."""
    for value in values_of(shader):
        if isinstance(value, Procedural | ProceduralNormal):
            yield from upstream(value.output)


def depends_on_place(found: Output) -> bool:
    """Whether an output is in the space of the world, or of another object."""
    node, name = found.node, found.socket.name
    if node.type == "TEX_COORD":
        return name == "Object" and node.object is not None
    if node.type == "VECT_TRANSFORM":
        return "WORLD" in (node.convert_from, node.convert_to) and node.convert_from != node.convert_to
    if node.type == "NORMAL_MAP":
        return node.space in ("WORLD", "BLENDER_WORLD")
    return name in table.PLACE_SOCKETS.get(node.type, ())


def is_of_view(output: Output) -> bool:
    """Whether an output depends on the direction of view, the camera or the kind of ray."""
    return any(
        found.node.type in table.VIEW_NODES
        or "CAMERA" in (getattr(found.node, end, "") for end in ("convert_from", "convert_to"))
        or found.socket.name in table.VIEW_SOCKETS.get(found.node.type, ())
        or getattr(found.node, "use_pixel_size", False)
        for found in upstream(output)
    )


def dependence(output: Output) -> tuple[str | None, Matrix3, bool]:
    """UV map of which alone an output is a function, or None; its matrix; whether it depends on the view."""
    is_of_uv, places = True, set()
    for found in upstream(output, below_images=False):
        node = found.node
        if node.type == "TEX_IMAGE":
            coordinates = image_coordinates(node, found.groups)
            is_of_uv &= coordinates is not None and node.extension == "REPEAT"
            places.add(coordinates or ("", IDENTITY))
        else:
            is_of_uv &= node.type in table.COLOUR_NODES
    uv_map, matrix = next(iter(places), ("", IDENTITY))
    is_of_uv &= len(places) <= 1 and mapping.is_invertible(matrix)
    return (uv_map if is_of_uv else None), matrix, is_of_view(output)


def _by_identifier(sockets: Any, like: Any) -> Any:
    return next(socket for socket in sockets if socket.identifier == like.identifier)
