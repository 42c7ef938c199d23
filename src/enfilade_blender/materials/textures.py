# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of materials as numbers, colours and textures of Mitsuba; copies of image files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from enfilade_blender.image_files import F32, srgb_from_linear, write_exr, write_png
from enfilade_blender.materials.image_pixels import (
    RAW_SPACES,
    fault,
    image_colours,
    is_as_stored,
    is_missing,
    linear_pixels,
)
from enfilade_blender.materials.table import CHANNELS
from enfilade_blender.materials.values import (
    LUMINANCE,
    AttributeValue,
    Constant,
    ImageValue,
    Texture,
    Value,
)
from enfilade_blender.notes import Notes
from enfilade_blender.scene_xml import Element, Identifiers, colour, plugin

READABLE = (".png", ".jpg", ".jpeg", ".exr", ".hdr")
LINEAR = (".exr", ".hdr")  # of these, which Mitsuba does not decode
JPEG = b"\xff\xd8\xff"
SIGNATURES = {b"\x89PNG": ".png", JPEG: ".jpg", b"\x76\x2f\x31\x01": ".exr", b"#?": ".hdr"}  # first bytes
CMYK_DEPTH = 32  # bits of a pixel of a JPEG file, which Mitsuba reads with 8 and 24
WRAP = {"REPEAT": "repeat", "EXTEND": "clamp", "CLIP": "clamp", "MIRROR": "mirror"}
FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])  # Mitsuba's first row is at v = 0
MISSING = (0.5, 0.5, 0.5)  # of a missing image
ENVIRONMENT = "environment"  # name of the file of the world
LONGEST_STEM = 120  # bytes of a file's name, to which a number and an ending are added


