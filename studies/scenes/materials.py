"""Materials of the generated scenes as Mitsuba BSDFs."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np
import numpy.typing as npt

Colour = str  # "#rrggbb", display colour in sRGB


def linear(colour: Colour) -> npt.NDArray[np.float64]:
    """Return the linear red, green and blue of a display colour `#rrggbb`."""
    encoded = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def rgb(name: str, values: npt.NDArray[np.float64]) -> ET.Element:
    """Return an `rgb` element of linear values."""
    return ET.Element("rgb", name=name, value=" ".join(f"{value:.6g}" for value in values))


def pigment(name: str, colour: Colour) -> ET.Element:
    """Return a colour property: `#rrggbb`, or the file name of a texture."""
    if colour.startswith("#"):
        return rgb(name, linear(colour))
    texture = ET.Element("texture", type="bitmap", name=name)
    ET.SubElement(texture, "string", name="filename", value=colour)
    return texture


@dataclass(frozen=True)
class Material:
    """A surface finish.

    Attributes
    ----------
    finish
        `matte`, `polished` (smooth coat over a pigment), `satin` (rough coat), `metal`,
        `mirror`, `pane` (thin glass), `glass` (solid) or `pbr` (Mitsuba's `principled`).
    colour
        `#rrggbb` or a texture's file name; the reflectance of metals and mirrors, the transmittance of glass.
    roughness
        Microfacet width of satin and metal; `roughness` of `pbr`.
    metallic, clearcoat
        Of `pbr`, 0 to 1.
    """

    finish: str
    colour: Colour = "#ffffff"
    roughness: float = 0.1
    metallic: float = 0.0
    clearcoat: float = 0.0

    def element(self) -> ET.Element:
        """Return the BSDF, two-sided unless it is transmissive."""
        match self.finish:
            case "matte":
                inner = self._bsdf("diffuse", "reflectance")
            case "polished":
                inner = self._bsdf("plastic", "diffuse_reflectance")
                ET.SubElement(inner, "boolean", name="nonlinear", value="true")
            case "satin":
                inner = self._bsdf("roughplastic", "diffuse_reflectance")
                ET.SubElement(inner, "float", name="alpha", value=repr(self.roughness))
            case "metal":
                inner = self._bsdf("roughconductor", "specular_reflectance")
                ET.SubElement(inner, "string", name="material", value="none")
                ET.SubElement(inner, "float", name="alpha", value=repr(self.roughness))
            case "mirror":
                inner = self._bsdf("conductor", "specular_reflectance")
                ET.SubElement(inner, "string", name="material", value="none")
            case "pane":
                return self._bsdf("thindielectric", "specular_transmittance")
            case "glass":
                return self._bsdf("dielectric", "specular_transmittance")
            case "pbr":
                inner = self._bsdf("principled", "base_color")
                for name in ("roughness", "metallic", "clearcoat"):
                    ET.SubElement(inner, "float", name=name, value=repr(getattr(self, name)))
            case _:
                raise ValueError(f"finish {self.finish!r} is not one of those of Material")
        outer = ET.Element("bsdf", type="twosided")
        outer.append(inner)
        return outer

    def _bsdf(self, kind: str, colour_name: str) -> ET.Element:
        """Create a BSDF with its colour."""
        element = ET.Element("bsdf", type=kind)
        element.append(pigment(colour_name, self.colour))
        return element
