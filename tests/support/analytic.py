"""A renderer of planes, parallelograms and spheres in closed form.

Depth, normals and motion vectors are known exactly, and so is the distribution of the noise. There are no
shadows, and at most one bounce. :func:`load` is an import path for ``--renderer``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt
from drjit.auto import PCG32, UInt64

from enfilade.arrays import Array3f, Float, UInt
from enfilade.camera.pinhole import Camera
from enfilade.kernels.estimate import Estimate
from enfilade.records import Shading, SurfaceClass
from enfilade.renderer import PixelFilter, RandomKey, Rays, SceneDescription, Surfaces
from support.analytic_scene import (
    AnalyticScene,
    Checker,
    Material,
    Plane,
    Quad,
    Sphere,
    Vector,
    Waves,
    read_scene,
)

CHECKER_SHIFT = 0.381966  # of a period: planes at round coordinates do not lie on a cube's face
OFFSET = 1e-4  # of a position's size: where bounced rays begin, clear of float32 rounding
BOUNCED = (SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT)


class AnalyticRenderer:
    """A scene of planes and spheres.

    Parameters
    ----------
    scene
    paths_in_flight
        Paths traced at once; changes no result.
    """

    def __init__(self, scene: AnalyticScene, *, paths_in_flight: int = 1 << 20) -> None:
        self._scene = scene
        self._paths_in_flight = paths_in_flight
        self._classes = UInt([SurfaceClass.NONE, *(shape.material.surface for shape in scene.shapes)])

    def describe(self) -> SceneDescription:
        """Facts of the scene."""
        return SceneDescription(
            renderer="analytic",
            shapes=tuple(shape.name for shape in self._scene.shapes),
        )

    def surfaces(self, rays: Rays) -> Surfaces:
        """Find the first surface along each ray. Mirrors and glass have no diffuse albedo."""
        hit = self._find(rays.origin, rays.direction)
        surface = dr.gather(UInt, self._classes, hit.shape_index)
        return Surfaces(
            is_hit=hit.shape_index > 0,
            distance=hit.distance,
            normal=hit.normal,
            albedo=dr.select(_is_bounced(surface), Array3f(0), self._reflectance(hit)),
            shape_index=hit.shape_index,
            surface=surface,
        )

    def trace(
        self,
        camera: Camera,
        pixels: npt.NDArray[np.uint32],
        random: RandomKey,
        *,
        spp: int,
        pixel_filter: PixelFilter = PixelFilter.CENTRE,
    ) -> Shading:
        """Path trace a list of pixels; see :meth:`enfilade.renderer.Renderer.trace`."""
        estimate = Estimate(
            camera,
            pixels,
            self._noisy,
            paths_in_flight=self._paths_in_flight,
            pixel_filter=pixel_filter,
            random=random,
        )
        estimate.add(spp)
        return estimate.shading

    def _noisy(self, rays: Rays, sampler: Any) -> Any:
        """Radiance along rays, with noise that is independent from path to path."""
        state, sequence = UInt64(sampler.seed), UInt64(sampler.path)
        rng = PCG32(size=1, initstate=state, initseq=sequence)
        radiance = self._radiance(rays.origin, rays.direction)
        radiance *= 1 + self._scene.noise * (-dr.log(1 - rng.next_float32()) - 1)
        is_lost = rng.next_float32() < self._scene.nan_share
        return dr.select(is_lost, Array3f(dr.nan), radiance)

    def _radiance(self, origin: Any, direction: Any) -> Any:
        hit = self._find(origin, direction)
        radiance = self._shade(hit, direction)
        if not any(shape.material.surface in BOUNCED for shape in self._scene.shapes):
            return radiance
        surface = dr.gather(UInt, self._classes, hit.shape_index)
        mirrors = surface == int(SurfaceClass.MIRROR)
        onward = dr.select(mirrors, _mirrored(direction, hit.normal), direction)
        side = dr.select(mirrors, Float(1), Float(-1)) * OFFSET * dr.maximum(dr.norm(hit.position), 1)
        start = hit.position + side * hit.normal
        seen = self._reflectance(hit) * self._shade(self._find(start, onward), onward)
        return dr.select(_is_bounced(surface), seen, radiance)

    def _find(self, origin: Any, direction: Any) -> _Hit:
        nearest, shape_index, normal = Float(dr.inf), UInt(0), Array3f(0)
        for number, shape in enumerate(self._scene.shapes, 1):
            distance, outward = _intersect(shape, origin, direction)
            is_nearer = (distance > 0) & (distance < nearest)
            nearest = dr.select(is_nearer, distance, nearest)
            shape_index = dr.select(is_nearer, UInt(number), shape_index)
            normal = dr.select(is_nearer, outward, normal)
        normal = dr.select(dr.dot(normal, direction) > 0, -normal, normal)
        nearest = dr.select(shape_index > 0, nearest, 0)
        return _Hit(nearest, shape_index, normal, origin + nearest * direction)

    def _reflectance(self, hit: _Hit) -> Any:
        albedo = Array3f(0)
        for number, shape in enumerate(self._scene.shapes, 1):
            albedo = dr.select(
                hit.shape_index == number, _texture(shape.material.albedo, hit.position), albedo
            )
        return albedo

    def _shade(self, hit: _Hit, direction: Any) -> Any:
        """Emitted and diffusely reflected radiance and the highlight; or the sky."""
        scene = self._scene
        to_light = dr.normalize(_constant(scene.to_light))
        height = 0.5 + 0.5 * dr.normalize(direction).y
        sky = dr.lerp(_constant(scene.horizon), _constant(scene.zenith), height)
        facing = dr.maximum(dr.dot(hit.normal, to_light), 0)
        arriving = _constant(scene.ambient) + _constant(scene.light) * facing
        mirrored = dr.maximum(dr.dot(dr.normalize(_mirrored(direction, hit.normal)), to_light), 1e-6)
        added = Array3f(0)
        for number, shape in enumerate(scene.shapes, 1):
            added = dr.select(hit.shape_index == number, _added(shape.material, mirrored, scene.light), added)
        return dr.select(hit.shape_index > 0, self._reflectance(hit) * arriving + added, sky)


@dataclass(frozen=True)
class _Hit:
    """Nearest surfaces, as lanes; `shape_index` is 0 where there is none."""

    distance: Any
    shape_index: Any
    normal: Any
    position: Any


def load(file: Path, *, max_depth: int = 0, paths_in_flight: int = 1 << 20) -> AnalyticRenderer:
    """Renderer of a scene that :func:`support.analytic_scene.write_scene` wrote."""
    del max_depth  # paths have one bounce
    return AnalyticRenderer(read_scene(file), paths_in_flight=paths_in_flight)


def _intersect(shape: Plane | Quad | Sphere, origin: Any, direction: Any) -> tuple[Any, Any]:
    """Distance (not above 0, infinite or NaN where missed) and outward normal of unit length."""
    match shape:
        case Plane():
            normal = dr.normalize(_constant(shape.normal))
            return dr.dot(_constant(shape.point) - origin, normal) / dr.dot(direction, normal), normal
        case Quad():
            return _intersect_quad(shape, origin, direction)
        case Sphere():
            return _intersect_sphere(shape, origin, direction)


def _intersect_quad(shape: Quad, origin: Any, direction: Any) -> tuple[Any, Any]:
    u, v = np.array(shape.edge_u), np.array(shape.edge_v)
    across = np.cross(u, v)
    area2 = across @ across
    normal = _constant(across / np.sqrt(area2))
    corner = _constant(shape.corner)
    distance = dr.dot(corner - origin, normal) / dr.dot(direction, normal)
    local = origin + distance * direction - corner
    a = dr.dot(local, _constant(np.cross(v, across) / area2))
    b = dr.dot(local, _constant(np.cross(across, u) / area2))
    is_inside = (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
    return dr.select(is_inside, distance, -1), normal


def _intersect_sphere(shape: Sphere, origin: Any, direction: Any) -> tuple[Any, Any]:
    # Haines et al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019.
    from_centre = origin - _constant(shape.centre)
    a = dr.dot(direction, direction)
    b = -dr.dot(from_centre, direction)
    off = from_centre + (b / a) * direction
    discriminant = shape.radius**2 - dr.dot(off, off)
    root = dr.sqrt(dr.maximum(a * discriminant, 0))
    q = b + dr.select(b < 0, -root, root)
    ends = (dr.dot(from_centre, from_centre) - shape.radius**2) / q, q / a
    near, far = dr.minimum(*ends), dr.maximum(*ends)
    distance = dr.select(discriminant >= 0, dr.select(near > 0, near, far), -1)
    return distance, dr.normalize(from_centre + distance * direction)


def _texture(albedo: Vector | Checker | Waves, position: Any) -> Any:
    match albedo:
        case Checker():
            cell = dr.floor(position * (2.0 / albedo.period) + CHECKER_SHIFT)
            parity = cell.x + cell.y + cell.z
            is_first = parity - 2 * dr.floor(0.5 * parity) < 0.5
            return dr.select(is_first, _constant(albedo.first), _constant(albedo.second))
        case Waves():
            wave = dr.sin(position * (dr.two_pi / albedo.period) + Array3f(0, 1, 2))
            return dr.lerp(_constant(albedo.first), _constant(albedo.second), 0.5 + dr.sum(wave) / 6)
        case _:
            return _constant(albedo)


def _added(material: Material, mirrored: Any, light: Vector) -> Any:
    emission = _constant(material.emission)
    if material.surface != SurfaceClass.GLOSSY:
        return emission
    return emission + material.gloss * _constant(light) * dr.power(mirrored, material.shininess)


def _constant(values: npt.ArrayLike) -> Any:
    return Array3f(*np.asarray(values, float).tolist())


def _mirrored(direction: Any, normal: Any) -> Any:
    return direction - 2 * dr.dot(direction, normal) * normal


def _is_bounced(surface: Any) -> Any:
    return (surface == int(SurfaceClass.MIRROR)) | (surface == int(SurfaceClass.TRANSPARENT))