class Textures:
    """Texture files of a scene.

    Parameters
    ----------
    folder : Path
        Of the scene; files go into its folder ``textures``.
    notes
    """

    def __init__(self, folder: Path, notes: Notes) -> None:
        self._folder, self._notes = folder, notes
        self._names = Identifiers()
        self._names.unique(ENVIRONMENT)
        self._files: dict[Any, str] = {}
        (folder / "textures").mkdir(exist_ok=True)

    def __len__(self) -> int:
        return len(list((self._folder / "textures").iterdir()))

    def colour(self, value: Value) -> tuple[float, float, float] | Element:
        """A reflectance or a texture."""
        if isinstance(value, Constant):
            return colour(value.colour)
        return self._texture(value)

    def scaled(self, value: Value, scale: float) -> tuple[float, float, float] | Element:
        """A colour times a number, which may pass 1."""
        if isinstance(value, Constant):
            return colour(value.colour, scale)
        if abs(scale - 1.0) < 0.01:
            return self._texture(value)
        return self._mapped(value, lambda pixels: pixels * scale, f"times {scale:.3g}")

    def lightened(self, value: Value, white: float) -> tuple[float, float, float] | Element:
        """A colour below a share of white."""
        if isinstance(value, Constant):
            return colour([white + (1.0 - white) * c for c in value.colour])
        return self._mapped(value, lambda pixels: white + (1.0 - white) * pixels, f"below {white:.3g}")

    def root(self, value: Value) -> Constant | Element:
        """The square root of a colour."""
        if isinstance(value, Constant):
            return Constant(tuple(max(c, 0.0) ** 0.5 for c in value.colour))
        return self._mapped(value, lambda pixels: np.sqrt(np.maximum(pixels, 0.0)), "root")

    def _mapped(self, value: Value, change: Callable[[F32], F32], name: str) -> Element:
        """A texture of changed colours; the value's own where it has no pixels."""
        if not self.has_pixels(value):
            return self._texture(value)
        return self.rewritten(value, change(self.pixels(value)), name, raw=False)

    def number(self, value: Value) -> float | Element:
        """A number or a texture of numbers."""
        if isinstance(value, Constant):
            return value.number
        return self._texture(value)

    def scaled_number(self, value: Value, scale: float) -> float | Element:
        """A number times another."""
        if isinstance(value, Constant):
            return value.number * scale
        if not self.has_pixels(value):
            return 0.5 * scale
        return self.rewritten(value, self.numbers(value) * scale, f"grey times {scale:.3g}")

    def mean(self, value: Value) -> tuple[float, float, float]:
        """Mean linear colour of a value; mid grey of a missing image or an attribute."""
        if isinstance(value, Constant):
            return value.colour
        if isinstance(value, Texture):
            return value.mean
        if self.has_pixels(value):
            mean = self.pixels(value).reshape(-1, 3).mean(axis=0)
            return float(mean[0]), float(mean[1]), float(mean[2])
        return MISSING

    def pixels(self, value: ImageValue | Texture) -> F32:
        """Linear values of a texture (H, W, 3), the first row on top."""
        if isinstance(value, Texture):
            return self.stored(value.file, raw=value.raw)
        if value.output.socket.name == "Alpha":
            return np.repeat(linear_pixels(value.image)[..., 3:], 3, axis=-1)
        channel = CHANNELS.get(value.output.socket.name)
        colours = image_colours(value.node)
        return colours if channel is None else np.repeat(colours[..., channel, None], 3, axis=-1)

    def numbers(self, value: ImageValue | Texture) -> F32:
        """Numbers of a texture (H, W, 1), the luminance of its colours."""
        numbers: F32 = (self.pixels(value) @ np.array(LUMINANCE, np.float32))[..., None]
        return numbers

    def stored(self, file: str, *, raw: bool) -> F32:
        """Linear values of a file of the scene, (H, W, 3), the first row on top."""
        image = self._image(file)
        image.colorspace_settings.name = "Non-Color" if raw else "sRGB"
        return linear_pixels(image)[..., :3]

    def size(self, file: str) -> tuple[int, int]:
        """Width and height of a file of the scene."""
        width, height = self._image(file).size
        return width, height

    def _image(self, file: str) -> Any:
        import bpy

        return bpy.data.images.load(str(self._folder / file), check_existing=True)

    def has_pixels(self, value: Value) -> TypeGuard[ImageValue | Texture]:
        """Whether numbers can be computed of a value's; that a mid grey is in their place is noted."""
        if isinstance(value, AttributeValue):
            what = "a colour attribute is taken as a mid grey, where numbers are computed of its own"
            node = value.output.node.name
            self._notes.add("approximated", value.material, node, what, "its pattern is missing")
        return isinstance(value, Texture) or (isinstance(value, ImageValue) and not self.is_missing(value))

    def is_missing(self, value: ImageValue) -> bool:
        """Whether an image has no pixels; this is noted."""
        image = value.image
        if not is_missing(image):
            return False
        name = image.name if image is not None else "none"
        file = image.filepath if image is not None else ""
        what = f"the image {name} ({file}) {fault(image)}" if image is not None else "there is no image"
        self._notes.add("approximated", name, value.node.name, what, "a mid grey is in its place")
        return True

    def write(self, name: str, image: F32, *, raw: bool, is_exact: bool = False) -> str:
        """Write an image as PNG, or as OpenEXR if exact or with values above 1; its name in the scene.

        Without `raw` the values of a PNG are sRGB, as Mitsuba expects.
        """
        if is_exact or image.max(initial=0.0) > 1.0:
            file = f"textures/{self._names.unique(file_stem(name))}.exr"
            write_exr(self._folder / file, np.broadcast_to(image, (*image.shape[:2], 3)).astype(np.float32))
        else:
            file = f"textures/{self._names.unique(file_stem(name))}.png"
            write_png(self._folder / file, image if raw else srgb_from_linear(image))
        return file

    def rewritten(
        self,
        value: ImageValue | Texture,
        image: F32,
        name: str,
        *,
        raw: bool = True,
        is_exact: bool = False,
    ) -> Element:
        """A texture in the place of another, of other numbers (H, W, 1 or 3); colours are not `raw`.

        It is exact if the other one is, too.
        """
        key = (value.file,) if isinstance(value, Texture) else _key(value)
        key = *key, name
        if key not in self._files:
            stem = Path(key[0]).stem
            is_float = value.file.endswith(".exr") if isinstance(value, Texture) else value.image.is_float
            is_exact = is_exact or is_float
            image = image.astype(np.float32)
            self._files[key] = self.write(f"{stem} {name}", image, raw=raw, is_exact=is_exact)
        raw = raw or self._files[key].endswith(".exr")
        return self._bitmap(value, self._files[key], raw=raw)

    def remove_unused(self, elements: list[Element]) -> None:
        """Delete files that no element names: baked textures of which only others were made."""
        named = {string.get("value") for element in elements for string in element.iter("string")}
        for file in (self._folder / "textures").iterdir():
            if f"textures/{file.name}" not in named:
                file.unlink()

    def _texture(self, value: Value) -> Element:
        if isinstance(value, Texture):
            return self._bitmap(value, value.file, raw=value.raw)
        if isinstance(value, AttributeValue):
            return plugin("texture", "mesh_attribute", name="vertex_color")
        if not isinstance(value, ImageValue):
            raise TypeError("procedural values are baked before they are written")
        if self.is_missing(value):
            return plugin("texture", "srgb", color=MISSING)
        file, raw = self._file(value)
        return self._bitmap(value, file, raw=raw)

    def _bitmap(self, value: ImageValue | Texture, file: str, *, raw: bool) -> Element:
        """A file of a value's numbers, or of others, looked up as the value is."""
        if isinstance(value, Texture):
            return bitmap(file, raw=raw, wrap="repeat", matrix=FLIP @ np.array(value.matrix))
        node = value.node
        matrix = FLIP @ np.array(value.matrix)
        smooth = node.interpolation != "Closest"
        return bitmap(file, raw=raw, wrap=WRAP.get(node.extension, "repeat"), matrix=matrix, smooth=smooth)

    def _file(self, value: ImageValue) -> tuple[str, bool]:
        """Name of a value's file, and whether its numbers are linear."""
        image, socket = value.image, value.output.socket.name
        raw = socket != "Color" or image.colorspace_settings.name in RAW_SPACES
        key = _key(value)
        if key not in self._files:
            name = Path(image.name).stem or "image"
            if socket != "Color":
                is_exact, numbers = image.is_float, self.pixels(value)[..., :1]
                file = self.write(f"{name} {socket.lower()}", numbers, raw=True, is_exact=is_exact)
            else:
                file = self._copied(image, name) if is_as_stored(value.node) else ""
                file = file or self.write(name, self.pixels(value), raw=raw, is_exact=image.is_float)
            self._files[key] = file
        return self._files[key], raw

    def _copied(self, image: Any, name: str) -> str:
        """Name of an unchanged copy of an image's file or packed bytes; empty where Mitsuba can't read it."""
        import bpy

        source = Path(bpy.path.abspath(image.filepath, library=image.library))
        if image.source != "FILE" or image.is_dirty:
            return ""
        if image.packed_file is not None:
            data = image.packed_file.data
        elif source.is_file():
            data = source.read_bytes()
        else:
            return ""
        # Images within a .glb have no name of a file.
        kind = next((SIGNATURES[start] for start in SIGNATURES if data.startswith(start)), "")
        suffix = source.suffix.lower() or kind
        is_encoded = suffix in LINEAR and image.colorspace_settings.name not in RAW_SPACES
        is_cmyk = kind == SIGNATURES[JPEG] and image.depth == CMYK_DEPTH
        if not kind or suffix not in READABLE or is_encoded or is_cmyk:
            return ""
        file = f"textures/{self._names.unique(file_stem(name))}{suffix}"
        (self._folder / file).write_bytes(data)
        return file


def bitmap(file: str, *, raw: bool, wrap: str, matrix: np.ndarray, smooth: bool = True) -> Element:
    """A bitmap texture; `matrix` (3, 3) maps texture coordinates with v up to Mitsuba's."""
    filter_type = "bilinear" if smooth else "nearest"
    return plugin(
        "texture", "bitmap", filename=file, raw=raw, wrap_mode=wrap, filter_type=filter_type, to_uv=matrix
    )


def file_stem(name: str) -> str:
    """A name of a file without its ending: letters and digits of any script, spaces, - and _."""
    plain = "".join(c if c.isalnum() or c in " -_" else "_" for c in name)
    return plain.encode()[:LONGEST_STEM].decode(errors="ignore")


def _key(value: ImageValue) -> tuple[Any, ...]:
    """What the numbers of a value depend on."""
    outputs = value.node.outputs
    return value.image.name_full, value.output.socket.name, outputs["Alpha"].is_linked
