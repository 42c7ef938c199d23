"""A Mitsuba scene behind the seam of ``renderer.LobeRenderer``.

Its own ``path`` integrator traces our own rays, one list of pixels at a time: the film is never used,
since changing its size or crop compiles anew and its Gaussian filter adds in no fixed order.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Bool, Float, UInt
from enfilade.camera.pinhole import Camera
from enfilade.device import active
from enfilade.errors import SceneError
from enfilade.images.exr import is_exr
from enfilade.kernels.estimate import estimate
from enfilade.kernels.replay import recorded
from enfilade.records import Shading, SurfaceClass
from enfilade.renderer import (
    MAX_PATH_DEPTH,
    Bounce,
    BsdfSample,
    Emitters,
    PixelFilter,
    RandomKey,
    Rays,
    SceneFacts,
    ShadingPoint,
    Surfaces,
)
from enfilade.scene.mitsuba.emitters import find_emitters
from enfilade.scene.mitsuba.integrators import scene_integrator, shortened, why_inseparable
from enfilade.scene.mitsuba.lobes import has_lobe
from enfilade.scene.mitsuba.transport import LightTransport
from enfilade.scene.scenefile import fingerprint, named_files, why_unreadable

LAYERS = 32  # surfaces that let everything pass, looked through before giving up
OPAQUE_ONLY_TRANSMITTANCE = (
    0.5  # of the light that a surface lets through, above which a G-buffer passes it by
)
PASSED = 0.999  # ... above which a path does
SCARCE = ("out of memory", "bad_alloc")  # Dr.Jit's words for too little memory, and C++'s
NULL_BSDFS = ("MaskBSDF", "Null")  # Mitsuba's classes; not thin glass, which is seen


class MitsubaRenderer:
    """A Mitsuba scene.

    Parameters
    ----------
    file
        A scene in Mitsuba's XML format, version 3.
    max_depth
        Longest path, in edges; 0: as the scene's integrator has it.
    chunk
        Paths in flight at once.

    Raises
    ------
    SceneError
        The file is missing, malformed, or refused by Mitsuba.
    """

    def __init__(self, file: Path, *, max_depth: int = 0, chunk: int = 1 << 20) -> None:
        if not file.is_file():
            raise SceneError(f"there is no scene file {file}")
        self._device = active()
        mi.set_variant(self._device.variant)
        mi.set_log_level(mi.LogLevel.Error)
        try:
            # Unmerged: Mitsuba would join meshes of one material, and shapes are what the user drew.
            with _threads_to_read(file):
                scene = mi.load_file(str(file), optimize=False)
        except MemoryError:
            raise
        except Exception as error:
            if any(words in str(error).lower() for words in SCARCE):
                raise MemoryError(f"too little memory to load {file}") from error
            cause = why_unreadable(file) or error
            raise SceneError(f"Mitsuba can't load {file}: {_reason(error)}") from cause
        if not isinstance(scene, mi.Scene):
            raise SceneError(f"{file} holds a {type(scene).__name__}, not a scene")
        if not scene.shapes():
            raise SceneError(f"{file} has no shapes: there is nothing to render")
        if not scene.emitters():
            raise SceneError(f"{file} has no light, every frame would be black: add an <emitter>")
        self._scene = scene
        self._chunk = chunk
        self._integrator = scene_integrator(scene, max_depth)
        self._onward = [
            shortened(self._integrator, path_depth) for path_depth in range(1, MAX_PATH_DEPTH + 1)
        ]
        # What cameras stand in is said by the scene's own; poses are the path's.
        self._medium = next((sensor.get_medium() for sensor in scene.sensors()), None)
        self._sampler = _lane_sampler()
        self._transport = LightTransport(scene, self._radiance_onward)
        self._shapes = _shapes(scene)
        self._file = file
        self._surfaces = recorded(lambda rays: self._find(rays)[0], lambda: self.state)
        # Mitsuba prepares the sampling of a mesh that emits when it is first asked for: now, and not while a
        # kernel is recorded.
        dr.eval(scene.sample_emitter_direction(dr.zeros(mi.SurfaceInteraction3f), mi.Point2f(0.5)))

    def describe(self) -> SceneFacts:
        """Say what is rendered, and by what."""
        return SceneFacts(
            renderer=f"Mitsuba {mi.__version__}",
            variant=self._device.variant,
            shapes=self._shapes.names,
            fingerprint=fingerprint(self._file),
        )

    def surfaces(self, rays: Rays) -> Surfaces:
        """Find the first surface along each ray, looking through masked-out parts of it.

        Where a mask is partly transparent, its surface counts when it is at least half opaque.
        """
        found: Surfaces = self._surfaces(rays)
        return found

    @property
    def why_inseparable(self) -> str:
        """See :meth:`enfilade.renderer.LobeRenderer.why_inseparable`."""
        return why_inseparable(self._scene, self._integrator)

    @property
    def state(self) -> Any:
        """See :meth:`enfilade.renderer.LobeRenderer.state`."""
        shapes = self._shapes
        own = self._scene, self._integrator, self._onward, shapes.number, shapes.is_null, shapes.materials
        return own, self._transport.state

    @cached_property
    def emitters(self) -> Emitters:
        """See :meth:`enfilade.renderer.LobeRenderer.emitters`."""
        return find_emitters(self._scene)

    def intersect(
        self, rays: Rays, bounce: Bounce | None = None, active: Any = True, *, opaque_only: bool = False
    ) -> ShadingPoint:
        """Find the first surface along rays, and the light it emits.

        Camera rays look through what lets all pass, and, for a G-buffer, through what :meth:`surfaces` looks
        through; scattered ones meet masks as Mitsuba's own paths do.
        """
        passed = None if bounce is not None else OPAQUE_ONLY_TRANSMITTANCE if opaque_only else PASSED
        surfaces, seen = self._find(rays, active, passed)
        return ShadingPoint(
            surfaces=surfaces,
            position=Array3f(seen.p),
            emission=self._transport.emission(seen, bounce),
            has_specular=self._transport.has_specular(seen),
            native=seen,
        )

    def estimate_diffuse(self, point: ShadingPoint, rng: Any, path_depth: int = 1) -> tuple[Any, Any]:
        """See :meth:`enfilade.renderer.LobeRenderer.estimate_diffuse`."""
        return self._transport.estimate_diffuse(point, rng, path_depth)

    def estimate_specular(self, point: ShadingPoint, rng: Any, path_depth: int = 1) -> tuple[Any, Any]:
        """See :meth:`enfilade.renderer.LobeRenderer.estimate_specular`."""
        return self._transport.estimate_specular(point, rng, path_depth)

    def sample_diffuse(self, point: ShadingPoint, rng: Any) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_diffuse`."""
        return self._transport.sample_diffuse(point, rng)

    def sample_specular(self, point: ShadingPoint, rng: Any, choice: Any = None) -> BsdfSample:
        """See :meth:`enfilade.renderer.LobeRenderer.sample_specular`."""
        return self._transport.sample_specular(point, rng, choice)

    def _find(
        self, rays: Rays, active: Any = True, passed: float | None = OPAQUE_ONLY_TRANSMITTANCE
    ) -> tuple[Surfaces, Any]:
        """The first surfaces, past those that let through more than a share of the light, if any may."""
        direction = mi.Vector3f(rays.direction)
        length = dr.norm(direction)
        ray = mi.Ray3f(mi.Point3f(rays.origin), direction / length)
        if passed is not None:
            seen, distance = self._visible(ray, Bool(active), passed)
        else:
            seen = self._scene.ray_intersect(ray, Bool(active))
            distance = seen.t

        is_hit = seen.is_valid()
        material = seen.bsdf(mi.RayDifferential3f(ray))
        flags = material.flags()
        normal = seen.sh_frame.n
        normal = dr.select(dr.dot(normal, ray.d) > 0, -normal, normal)
        surfaces = Surfaces(
            is_hit=is_hit,
            distance=distance / length,
            normal=Array3f(normal),
            albedo=self._transport.albedo(seen, material, is_hit),
            shape_index=dr.gather(UInt, self._shapes.number, _registry(seen), is_hit),
            surface=_surface_class(flags, seen.shape.is_emitter(), is_hit),
        )
        return surfaces, seen

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
        return estimate(
            camera,
            pixels,
            self._radiance,
            spp=spp,
            chunk=self._chunk,
            pixel_filter=pixel_filter,
            random=random,
        )

    def _radiance_onward(self, rays: Rays, rng: Any, path_depth: int, active: Any) -> Any:
        """Radiance along rays that begin at this path depth."""
        return self._radiance(rays, rng, self._onward[path_depth - 1], active)

    def _radiance(self, rays: Rays, rng: Any, integrator: Any = None, active: Any = True) -> Any:
        ray = mi.Ray3f(mi.Point3f(rays.origin), dr.normalize(mi.Vector3f(rays.direction)))
        self._sampler.rng = rng
        integrator = integrator or self._integrator
        radiance, _, _ = integrator.sample(
            self._scene, self._sampler, mi.RayDifferential3f(ray), self._medium, active
        )
        # Nothing may be kept that holds NumPy's memory: it can't be let go while a kernel is recorded.
        self._sampler.rng = None
        return radiance

    def _visible(self, ray: Any, active: Any, passed: float) -> tuple[Any, Any]:
        """First interaction of camera rays whose surface does not let that share pass, and its distance."""
        seen = self._scene.ray_intersect(ray, int(mi.RayFlags.All), Bool(True), active)
        distance = Float(seen.t)
        if not self._shapes.any_null:
            return seen, distance

        def look_behind(seen: Any, distance: Any, passing: Any, layer: Any) -> tuple[Any, ...]:
            behind = self._scene.ray_intersect(
                seen.spawn_ray(ray.d), int(mi.RayFlags.All), Bool(False), passing
            )
            distance = dr.select(passing, distance + behind.t, distance)
            seen = dr.select(passing, behind, seen)
            return seen, distance, passing & self._is_null_interaction(seen, passed), layer + 1

        seen, distance, _, _ = dr.while_loop(
            (seen, distance, self._is_null_interaction(seen, passed), UInt(0)),
            lambda _seen, _distance, passing, layer: passing & (layer < LAYERS),
            look_behind,
            labels=("seen", "distance", "passing", "layer"),
        )
        return seen, distance

    def _is_null_interaction(self, seen: Any, passed: float) -> Any:
        """Whether a surface is looked through: one that emits never is, its light would be lost."""
        material = seen.bsdf()
        number: Any = dr.reinterpret_array(mi.UInt32, material)
        is_null = dr.gather(Bool, self._shapes.is_null, number, seen.is_valid())
        through = material.eval_null_transmission(seen, is_null)
        return is_null & ~seen.shape.is_emitter() & (mi.luminance(through) > passed)


