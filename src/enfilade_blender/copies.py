# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of objects: which become instances, and which are exported one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from enfilade_blender.materials.links import is_of_object, is_of_place
from enfilade_blender.materials.values import Shader
from enfilade_blender.records import Placed

FLAT_TRIANGLES = 8_000_000  # a scene of more has instances
INSTANCED_TRIANGLES = 500_000  # of all copies of a mesh that becomes instances
FEW_INSTANCES = 16  # that a renderer does not expand: rays take 20 % more time with them
FEW_COPIES = 64  # of an object that are baked one by one


def arranged(placed: Sequence[Placed], shader_of: Callable[[Any], Shader]) -> list[Placed]:
    """The objects as they are exported.

    Linked duplicates that are to be instances are copies of the first. Few copies whose material depends on
    their place in the world are objects of their own.

    Parameters
    ----------
    placed
    shader_of
        The shader of a material (bpy) or None.
    """
    linked = _linked(placed, triangle_count(placed), shader_of)
    return [one for item in linked for one in _apart(item, shader_of)]


def triangle_count(placed: Sequence[Placed]) -> int:
    """Triangles of all copies."""
    return sum(len(item.mesh) * len(item.matrices) for item in placed)


def is_instanced(placed: Placed, total: int) -> bool:
    """Whether an object's copies become instances, in a scene of a total of triangles."""
    copies = len(placed.matrices)
    return total > FLAT_TRIANGLES and copies > 1 and len(placed.mesh) * copies > INSTANCED_TRIANGLES


def _linked(placed: Sequence[Placed], total: int, shader_of: Callable[[Any], Shader]) -> list[Placed]:
    """Linked duplicates as copies of one; objects whose materials tell them apart stay as they are."""
    groups: dict[Any, list[Placed]] = {}
    for item in placed:
        key = id(item.mesh), item.slots, item.colour, item.index, item.is_seen, item.has_shadow
        groups.setdefault(key, []).append(item)
    result = []
    for items in groups.values():
        copies = [(item.name, matrix) for item in items for matrix in item.matrices]
        names, matrices = zip(*copies, strict=True)
        group = replace(items[0], matrices=list(matrices), names=names)
        are_many = len(matrices) > FEW_INSTANCES and is_instanced(group, total)
        is_alike = are_many and not any(is_of_object(shader_of(material)) for material in group.slots)
        result += [group] if is_alike else items
    return result


def _apart(placed: Placed, shader_of: Callable[[Any], Shader]) -> list[Placed]:
    """An object; its copies, if they are few, where a material depends on their place in the world."""
    copies = len(placed.matrices)
    if not 1 < copies <= FEW_COPIES or copies * len(placed.mesh) > INSTANCED_TRIANGLES:
        return [placed]
    if not any(is_of_place(shader_of(material)) for material in placed.slots):
        return [placed]
    return [replace(placed, matrices=[matrix]) for matrix in placed.matrices]
