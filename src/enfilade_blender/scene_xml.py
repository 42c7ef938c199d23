# SPDX-License-Identifier: GPL-3.0-or-later
"""Elements of Mitsuba's XML, from Python values."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

Element = ET.Element
RESERVED = str.maketrans("./$", "___")  # of ids: separators of paths, and the mark of a parameter
LAMP = "lamp"  # id of the BSDF of emitters that the camera does not see
HIDDEN = "hidden from the camera"  # beginning of ids of BSDFs of other surfaces that it does not see
Property = float | int | bool | str | tuple[float, float, float] | np.ndarray | Element


def plugin(tag: str, kind: str, *children: Element, **properties: Property) -> Element:
    """An element of a plugin, such as ``plugin("bsdf", "roughplastic", alpha=0.1)``.

    Parameters
    ----------
    tag, kind
        Tag of the element and name of the plugin.
    *children
        Nested elements without a name.
    **properties
        Three numbers are a colour, a 4x4 or 3x3 array is a transform, an element is nested with that name.

    Raises
    ------
    TypeError
        A property is of another type, such as a scalar of NumPy: its element would be a wrong one.
    """
    element = ET.Element(tag, type=kind)
    for name, value in properties.items():
        element.append(_property(name, value))
    element.extend(children)
    return element


def reference(identifier: str) -> Element:
    """A reference to a BSDF or shape group."""
    return ET.Element("ref", id=identifier)


def colour(values: Iterable[float], scale: float = 1.0) -> tuple[float, float, float] | Element:
    """A reflectance. Mitsuba refuses colours above 1, which make up for lost energy, but not as a texture."""
    r, g, b = (max(float(value) * scale, 0.0) for value in values)
    if max(r, g, b) <= 1.0:
        return r, g, b
    texture = ET.Element("texture", type="rawconstant")
    ET.SubElement(texture, "vector", name="value", x=_text(r), y=_text(g), z=_text(b))
    return texture


def named(element: Element, identifier: str) -> Element:
    """The element with an id that Mitsuba accepts."""
    element.set("id", identifier)
    return element


class Identifiers:
    """Ids of a scene: names without the characters that Mitsuba reserves, each used once."""

    def __init__(self) -> None:
        self._used = {LAMP: 1}  # the last number of each name

    def unique(self, name: str) -> str:
        """An id after a name."""
        plain = name.translate(RESERVED).strip() or "unnamed"
        candidate, number = plain, self._used.get(plain, 0)
        while candidate in self._used:
            number += 1
            candidate = f"{plain} {number}"
        self._used[plain] = max(number, 1)
        self._used.setdefault(candidate, 1)
        return candidate


def write_scene(file: Path, elements: Iterable[Element]) -> None:
    """Write ``scene.xml``."""
    root = ET.Element("scene", version="3.0.0")
    root.extend(elements)
    ET.indent(root)
    ET.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def _property(name: str, value: Property) -> Element:
    if isinstance(value, Element):
        value.set("name", name)
        return value
    if isinstance(value, np.ndarray):
        return _transform(name, value)
    if isinstance(value, bool):
        return ET.Element("boolean", name=name, value=str(value).lower())
    if isinstance(value, int):
        return ET.Element("integer", name=name, value=str(value))
    if isinstance(value, str):
        return ET.Element("string", name=name, value=value)
    if isinstance(value, tuple):
        return ET.Element("rgb", name=name, value=" ".join(_text(number) for number in value))
    if isinstance(value, float):
        return ET.Element("float", name=name, value=_text(value))
    raise TypeError(f"{name} is a {type(value).__name__}, for which Mitsuba's XML has no element")


def _transform(name: str, matrix: np.ndarray) -> Element:
    full = np.eye(4)
    if matrix.shape == (3, 3):  # of texture coordinates: its translation is the third column
        full[:2, :2], full[:2, 3] = matrix[:2, :2], matrix[:2, 2]
    else:
        full = matrix
    element = ET.Element("transform", name=name)
    ET.SubElement(element, "matrix", value=" ".join(_text(number) for number in full.ravel()))
    return element


def _text(number: float) -> str:
    return f"{float(number):.9g}"