@contextmanager
def _threads_to_read(scene: Path) -> Iterator[None]:
    """Another thread where there is one and the scene names OpenEXR files.

    Mitsuba reads those by tasks that it waits for without doing them.
    """
    needs_more = dr.thread_count() == 1 and any(
        file.is_file() and is_exr(file) for file in named_files(scene)
    )
    if needs_more:
        dr.set_thread_count(2)
    try:
        yield
    finally:
        if needs_more:
            dr.set_thread_count(1)


@dataclass(frozen=True)
class _Shapes:
    """What is known of Mitsuba's shapes and materials, by their numbers in Mitsuba's registry."""

    number: Any  # UInt, of a shape
    is_null: Any  # Bool, of a material
    materials: Any  # BSDFPtr: tells Dr.Jit to look at all materials there are, also those of no shape
    any_null: bool
    names: tuple[str, ...]


def _shapes(scene: Any) -> _Shapes:
    shapes = scene.shapes()
    numbers: Any = [dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape)) for shape in shapes]
    registry = [int(number[0]) for number in numbers]
    number = np.zeros(max(registry) + 1, np.uint32)
    names = []
    for shape_index, (index, shape) in enumerate(zip(registry, shapes, strict=True), start=1):
        number[index] = shape_index
        names.append(shape.id() or f"{shape.class_name()} {shape_index}")
    is_null = _null_materials(scene)
    materials = mi.BSDFPtr([shape.bsdf() for shape in shapes])
    return _Shapes(UInt(number), Bool(is_null), materials, bool(is_null.any()), tuple(names))


