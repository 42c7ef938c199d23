"""Mitsuba scenes of spheres of every material, and of panes, in an illuminated corner."""

from typing import Any

import numpy as np

from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.kernels.estimate import Estimate, Samples
from enfilade.methods.decoupled.integrator import Integrator
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.path_kernels import ENTRY_PX
from enfilade.methods.decoupled.paths import Path, spawn
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.records import Geometry, Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Rays
from enfilade.scene.mitsuba.renderer import MitsubaRenderer

PIXEL_ANGLE = 0.02  # radians
CONSTANT = '<emitter type="constant"><rgb name="radiance" value="0.3"/></emitter>'
TINT = '<rgb name="{}" value="0.6, 0.4, 0.2"/>'
ROUGH = '<float name="alpha" value="0.25"/>'
MATERIALS = {
    "diffuse": f'<bsdf type="diffuse">{TINT.format("reflectance")}</bsdf>',
    "plastic": f'<bsdf type="plastic">{TINT.format("diffuse_reflectance")}</bsdf>',
    "pplastic": f'<bsdf type="pplastic">{ROUGH}{TINT.format("diffuse_reflectance")}</bsdf>',
    "roughplastic": f'<bsdf type="roughplastic">{ROUGH}{TINT.format("diffuse_reflectance")}</bsdf>',
    "conductor": '<bsdf type="conductor"/>',
    "roughconductor": f'<bsdf type="roughconductor">{ROUGH}</bsdf>',
    "dielectric": '<bsdf type="dielectric"/>',
    "roughdielectric": f'<bsdf type="roughdielectric">{ROUGH}</bsdf>',
    "thindielectric": '<bsdf type="thindielectric"/>',
    "principled": f'<bsdf type="principled">{TINT.format("base_color")}<float name="roughness" value="0.3"/>'
    '<float name="metallic" value="0.3"/><float name="specular" value="0.8"/></bsdf>',
    "blend": f'<bsdf type="blendbsdf"><float name="weight" value="0.4"/><bsdf type="diffuse"/>'
    f'<bsdf type="roughconductor">{ROUGH}</bsdf></bsdf>',
    "mask": f'<bsdf type="mask"><float name="opacity" value="1"/>'
    f'<bsdf type="roughplastic">{ROUGH}</bsdf></bsdf>',
    "translucent": f'<bsdf type="principledthin">{TINT.format("base_color")}'
    '<float name="diff_trans" value="1.6"/></bsdf>',
    "one-sided, from behind": '<boolean name="flip_normals" value="true"/><bsdf type="mask">'
    f'<float name="opacity" value="0.5"/><bsdf type="diffuse">{TINT.format("reflectance")}</bsdf></bsdf>',
    "twosided": f'<bsdf type="twosided"><bsdf type="roughplastic">{ROUGH}</bsdf></bsdf>',
    "glowing air": '<bsdf type="null"/><emitter type="area"><rgb name="radiance" value="0.4"/></emitter>',
}


def _plane(name: str, transform: str, color: str) -> str:
    return (
        f'<shape type="rectangle" id="{name}"><transform name="to_world">{transform}</transform>'
        f'<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{color}"/></bsdf></bsdf>'
        "</shape>"
    )


def _scene(balls: dict[str, str], sky: str, integrator: str) -> str:
    shapes = [
        f'<shape type="sphere" id="{name}"><float name="radius" value="0.42"/>'
        f'<point name="center" x="{i % 4 - 1.5}" y="{0.5 + i // 4}" z="0"/>{bsdf}</shape>'
        for i, (name, bsdf) in enumerate(balls.items())
    ]
    shapes.append(_plane("floor", '<scale value="4"/><rotate x="1" angle="-90"/>', "0.6, 0.6, 0.5"))
    shapes.append(_plane("back", '<scale value="4"/><translate z="-1.5"/>', "0.2, 0.5, 0.7"))
    lamp = (
        '<shape type="rectangle" id="lamp"><transform name="to_world"><scale value="0.8"/>'
        '<rotate x="1" angle="90"/><translate y="4" z="1"/></transform>'
        '<emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>'
    )
    # No limit of depth: where a path is cut off, the two estimators cut differently.
    tracer = f'<integrator type="{integrator}"><integer name="max_depth" value="-1"/></integrator>'
    return f'<scene version="3.0.0">{tracer}{"".join(shapes)}{lamp}{sky}</scene>'


def opened_scene(
    folder, balls: dict[str, str], sky: str = CONSTANT, integrator: str = "path"
) -> MitsubaRenderer:
    file = folder / "scene.xml"
    file.write_text(_scene(balls, sky, integrator))
    return MitsubaRenderer(file)


def pane(name: str, z: float, reflectance: float = 1.0, transmittance: float = 1.0) -> str:
    """An entry of `balls` that ends its sphere and opens the shape of an upright pane."""
    return (
        f'{MATERIALS["diffuse"]}</shape><shape type="rectangle" id="{name}"><transform name="to_world">'
        f'<scale value="3"/><translate z="{z}"/></transform><bsdf type="thindielectric">'
        f'<rgb name="specular_reflectance" value="{reflectance}"/>'
        f'<rgb name="specular_transmittance" value="{transmittance}"/></bsdf>'
    )


def front_camera(width: int = 48, height: int = 36, x: float = 0.0) -> Camera:
    return Camera(look_at((x, 1.8, 6), (0.6 * x, 1.5, 0)), 36, width, height)


def pixels_of(camera: Camera) -> np.ndarray:
    return np.arange(camera.width * camera.height, dtype=np.uint32)


def integrator_of(renderer: MitsubaRenderer) -> Integrator:
    """One integrator a renderer, whose kernels are recorded once; freed with its renderer."""
    held = vars(renderer)
    if "integrator" not in held:
        held["integrator"] = Integrator(renderer)
    integrator: Integrator = held["integrator"]
    return integrator


def camera_paths(rays: Rays, sampler: Any) -> Path:
    """Paths from a camera whose pixels have an angle of :data:`PIXEL_ANGLE`."""
    return spawn(rays, sampler, ENTRY_PX * PIXEL_ANGLE)


def specular_aovs(renderer: MitsubaRenderer, camera: Camera, spp: int = 8) -> list[Shading]:
    """Reflection and transmission, (N,), without a cache."""
    estimate = Estimate(
        camera,
        pixels_of(camera),
        lambda rays, sampler: integrator_of(renderer).specular_radiance(
            IrradianceCache(), camera_paths(rays, sampler)
        ),
        paths_in_flight=1 << 20,
        pixel_filter=PixelFilter.CENTRE,
        random=RandomKey(2, 0, Purpose.SPECULAR),
        layers=2,
    )
    estimate.add(spp)
    return estimate.shadings


def traced_irradiance(
    renderer: MitsubaRenderer, camera: Camera, spp: int = 256
) -> tuple[Geometry, IrradianceImage]:
    """G-buffer and path traced irradiance of all pixels."""
    estimate = Estimate(
        camera,
        pixels_of(camera),
        lambda rays, sampler: Samples(renderer.estimate_diffuse(renderer.intersect(rays), sampler)),
        paths_in_flight=1 << 20,
        pixel_filter=PixelFilter.CENTRE,
        random=RandomKey(3, 0, Purpose.IRRADIANCE),
        layers=2,
    )
    estimate.add(spp)
    everywhere = np.ones((camera.height, camera.width), bool)
    direct, indirect = (shading.to_image(everywhere) for shading in estimate.shadings)
    return find_geometry(renderer, camera), IrradianceImage(direct, indirect, everywhere)
