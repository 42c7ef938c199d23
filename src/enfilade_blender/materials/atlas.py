# SPDX-License-Identifier: GPL-3.0-or-later
"""BSDFs that differ in their baked textures alone become one: the textures are parts of an atlas.

Mitsuba's kernels become slower with every BSDF and texture of a scene, and meshes are merged by BSDF.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from enfilade_blender.image_files import F32
from enfilade_blender.materials.textures import Textures
from enfilade_blender.ply import map_uv
from enfilade_blender.scene_xml import HIDDEN, Element

LARGEST_PX = 4096  # side of an atlas
GUTTER_PX = 1  # around a texture, with its own outermost texels: lookups are bilinear


def share_bsdfs(
    bsdfs: Sequence[Element],
    shapes: Sequence[Element],
    baked: Iterable[str],
    textures: Textures,
    folder: Path,
) -> list[Element]:
    """Replace BSDFs that are equal, or differ in baked textures alone, by one; return those that are left.

    Shapes refer to it afterwards, and the texture coordinates in their files point into the atlas.

    Parameters
    ----------
    bsdfs, shapes
        Of the scene; the elements are changed.
    baked
        Ids of BSDFs all of whose textures cover the unit square of their shapes' coordinates.
    textures
    folder
        Of the scene.
    """
    users: dict[str, list[Element]] = {}
    for shape in (found for element in shapes for found in element.iter("shape")):
        if (reference := shape.find("ref")) is not None:
            users.setdefault(_id(reference), []).append(shape)
    glowing = {name for name, of in users.items() if any(s.find("emitter//texture") is not None for s in of)}
    packable = set(baked) - glowing
    groups: dict[tuple[bool, bool, str], list[Element]] = {}
    for bsdf in bsdfs:
        is_baked, is_hidden = _id(bsdf) in packable and bool(_files(bsdf)), _id(bsdf).startswith(HIDDEN)
        key = is_baked, is_hidden, _text_of(bsdf, with_files=not is_baked)
        groups.setdefault(key, []).append(bsdf)
    kept: list[Element] = []
    for (is_baked, *_), members in groups.items():
        is_packed = is_baked and len(members) > 1
        for sheet in _packed(members, users, textures, folder) if is_packed else [members]:
            kept.append(sheet[0])
            for shape in (shape for one in sheet for shape in users.get(_id(one), ())):
                for reference in shape.findall("ref"):
                    reference.set("id", _id(sheet[0]))
    return kept


def _id(element: Element) -> str:
    return element.get("id") or ""


def _text_of(bsdf: Element, *, with_files: bool) -> str:
    """A BSDF without its id, as text; without the names of its textures' files, if these are not to count."""
    anonymous = copy.deepcopy(bsdf)
    anonymous.attrib.pop("id", None)
    if not with_files:
        for file in _files(anonymous):
            file.set("value", "")
    return ET.tostring(anonymous, encoding="unicode")


def _files(element: Element) -> list[Element]:
    """Names of the files of an element, in its order: textures of a BSDF, the mesh of a shape."""
    return [file for file in element.iter("string") if file.get("name") == "filename"]


def _name(file: Element) -> str:
    return file.get("value") or ""


def _packed(
    members: list[Element], users: dict[str, list[Element]], textures: Textures, folder: Path
) -> list[list[Element]]:
    """Pack the textures of BSDFs into atlases; the BSDFs that share each, of which the first one has it."""
    sizes = [{textures.size(_name(file)) for file in _files(bsdf)} for bsdf in members]
    sheets = [[bsdf] for bsdf, found in zip(members, sizes, strict=True) if len(found) > 1]
    members = [bsdf for bsdf, found in zip(members, sizes, strict=True) if len(found) == 1]
    sides = [side for found in sizes if len(found) == 1 for side, _ in found]
    if not sides:
        return sheets
    for numbers, corners, size in _layouts([side + 2 * GUTTER_PX for side in sides]):
        sheet = [members[number] for number in numbers]
        for files in zip(*map(_files, sheet), strict=True):  # of one texture of the BSDF
            raw = _is_raw(sheet[0], files[0])
            images = [textures.stored(_name(file), raw=raw) for file in files]
            stem = Path(_name(files[0])).stem
            is_exact = any(_name(file).endswith(".exr") for file in files)
            atlas = _atlas(images, corners, size)
            files[0].set("value", textures.write(f"{stem} atlas", atlas, raw=raw, is_exact=is_exact))
        for number, (row, column) in zip(numbers, corners, strict=True):
            side, (height, width) = sides[number], size
            scale = side / width, side / height
            low = (column + GUTTER_PX) / width, 1.0 - (row + GUTTER_PX + side) / height  # v points up
            for shape in users.get(_id(members[number]), ()):
                map_uv(folder / _name(_files(shape)[0]), scale, low)
        sheets.append(sheet)
    return sheets


def _is_raw(bsdf: Element, file: Element) -> bool:
    """Whether the texture of a file has linear values."""
    texture = next(texture for texture in bsdf.iter("texture") if file in texture)
    return any(flag.get("name") == "raw" and flag.get("value") == "true" for flag in texture)


def _layouts(sides: Sequence[int]) -> list[tuple[list[int], list[tuple[int, int]], tuple[int, int]]]:
    """Squares on shelves: for each atlas their numbers, corners (row, column), and its height and width.

    The largest squares come first, so that those of a shelf are of nearly the same size.
    """
    order = sorted(range(len(sides)), key=lambda number: (-sides[number], number))
    largest, area = max(sides), sum(side * side for side in sides)
    width = largest * max(min(math.ceil(math.sqrt(area) / largest), LARGEST_PX // largest), 1)
    atlases: list[tuple[list[int], list[tuple[int, int]], tuple[int, int]]] = []
    numbers: list[int] = []
    corners: list[tuple[int, int]] = []
    row = column = shelf = 0
    for number in order:
        if column + sides[number] > width:
            row, column, shelf = row + shelf, 0, 0
        if row + sides[number] > max(LARGEST_PX, largest):
            atlases.append((numbers, corners, (row, width)))
            numbers, corners, row, column = [], [], 0, 0
        shelf = max(shelf, sides[number])
        numbers.append(number)
        corners.append((row, column))
        column += sides[number]
    return [*atlases, (numbers, corners, (row + shelf, width))]


def _atlas(images: Sequence[F32], corners: Sequence[tuple[int, int]], size: tuple[int, int]) -> F32:
    """Images at their corners, each with its gutter, (H, W, channels)."""
    atlas = np.zeros((*size, images[0].shape[-1]), np.float32)
    for image, (row, column) in zip(images, corners, strict=True):
        framed = np.pad(image, ((GUTTER_PX, GUTTER_PX), (GUTTER_PX, GUTTER_PX), (0, 0)), mode="edge")
        atlas[row : row + framed.shape[0], column : column + framed.shape[1]] = framed
    return atlas
