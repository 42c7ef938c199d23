"""Write a scene in Mitsuba 3's XML: shapes, materials, textures and emitters beside one file."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import numpy.typing as npt
from PIL import Image

from studies.scenes.materials import Colour, Material, linear, rgb
from studies.scenes.shading import shaded_vertices
from studies.scenes.solids import Floats, Mesh, Vector

SCENE_VERSION = "3.0.0"
FACE = np.dtype([("count", "u1"), ("corners", "<i4", (3,))])


class SceneWriter:
    """Collects a scene and writes it below one folder.

    Materials and meshes are written once under a name, to which shapes refer. File names in the XML
    are relative to the scene file.

    Parameters
    ----------
    folder
        Receives `scene.xml`, `meshes/` and `textures/`; created if absent.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.root = ET.Element("scene", version=SCENE_VERSION)
        self._materials: list[ET.Element] = []
        self._shapes: list[ET.Element] = []
        self._emitters: list[ET.Element] = []
        self._stored: set[str] = set()
        for part in ("meshes", "textures"):
            (folder / part).mkdir(parents=True, exist_ok=True)

    def texture(self, name: str, image: npt.NDArray[np.uint8]) -> str:
        """Store an sRGB image, (height, width, 3), top row first, and return its relative name.

        Mitsuba puts v = 0 at the first row of a file; rows are stored bottom-up, so that v points up.
        """
        relative = f"textures/{name}.png"
        Image.fromarray(image[::-1]).save(self.folder / relative, compress_level=3)
        return relative

    def radiance(self, name: str, image: npt.NDArray[np.float32]) -> str:
        """Store a radiance image, (height, width, 3), top row first, as PFM; return its name."""
        relative = f"textures/{name}.pfm"
        header = f"PF\n{image.shape[1]} {image.shape[0]}\n-1.0\n".encode()
        (self.folder / relative).write_bytes(header + image.astype("<f4").tobytes())
        return relative

    def material(self, name: str, material: Material) -> str:
        """Declare a material under a name that shapes can refer to, and return the name."""
        element = material.element()
        element.set("id", f"material-{name}")
        self._materials.append(element)
        return name

    def store(self, name: str, mesh: Mesh, *, crease_deg: float = 40.0) -> str:
        """Store a mesh as binary PLY and return its relative name.

        Edges that bend by more than `crease_deg` stay sharp.
        """
        relative = f"meshes/{name}.ply"
        if relative in self._stored:
            raise ValueError(f"mesh {name!r} is stored twice")
        self._stored.add(relative)
        write_ply(self.folder / relative, mesh, crease_deg)
        return relative

    def mesh(self, name: str, mesh: Mesh, material: str, *, crease_deg: float = 40.0) -> None:
        """Store a mesh and add it as a shape of the same name."""
        self.place(name, self.store(name, mesh, crease_deg=crease_deg), material)

    def place(self, name: str, stored: str, material: str, to_world: Floats | None = None) -> None:
        """Add a stored mesh as a shape, moved by a (4, 4) matrix."""
        shape = self._shape("ply", name, material)
        ET.SubElement(shape, "string", name="filename", value=stored)
        if to_world is not None:
            shape.append(transform(to_world))

    def shape(self, kind: str, name: str, material: str, to_world: Floats) -> ET.Element:
        """Add one of Mitsuba's own shapes (`rectangle`, `sphere`, `disk`, `cylinder`)."""
        shape = self._shape(kind, name, material)
        shape.append(transform(to_world))
        return shape

    def light(self, radiance: Colour, strength: float = 1.0, *, weight: float = 1.0) -> None:
        """Make the last added shape an area emitter of a colour, or of a texture (a file name).

        `weight` is its sampling weight, relative to the other emitters.
        """
        shape = self._shapes[-1]
        emitter = ET.SubElement(shape, "emitter", type="area")
        ET.SubElement(emitter, "float", name="sampling_weight", value=repr(weight))
        if not radiance.startswith("#"):
            texture = ET.SubElement(emitter, "texture", type="bitmap", name="radiance")
            ET.SubElement(texture, "string", name="filename", value=radiance)
        else:
            emitter.append(rgb("radiance", linear(radiance) * strength))

    def sun(
        self, direction: tuple[float, float, float], colour: Colour, strength: float, *, weight: float = 1.0
    ) -> None:
        """Add parallel light that travels along `direction`, irradiance `strength`."""
        emitter = ET.Element("emitter", type="directional", id="sun")
        x, y, z = direction
        ET.SubElement(emitter, "vector", name="direction", x=repr(x), y=repr(y), z=repr(z))
        ET.SubElement(emitter, "float", name="sampling_weight", value=repr(weight))
        emitter.append(rgb("irradiance", linear(colour) * strength))
        self._emitters.append(emitter)

    def environment(self, radiance: str, *, weight: float = 1.0) -> None:
        """Add a sky in latitude and longitude, a file of `radiance`; its columns run from north by east."""
        emitter = ET.Element("emitter", type="envmap", id="environment")
        ET.SubElement(emitter, "string", name="filename", value=radiance)
        ET.SubElement(emitter, "float", name="sampling_weight", value=repr(weight))
        # Mitsuba's map has y up and -z at its first column.
        emitter.append(transform(np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])))
        self._emitters.append(emitter)

    def spot(
        self, origin: Vector, target: Vector, colour: Colour, intensity: float, *, cutoff_deg: float
    ) -> None:
        """Add a spot light that shines from a point at another, `intensity` watts a steradian on its axis."""
        emitter = ET.Element("emitter", type="spot", id="spot")
        place = ET.SubElement(emitter, "transform", name="to_world")
        points = {"origin": origin, "target": target, "up": (0.0, 1.0, 0.0)}
        ET.SubElement(place, "lookat", {k: " ".join(map(repr, point)) for k, point in points.items()})
        ET.SubElement(emitter, "float", name="cutoff_angle", value=repr(cutoff_deg))
        emitter.append(rgb("intensity", linear(colour) * intensity))
        self._emitters.append(emitter)

    def write(self, *, camera_to_world: Floats, fov_deg: float, size: tuple[int, int]) -> Path:
        """Write `scene.xml` with a camera at a pose (OpenGL axes, vertical angle)."""
        integrator = ET.SubElement(self.root, "integrator", type="path")
        ET.SubElement(integrator, "integer", name="max_depth", value="8")
        sensor = ET.SubElement(self.root, "sensor", type="perspective", id="camera")
        ET.SubElement(sensor, "string", name="fov_axis", value="y")
        ET.SubElement(sensor, "float", name="fov", value=repr(fov_deg))
        ET.SubElement(sensor, "float", name="near_clip", value="0.01")
        # Mitsuba looks along +z with +x to the left.
        sensor.append(transform(camera_to_world @ np.diag([-1.0, 1.0, -1.0, 1.0])))
        sampler = ET.SubElement(sensor, "sampler", type="independent")
        ET.SubElement(sampler, "integer", name="sample_count", value="64")
        film = ET.SubElement(sensor, "film", type="hdrfilm")
        for key, pixels in zip(("width", "height"), size, strict=True):
            ET.SubElement(film, "integer", name=key, value=str(pixels))
        ET.SubElement(film, "rfilter", type="box")
        self.root.extend([*self._materials, *self._emitters, *self._shapes])
        ET.indent(self.root, "  ")
        path = self.folder / "scene.xml"
        path.write_bytes(ET.tostring(self.root, encoding="utf-8") + b"\n")
        return path

    def _shape(self, kind: str, name: str, material: str) -> ET.Element:
        """Create a shape with an id and a reference to its material."""
        shape = ET.Element("shape", type=kind, id=name)
        ET.SubElement(shape, "ref", id=f"material-{material}")
        self._shapes.append(shape)
        return shape


def transform(matrix: Floats) -> ET.Element:
    """Return a `to_world` element of a (4, 4) matrix."""
    element = ET.Element("transform", name="to_world")
    values = " ".join(f"{value:.9g}" for value in np.asarray(matrix).ravel())
    ET.SubElement(element, "matrix", value=values)
    return element


def write_ply(path: Path, mesh: Mesh, crease_deg: float) -> None:
    """Write a mesh as binary little-endian PLY with normals and, if it has them, u and v."""
    rows, faces = shaded_vertices(mesh, crease_deg)
    names = ["x", "y", "z", "nx", "ny", "nz", "u", "v"][: rows.shape[1]]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    records = np.zeros(len(faces), dtype=FACE)
    records["count"], records["corners"] = 3, faces
    path.write_bytes("\n".join(header).encode() + rows.tobytes() + records.tobytes())
