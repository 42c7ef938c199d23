"""Scenes in Mitsuba's format, written shape by shape."""

import numpy as np

from enfilade.images import write_exr
from enfilade.scene.mitsuba.renderer import MitsubaRenderer

HEAD = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="6"/></integrator>
"""


def placed(kind, name, at, inside, scale=0.4):
    """A shape of a kind at a place."""
    x, y, z = at
    return f"""<shape type="{kind}" id="{name}"><transform name="to_world">
<scale value="{scale}"/><translate x="{x}" y="{y}" z="{z}"/></transform>{inside}</shape>
"""


def rgb(name, *values):
    return f'<rgb name="{name}" value="{", ".join(map(str, values))}"/>'


DIFFUSE = f'<bsdf type="diffuse">{rgb("reflectance", 0.2, 0.5, 0.7)}</bsdf>'
HOLES = """<texture name="{}" type="bitmap"><string name="filename" value="holes.exr"/>
<string name="filter_type" value="{}"/><boolean name="raw" value="true"/></texture>"""
BITMAP_MASK = f'<bsdf type="mask">{HOLES.format("opacity", "nearest")}{DIFFUSE}</bsdf>'
SKY = f'<emitter type="constant">{rgb("radiance", 0.6, 0.7, 0.9)}</emitter>'


def veil(opacity):
    return f'<bsdf type="mask"><float name="opacity" value="{opacity}"/>{DIFFUSE}</bsdf>'


def write(folder, *shapes, head=HEAD, sky=SKY, name="scene.xml"):
    file = folder / name
    file.write_text(head + "".join(shapes) + sky + "</scene>")
    return file


def opened(file, **settings):
    return MitsubaRenderer(file, **settings)


def write_holes(folder):
    """A texture whose left half is 1 and whose right half is 0."""
    write_exr(folder / "holes.exr", {"RGB": np.array([[[1.0] * 3, [0.0] * 3]], np.float32)}, is_portable=True)


def write_square(file, names, values):
    """A square of two triangles as PLY; its vertices have further properties, a text of values each."""
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", *names))
    corners = ("-1 -1 0", "1 -1 0", "1 1 0", "-1 1 0")
    vertices = "".join(f"{corner} {value}\n" for corner, value in zip(corners, values, strict=True))
    faces = "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    file.write_text(
        f"ply\nformat ascii 1.0\nelement vertex 4\n{properties}{faces}{vertices}3 0 1 2\n3 0 2 3\n"
    )
