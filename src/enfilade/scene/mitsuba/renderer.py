"""Mitsuba behind the protocol ``renderer.LobeRenderer``.

The scene's own path integrator traces our rays, for one list of pixels at a time. The film is not used: a
change of its size or crop compiles kernels anew, and its Gaussian filter adds in no fixed order.
"""

from __future__ import annotations

from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Bool, Float, UInt
from enfilade.camera.pinhole import Camera
from enfilade.device import active
from enfilade.kernels.estimate import Estimate
from enfilade.kernels.guiding import PathGuide
from enfilade.kernels.replay import recorded
from enfilade.records import Shading
from enfilade.renderer import (
    MAX_PATH_DEPTH,
    Bounce,
    BsdfSample,
    Emitters,
    Photons,
    PixelFilter,
    RandomKey,
    Rays,
    SceneDescription,
    ShadingPoint,
    SharpLight,
    Surfaces,
)
from enfilade.scene.mitsuba.bsdfs import why_opaque
from enfilade.scene.mitsuba.emitters import find_emitters, partly_sampled, trace_photons
from enfilade.scene.mitsuba.files import collected_warnings
from enfilade.scene.mitsuba.integrators import (
    hides_emitters,
    is_volumetric,
    limitations,
    max_path_depth,
    scene_integrator,
    shortened,
    why_inseparable,
)
from enfilade.scene.mitsuba.load import load_scene
from enfilade.scene.mitsuba.lobes import Lobes
from enfilade.scene.mitsuba.merge import merge_meshes
from enfilade.scene.mitsuba.shadow_rays import NULL_LAYERS, ShadowRays
from enfilade.scene.mitsuba.shapes import Shapes, has_lobe, surface_class
from enfilade.scene.mitsuba.transport import LightTransport

NULL_GBUFFER = 0.5  # transmittance above which a hit is a null interaction for the G-buffer
NULL_PATH = 0.999  # ... and for a path


