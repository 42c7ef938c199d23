"""A closed room as a Mitsuba scene: a lamp below the ceiling, bright walls, much indirect light."""

from __future__ import annotations

from pathlib import Path

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.scene.mitsuba.renderer import MitsubaRenderer


def opened_room(folder: Path, radiance: float = 1.5) -> MitsubaRenderer:
    """Write and open the scene, with the radiance of its lamp."""
    checks = (
        '<texture type="checkerboard" name="reflectance"><rgb name="color0" value="0.2, 0.3, 0.4"/>'
        '<rgb name="color1" value="0.7"/><transform name="to_uv"><scale x="12" y="12"/></transform></texture>'
    )
    shapes = [
        _wall("floor", "x", -90, (0, 0, 0), f'<bsdf type="diffuse">{checks}</bsdf>'),
        _wall("ceiling", "x", 90, (0, 2.5, 0), _paint("0.8, 0.8, 0.75")),
        _wall("back", "y", 0, (0, 1, -3), _paint("0.75, 0.7, 0.55")),
        _wall("front", "y", 180, (0, 1, 1.5), _paint("0.7")),
        _wall("left", "y", 90, (-2, 1, 0), _paint("0.75, 0.4, 0.3")),
        _wall("right", "y", -90, (2, 1, 0), _paint("0.4, 0.7, 0.4")),
        _shape("cube", "pillar", '<scale x="0.15" y="1.3" z="0.15"/><translate x="-0.5" y="1.2" z="-1.2"/>',
               _paint("0.6")),
        _ball("ball", (0.4, 0.4, -1.3), 0.4, _paint("0.6, 0.5, 0.3")),
        _ball("mirror", (1.2, 0.45, -2), 0.45, '<bsdf type="conductor"/>'),
        _ball("bottle", (-1.2, 0.35, -1.8), 0.35,
              '<bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.2, 0.4, 0.6"/>'
              '<float name="alpha" value="0.2"/></bsdf>'),
        _lamp("lamp", '<scale value="1.2"/><rotate x="1" angle="90"/><translate y="2.45" z="-0.5"/>',
              radiance),
    ]  # fmt: skip
    # Paths of any length: the irradiance cache does not count the edges of a path.
    integrator = '<integrator type="path"><integer name="max_depth" value="-1"/></integrator>'
    file = folder / "scene.xml"
    file.write_text(f'<scene version="3.0.0">{integrator}{"".join(shapes)}</scene>')
    return MitsubaRenderer(file)


def room_path(count: int = 9, size: tuple[int, int] = (48, 32)) -> CameraPath:
    """A walk from left to right before the pillar, which hides a part of the back wall."""
    eyes = [(-0.6 + 1.2 * k / max(count - 1, 1), 1.3, 0.8) for k in range(count)]
    cameras = tuple(Camera(look_at(eye, (0.3 * eye[0], 1.1, -2)), 70, *size) for eye in eyes)
    return CameraPath(cameras, tuple(range(1, count + 1)), 24.0)


def _wall(name: str, axis: str, angle: float, at: tuple[float, float, float], bsdf: str) -> str:
    x, y, z = at
    turn = f'<scale value="3.2"/><rotate {axis}="1" angle="{angle}"/>'
    return _shape("rectangle", name, f'{turn}<translate x="{x}" y="{y}" z="{z}"/>', bsdf)


def _lamp(name: str, transform: str, radiance: float) -> str:
    glow = f'<emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter>'
    return _shape("rectangle", name, transform, _paint("0") + glow)


def _shape(kind: str, name: str, transform: str, content: str) -> str:
    to_world = f'<transform name="to_world">{transform}</transform>'
    return f'<shape type="{kind}" id="{name}">{to_world}{content}</shape>'


def _ball(name: str, centre: tuple[float, float, float], radius: float, bsdf: str) -> str:
    x, y, z = centre
    return (
        f'<shape type="sphere" id="{name}"><float name="radius" value="{radius}"/>'
        f'<point name="center" x="{x}" y="{y}" z="{z}"/>{bsdf}</shape>'
    )


def _paint(reflectance: str) -> str:
    return f'<bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf>'