def _null_materials(scene: Any) -> npt.NDArray[np.bool_]:
    """Materials that may let a ray pass, those of instanced shapes included."""
    materials = [node for node in mi.traverse(scene).hierarchy if isinstance(node, mi.BSDF)]
    numbers: Any = [dr.reinterpret_array(mi.UInt32, mi.BSDFPtr(material)) for material in materials]
    registry = [int(number[0]) for number in numbers]
    is_null = np.zeros(max(registry, default=0) + 1, bool)
    is_null[registry] = [material.class_name() in NULL_BSDFS for material in materials]
    return is_null


def _registry(seen: Any) -> Any:
    """Mitsuba's number of the shape that is seen: of the instance where it is one."""
    shape = dr.reinterpret_array(mi.UInt32, seen.shape)
    instance = dr.reinterpret_array(mi.UInt32, seen.instance)
    return dr.select(instance != 0, instance, shape)


def _surface_class(flags: Any, is_emitter: Any, is_hit: Any) -> Any:
    """``records.SurfaceClass`` of a material, from the flags of its lobes."""
    bends = has_lobe(flags, "DeltaTransmission", "GlossyTransmission")
    mirrors = has_lobe(flags, "DeltaReflection")
    is_glossy = has_lobe(flags, "GlossyReflection")
    is_broad = is_glossy | has_lobe(flags, "DiffuseReflection", "DiffuseTransmission")
    is_thin_glass = has_lobe(flags, "Null") & mirrors & ~is_broad

    surface = UInt(SurfaceClass.DIFFUSE)
    surface = dr.select(is_emitter, UInt(SurfaceClass.EMISSIVE), surface)
    surface = dr.select(is_glossy | mirrors, UInt(SurfaceClass.GLOSSY), surface)
    surface = dr.select(mirrors & ~is_broad, UInt(SurfaceClass.MIRROR), surface)
    surface = dr.select(bends | is_thin_glass, UInt(SurfaceClass.TRANSPARENT), surface)
    return dr.select(is_hit, surface, UInt(SurfaceClass.NONE))


def _lane_sampler() -> Any:
    """A Mitsuba sampler that draws from generators of ours, one a lane."""

    class LaneSampler(mi.Sampler):
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            self.rng: Any = None

        def next_1d(self, active: Any = True) -> Any:
            return self.rng.next_float32(active)

        def next_2d(self, active: Any = True) -> Any:
            return mi.Point2f(self.rng.next_float32(active), self.rng.next_float32(active))

    return LaneSampler()


def _reason(error: Exception) -> str:
    """Mitsuba's last sentence and the list below it, without the places in its code where it was raised."""
    lines = [line.strip() for line in str(error).strip().splitlines()]
    first = max((i for i, line in enumerate(lines) if not line.startswith("- ")), default=0)
    listed = ", ".join(line.removeprefix("- ") for line in lines[first + 1 :])
    return re.sub(r"\[\w+\.(?:cpp|h):\d+\] ", "", f"{lines[first]} {listed}").strip()