class MitsubaRenderer:
    """A Mitsuba scene.

    Parameters
    ----------
    file
        A scene in Mitsuba's XML format.
    max_depth
        Greatest path depth, in segments; 0: that of the scene's integrator.
    paths_in_flight
        Paths traced at once.

    Raises
    ------
    SceneError
        The file is missing, malformed, or refused by Mitsuba.
    """

    def __init__(self, file: Path, *, max_depth: int = 0, paths_in_flight: int = 1 << 20) -> None:
        self._device = active()
        mi.set_variant(self._device.variant)
        with collected_warnings() as warnings:
            self._merged = merge_meshes(load_scene(file))
        self._scene = scene = self._merged.scene
        self._paths_in_flight = paths_in_flight
        self._integrator = scene_integrator(scene, max_depth)
        depths = range(1, MAX_PATH_DEPTH + 1)
        self._continued = {
            (begin, end): shortened(self._integrator, begin, end_depth=end)
            for begin, end in sorted({*zip(depths, depths, strict=True), *product([1], depths)})
        }
        # The medium around the camera is that of the scene's sensor; poses are those of the camera path.
        self._medium = next((sensor.get_medium() for sensor in scene.sensors()), None)
        self._sampler = _lane_sampler()
        self._lobes = Lobes(scene)
        self._is_volumetric = is_volumetric(self._integrator)
        self._shapes = Shapes(self._merged, hides_emitters=hides_emitters(scene))
        self._description = SceneDescription(
            renderer=f"Mitsuba {mi.__version__}",
            shapes=self._shapes.names,
            has_background=scene.environment() is not None and not self._shapes.hides_emitters,
            notes=(*limitations(scene, self._integrator), *partly_sampled(self._merged), *warnings),
        )
        self._surfaces = recorded(
            lambda rays: self._intersect(rays)[0], lambda: (scene, self._shapes.state, self._lobes.state)
        )
        # Mitsuba builds the sampling table of an emitting mesh when it is first used. That must not happen
        # while a kernel is recorded.
        dr.eval(scene.sample_emitter_direction(dr.zeros(mi.SurfaceInteraction3f), mi.Point2f(0.5)))
        # Raise errors of BSDFs that can't be sampled now, and not in a task.
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(scene.bbox().min), mi.Vector3f(0.0, 0.0, 1.0)))
        si.bsdf().sample(mi.BSDFContext(), si, Float(0.5), mi.Point2f(0.5))

    def describe(self) -> SceneDescription:
        """Description of the scene and the renderer."""
        return self._description

    def surfaces(self, rays: Rays) -> Surfaces:
        """Find the first surface along each camera ray that is not hidden, and at least half opaque."""
        found: Surfaces = self._surfaces(rays)
        return found

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
            self._radiance,
            paths_in_flight=self._paths_in_flight,
            pixel_filter=pixel_filter,
            random=random,
        )
        estimate.add(spp)
        return estimate.shading

    def why_inseparable(self) -> str:
        """See :meth:`enfilade.renderer.LobeRenderer.why_inseparable`."""
        return why_inseparable(self._scene, self._integrator) or why_opaque(self._scene)

    def state(self) -> Any:
        """See :meth:`enfilade.renderer.LobeRenderer.state`."""
        integrators = self._integrator, list(self._continued.values())
        lights = self._transport.sharp_emitters.state
        lobes = self._lobes.state, self._lobes.specular_albedos
        return self._scene, integrators, self._shapes.state, lobes, lights

    def emitters(self) -> Emitters:
        """See :meth:`enfilade.renderer.LobeRenderer.emitters`."""
        return self._emitters

    def photons(self) -> Photons:
        """See :meth:`enfilade.renderer.LobeRenderer.photons`."""
        return self._photons

    @cached_property
    def _transport(self) -> LightTransport:
        shadow_rays = ShadowRays(self._scene, pass_to_all=self._is_volumetric)
        return LightTransport(self._scene, self._lobes, self._continued_radiance, shadow_rays)

    @cached_property
    def _emitters(self) -> Emitters:
        return find_emitters(self._merged)

    @cached_property
    def _photons(self) -> Photons:
        return trace_photons(self._scene)

    def max_path_depth(self) -> int:
        """See :meth:`enfilade.renderer.LobeRenderer.max_path_depth`."""
        return max_path_depth(self._integrator)

    def has_sharp_light(self) -> bool:
        """See :meth:`enfilade.renderer.LobeRenderer.has_sharp_light`."""
        return not self._transport.sharp_emitters.is_empty

    def has_specular_texture(self) -> bool:
        """See :meth:`enfilade.renderer.LobeRenderer.has_specular_texture`."""
        return self._lobes.has_textured_metal

    def intersect(
        self,
        rays: Rays,
        bounce: Bounce | None = None,
        active: Any = True,
        *,
        opaque_only: bool = False,
    ) -> ShadingPoint:
        """Find the first surface along each ray, and its emission.

        Camera rays pass null interactions and hidden surfaces. For other rays the former are specular lobes,
        as in Mitsuba's paths.
        """
        null_transmittance = None if bounce is not None else NULL_GBUFFER if opaque_only else NULL_PATH
        surfaces, si = self._intersect(rays, active, null_transmittance)
        bsdf = si.bsdf()
        return ShadingPoint(
            surfaces=surfaces,
            position=Array3f(si.p),
            emission=self._transport.emission(
                si, bounce, active & self._is_seen(si, is_camera_ray=bounce is None)
            ),
            has_specular=self._lobes.has_specular(si, bsdf),
            may_pass=has_lobe(bsdf.flags(), "Null"),
            is_coated=self._lobes.is_coated(si, bsdf),
            specular_albedo=self._lobes.specular_albedo(si, bsdf),
            bounce=bounce,
            native=si,
        )

    def estimate_diffuse(
        self,
        point: ShadingPoint,
        sampler: Any,
        path_depth: int = 1,
        guide: PathGuide | None = None,
        *,
        end_depth: int | None = None,
        soft_only: bool = False,
    ) -> tuple[Any, Any]:
        """See :meth:`enfilade.renderer.LobeRenderer.estimate_diffuse`."""
        sample = self._transport.sample_diffuse(point, sampler, soft_only=soft_only, guide=guide)
        return self._transport.estimate(sample, sampler, path_depth, end_depth or path_depth)

    def estimate_specular(self, point: ShadingPoint, sampler: Any, path_depth: int = 1) -> tuple[Any, Any]:
        """See :meth:`enfilade.renderer.LobeRenderer.estimate_specular`."""
        sample = self._transport.sample_specular(point, sampler)
        return self._transport.estimate(sample, sampler, path_depth, path_depth)

    def sharp_light(self, point: ShadingPoint, sampler: Any, *, specular: bool = False) -> SharpLight:
        """See :meth:`enfilade.renderer.LobeRenderer.sharp_light`."""
        return self._transport.sharp_light(point, sampler, specular=specular)

    def coat_emission(self, point: ShadingPoint) -> Any:
        """See :meth:`enfilade.renderer.LobeRenderer.coat_emission`."""
        return self._transport.coat_emission(point)

    def specular_tint(self, point: ShadingPoint) -> tuple[Any, Any]:
        """See :meth:`enfilade.renderer.LobeRenderer.specular_tint`."""
        si = point.native
        tint, is_textured = self._lobes.specular_tint(si, si.bsdf(), point.has_specular)
        return Array3f(tint), Bool(is_textured)

    def sample_diffuse(
        self, point: ShadingPoint, sampler: Any, *, soft_only: bool = False, guide: PathGuide | None = None
    ) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_diffuse`."""
        return self._transport.sample_diffuse(point, sampler, soft_only=soft_only, guide=guide)

    def sample_specular(
        self,
        point: ShadingPoint,
        sampler: Any,
        choice: Any = None,
        branch: Any = None,
        *,
        soft_only: bool = False,
    ) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_specular`."""
        return self._transport.sample_specular(point, sampler, choice, branch, soft_only=soft_only)

    def _intersect(
        self, rays: Rays, active: Any = True, null_transmittance: float | None = NULL_GBUFFER
    ) -> tuple[Surfaces, Any]:
        """First surfaces along rays, beyond those that camera rays pass, and Mitsuba's interactions."""
        direction = mi.Vector3f(rays.direction)
        length = dr.norm(direction)
        ray = mi.Ray3f(mi.Point3f(rays.origin), direction / length)
        if null_transmittance is None:
            si = self._scene.ray_intersect(ray, Bool(active))
            distance = si.t
        else:
            si, distance, _ = self._intersect_beyond(ray, Bool(active), null_transmittance)

        # Describe the surface; its normal faces the ray's origin.
        is_hit = si.is_valid()
        bsdf = si.bsdf(mi.RayDifferential3f(ray))
        normal = si.sh_frame.n
        normal = dr.select(dr.dot(normal, ray.d) > 0, -normal, normal)
        is_narrow = self._lobes.is_narrow(si, bsdf)
        surfaces = Surfaces(
            is_hit=is_hit,
            distance=distance / length,
            normal=Array3f(normal),
            albedo=Array3f(self._lobes.albedo(si, bsdf, is_hit)),
            shape_index=self._shapes.index(si),
            surface=surface_class(bsdf.flags(), is_narrow, si.shape.is_emitter(), is_hit),
        )
        return surfaces, si

    def _intersect_beyond(self, ray: Any, active: Any, null_transmittance: float) -> tuple[Any, Any, Any]:
        """First interactions of rays that are not null interactions, their distances, and rays to them."""
        si = self._scene.ray_intersect(ray, int(mi.RayFlags.All), Bool(True), active)
        distance = Float(si.t)
        if not self._shapes.may_be_null:
            return si, distance, ray

        def continue_ray(ray: Any, si: Any, distance: Any, is_null: Any, layer: Any) -> tuple[Any, ...]:
            ray = dr.select(is_null, si.spawn_ray(ray.d), ray)
            next_si = self._scene.ray_intersect(ray, int(mi.RayFlags.All), Bool(False), is_null)
            distance = dr.select(is_null, distance + next_si.t, distance)
            si = dr.select(is_null, next_si, si)
            return ray, si, distance, is_null & self._shapes.is_null(si, null_transmittance), layer + 1

        ray, si, distance, _, _ = dr.while_loop(
            (mi.Ray3f(ray), si, distance, self._shapes.is_null(si, null_transmittance), UInt(0)),
            lambda _ray, _si, _distance, is_null, layer: is_null & (layer < NULL_LAYERS),
            continue_ray,
            labels=("ray", "si", "distance", "is_null", "layer"),
        )
        return si, distance, ray

    def _radiance(self, rays: Rays, sampler: Any) -> Any:
        """Radiance along camera rays."""
        ray = _ray(rays)
        active = Bool(True)
        if self._shapes.has_hidden:
            si, _, ray = self._intersect_beyond(ray, active, NULL_PATH)
            active = self._is_seen(si, is_camera_ray=True)
        return dr.select(active, self._sampled(self._integrator, ray, sampler)[0], 0.0)

    def _is_seen(self, si: Any, *, is_camera_ray: bool) -> Any:
        """Whether a ray sees emission: where emitters are hidden, the camera sees no background; Bool."""
        return si.is_valid() if is_camera_ray and self._shapes.hides_emitters else Bool(True)

    def _continued_radiance(
        self, rays: Rays, sampler: Any, depths: tuple[int, int], active: Any
    ) -> tuple[Any, Any]:
        """Radiance along rays that continue paths; whether emission that is passed is in it."""
        radiance, is_valid = self._sampled(self._continued[depths], _ray(rays), sampler, active)
        return radiance, is_valid | self._is_volumetric

    def _sampled(self, integrator: Any, ray: Any, sampler: Any, active: Any = True) -> tuple[Any, Any]:
        self._sampler.sampler = sampler
        radiance, is_valid, _ = integrator.sample(
            self._scene, self._sampler, mi.RayDifferential3f(ray), self._medium, active
        )
        # Keep nothing that holds NumPy's memory: it can't be freed while a kernel is recorded.
        self._sampler.sampler = None
        return radiance, is_valid


def _ray(rays: Rays) -> Any:
    """Rays of unit direction; mitsuba.Ray3f."""
    return mi.Ray3f(mi.Point3f(rays.origin), dr.normalize(mi.Vector3f(rays.direction)))


def _lane_sampler() -> Any:
    """A Mitsuba sampler that draws from ours, one a lane."""

    class LaneSampler(mi.Sampler):
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            self.sampler: Any = None

        def next_1d(self, active: Any = True) -> Any:
            del active  # a dimension has one use in all paths of a pixel
            return self.sampler.next_1d()

        def next_2d(self, active: Any = True) -> Any:
            del active
            return mi.Point2f(self.sampler.next_2d())

    return LaneSampler()
