"""The renderer protocol: everything that the methods require of a renderer.

A renderer is any class with these methods. Lanes are Dr.Jit arrays, so that camera rays, their intersections
and the shading of the hits become one kernel. Lists of pixels and images are NumPy arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from enfilade.camera.pinhole import Camera
from enfilade.records import F32, U32, Shading

MAX_PATH_DEPTH = 4  # greatest path depth at which an estimate may begin
UNLIMITED = 2**31  # depth of paths without a limit, as Mitsuba prints a max_depth of -1


class Purpose(IntEnum):
    """Use of random numbers: each purpose has a stream of its own."""

    REFERENCE = 0
    KEYFRAME = 1
    FILL = 2
    IRRADIANCE = 3
    DIFFUSE = 4
    SPECULAR = 5
    HASH_GRID = 6
    PREVIEW = 7
    GUIDE = 8
    PREPASS = 9
    PREPASS_HASH_GRID = 10
    SPECULAR_EDGES = 12
    KEYFRAME_SECOND_HALF = 14
    VIRTUAL_IMAGES = 15
    GUIDE_SECOND_HALF = 16
    SEEN_HASH_GRID = 17
    GUIDING = 18
    DEPTHS = 19
    GATHERED_VIRTUAL_IMAGES = 20
    VIRTUAL_HASH_GRID = 21


@dataclass(frozen=True)
class RandomKey:
    """Key of a stream of random numbers, beside the pixel and the index of the path.

    Attributes
    ----------
    seed
        Of the run, 32 bits.
    frame
        Number of the frame, of which the lowest 24 bits count.
    purpose
        Of the random numbers.
    """

    seed: int
    frame: int
    purpose: Purpose


class Branch(IntEnum):
    """The branch of a path at an interface, such as that of glass."""

    REFLECTED = 1
    TRANSMITTED = 2


class PixelFilter(IntEnum):
    """Distribution of camera rays over the image plane."""

    CENTRE = 0  # all through the pixel's centre
    BOX = 1  # uniform over the pixel
    GAUSSIAN = 2  # standard deviation 0.5 px, cut at 1.5 px: the support of 3x3 of §5.2


@dataclass(frozen=True)
class Rays:
    """Rays in world space, as lanes.

    Attributes
    ----------
    origin, direction : Array3f
        Directions need not have unit length: the distance of a hit is in lengths of its direction.
    """

    origin: Any
    direction: Any


@dataclass(frozen=True)
class Surfaces:
    """First hits of rays, as lanes. Fields but `is_hit` and `distance` are undefined where nothing is hit.

    Attributes
    ----------
    is_hit : Bool
    distance : Float
        Along the ray, in lengths of its direction; infinite where nothing is hit.
    normal : Array3f
        Shading normal in world space, unit length, in the hemisphere of the ray's origin.
    albedo : Array3f
        Diffuse reflectance of light along the normal towards the ray's origin, including a coat, 0..1.
    shape_index : UInt
        Index of the shape, from 1.
    surface : UInt
        ``records.SurfaceClass``.
    """

    is_hit: Any
    distance: Any
    normal: Any
    albedo: Any
    shape_index: Any
    surface: Any


@dataclass(frozen=True)
class ShadingPoint:
    """First hits of rays with the data for shading them, as lanes.

    Attributes
    ----------
    surfaces : Surfaces
    position : Array3f
        Of the hit, world space.
    emission : Array3f
        Radiance emitted towards the ray's origin by the surface, or by the environment for a miss. Weighted
        against next-event estimation at the ray's origin if the ray continues a path.
    has_specular : Bool
        Whether the BSDF has lobes other than the diffuse one.
    may_pass : Bool
        Whether one of the specular lobes is a null interaction: a cut-out, opaque in part or not at all.
    is_coated : Bool
        Whether the only specular lobe is a smooth coat over the diffuse one.
    specular_albedo : Float
        Rough estimate of the share of light that the specular lobes scatter towards the ray's origin: it
        sets the probability of survival in Russian roulette, and changes no mean.
    bounce : Bounce or None
        The previous vertex; None for camera rays.
    native : Any
        The renderer's own record of the hit.
    """

    surfaces: Surfaces
    position: Any
    emission: Any
    has_specular: Any
    may_pass: Any
    is_coated: Any
    specular_albedo: Any
    bounce: Bounce | None
    native: Any


@dataclass(frozen=True)
class Bounce:
    """The previous vertex of a path, for multiple importance sampling of the emission hit next; as lanes.

    Attributes
    ----------
    position : Array3f
        On the surface.
    pdf : Float
        Density of the sampled direction, per steradian.
    is_delta : Bool
        Whether the direction comes from a delta lobe, which next-event estimation can't sample.
    soft_only : Bool
        Whether emitters that cast sharp shadows are estimated apart: :meth:`LobeRenderer.sharp_light`.
    """

    position: Any
    pdf: Any
    is_delta: Any
    soft_only: Any


@dataclass(frozen=True)
class SharpLight:
    """Light of emitters with sharp shadows that a surface reflects, as lanes.

    Attributes
    ----------
    diffuse : Array3f
        Radiance reflected by the diffuse lobe, divided by the albedo.
    specular : Array3f
        Radiance reflected by the specular lobes.
    unoccluded : Array3f
        `diffuse` without occluders, of the same points of the emitters.
    """

    diffuse: Any
    specular: Any
    unoccluded: Any


@dataclass(frozen=True)
class BsdfSample:
    """One sampled direction of the diffuse lobe, or of the specular lobes, as lanes.

    Attributes
    ----------
    rays : Rays
        That continue the paths.
    bounce : Bounce
        Here; the previous one where the path passes a null interaction that shadow rays pass, too.
    throughput : Array3f
        Weight of the sample. It may be negative where the specular part is a BSDF minus its diffuse lobe.
    direct : Array3f
        Radiance reflected by the lobe from sampled emitters (next-event estimation).
    is_alive : Bool
    is_split : Bool
        Whether this is one of two branches of an interface: with :attr:`Branch.REFLECTED` or
        :attr:`Branch.TRANSMITTED`, and a throughput that is that of the branch.
    is_image : Bool
        Whether the lobe shows images: it is a delta lobe, or hardly wider.
    is_passed : Bool
        Whether the sample is a null interaction that shadow rays pass, too.
    is_interface : Bool
        Whether the surface bounds a refractive medium.
    is_within : Bool
        Whether the path goes on within it: on the inner side of the interface.
    """

    rays: Rays
    bounce: Bounce
    throughput: Any
    direct: Any
    is_alive: Any
    is_split: Any
    is_image: Any
    is_passed: Any
    is_interface: Any
    is_within: Any


@dataclass(frozen=True, eq=False)
class Emitters:
    """Points distributed over all emitting surfaces.

    Attributes
    ----------
    position : (N, 3) float32
        World space.
    shape_index : (N,) uint32
    """

    position: F32
    shape_index: U32


@dataclass(frozen=True, eq=False)
class Photons:
    """Points where paths from emitters, but for environments, meet the first surface (Jensen 1995).

    Attributes
    ----------
    position : (N, 3) float32
        World space.
    flux : (N,) float64
        Luminance of the power that a photon carries, in units of the scene.
    """

    position: F32
    flux: npt.NDArray[np.float64]


@dataclass(frozen=True)
class SceneDescription:
    """Facts of a loaded scene.

    Attributes
    ----------
    renderer : str
        Name and version of the renderer.
    shapes : tuple of str
        Names of shapes 1, 2, ...
    has_background : bool
        Whether rays that hit no surface may see light; False only where all of them are black.
    notes : tuple of str
        What the scene has and the frames will not show, and warnings of the renderer.
    """

    renderer: str
    shapes: tuple[str, ...]
    has_background: bool = True
    notes: tuple[str, ...] = ()


class Renderer(Protocol):
    """A renderer for the methods `reference` and `paper`."""

    def describe(self) -> SceneDescription:
        """Description of the scene and the renderer."""
        ...

    def surfaces(self, rays: Rays) -> Surfaces:
        """Find the first surface along each camera ray, beyond null interactions and hidden surfaces."""
        ...

    def trace(
        self,
        camera: Camera,
        pixels: npt.NDArray[np.uint32],
        random: RandomKey,
        *,
        spp: int,
        pixel_filter: PixelFilter = PixelFilter.CENTRE,
    ) -> Shading:
        """Path trace a list of pixels, at a cost in proportion to its length.

        Parameters
        ----------
        camera
        pixels : (N,) uint32
            Flat indices ``y * width + x``.
        random
            The random numbers of a path depend on this key, the pixel and the index of the path alone: not on
            the list, the size of batches or the worker.
        spp
            Paths traced for a pixel.
        pixel_filter
            Distribution of the camera rays.

        Returns
        -------
        Shading
            Of shape (N,). Non-finite samples are left out and counted.
        """
        ...


@runtime_checkable
class LobeRenderer(Renderer, Protocol):
    """A renderer for the method `decoupled`, which treats diffuse and specular lobes apart.

    Every BSDF is split into albedo times a diffuse lobe, and specular lobes: all others. The emission plus
    the albedo times ``estimate_diffuse`` plus ``estimate_specular`` converges to the result of ``trace``.
    """

    def why_inseparable(self) -> str:
        """Reason why the lobes of this scene can't be estimated apart; empty if they can."""
        ...

    def state(self) -> Any:
        """All arrays that the methods below read, as inputs of a recorded (frozen) kernel."""
        ...

    def emitters(self) -> Emitters:
        """Points on all emitters: few camera rays hit an emitter that is small in the image."""
        ...

    def photons(self) -> Photons:
        """The same points at each call: they suggest where bright surfaces are."""
        ...

    def max_path_depth(self) -> int:
        """Greatest number of segments of a path; :data:`UNLIMITED` where the scene has no limit."""
        ...

    def has_sharp_light(self) -> bool:
        """Whether any emitter casts sharp shadows: a point, spot or directional one, small lamp, or sun."""
        ...

    def has_specular_texture(self) -> bool:
        """Whether textures colour the reflection of any metal: :meth:`specular_tint`."""
        ...

    def intersect(
        self,
        rays: Rays,
        bounce: Bounce | None = None,
        active: Any = True,
        *,
        opaque_only: bool = False,
    ) -> ShadingPoint:
        """Find the first surface along each ray, and its emission.

        Parameters
        ----------
        rays
        bounce
            Previous vertex of the path; None for camera rays, which pass hidden surfaces.
        active : Bool
            Rays to trace; the others miss.
        opaque_only
            Take surfaces as either opaque or absent, as :meth:`surfaces` does, so that the point matches the
            G-buffer. Otherwise the transparency of a surface is one of its specular lobes.
        """
        ...

    def estimate_diffuse(
        self,
        point: ShadingPoint,
        sampler: Any,
        path_depth: int = 1,
        guide: Any = None,
        *,
        end_depth: int | None = None,
        soft_only: bool = False,
    ) -> tuple[Any, Any]:
        """Estimate the radiance reflected by the diffuse lobe, divided by the albedo, with one path.

        Of a Lambertian surface this is irradiance over pi.

        Parameters
        ----------
        point
        sampler : PaddedSobolSampler
        path_depth
            Path segments from the camera to the surface, 1 to ``MAX_PATH_DEPTH``. They count where the scene
            limits the length of paths.
        guide : PathGuide or None
            Of the sampled direction.
        end_depth
            With ``path_depth`` 1: paths end as those that begin at this depth, and are the same otherwise.
        soft_only
            Without next-event estimates of emitters that cast sharp shadows.

        Returns
        -------
        direct, indirect : Array3f
            Light directly from emitters, and all other light.
        """
        ...

    def estimate_specular(self, point: ShadingPoint, sampler: Any, path_depth: int = 1) -> tuple[Any, Any]:
        """Estimate the radiance scattered by the specular lobes; see :meth:`estimate_diffuse`."""
        ...

    def sharp_light(self, point: ShadingPoint, sampler: Any, *, specular: bool = False) -> SharpLight:
        """Estimate the light of emitters with sharp shadows that the lobes reflect, by next-event estimation.

        It is MIS-weighted; the complementary weight is in the emission that samples of the lobes with
        `soft_only` hit.

        Parameters
        ----------
        point
        sampler : PaddedSobolSampler
        specular
            Also that of the specular lobes, but for delta lobes.
        """
        ...

    def coat_emission(self, point: ShadingPoint) -> Any:
        """Emission of the next surface, or of the environment, that smooth coats reflect; Array3f.

        It has no noise. It is 0 where :attr:`ShadingPoint.is_coated` is false.
        """
        ...

    def specular_tint(self, point: ShadingPoint) -> tuple[Any, Any]:
        """Approximate reflectance of the specular lobes, without noise.

        Light that metal with a texture reflects, divided by it, varies less over the surface.

        Returns
        -------
        tint : Array3f
            That of the texture; of other surfaces one value for each BSDF, 0 where there are no such lobes.
        is_textured : Bool
        """
        ...

    def sample_diffuse(
        self, point: ShadingPoint, sampler: Any, *, soft_only: bool = False, guide: Any = None
    ) -> BsdfSample:
        """Sample a direction of the diffuse lobe, divided by the albedo.

        Parameters
        ----------
        point
        sampler : PaddedSobolSampler
        soft_only
            Without next-event estimation of emitters that cast sharp shadows: :meth:`sharp_light`.
        guide : PathGuide or None
            The direction is sampled from its mixture. The density that the bounce keeps for multiple
            importance sampling is that of the lobe, as without a guide.
        """
        ...

    def sample_specular(
        self,
        point: ShadingPoint,
        sampler: Any,
        choice: Any = None,
        branch: Any = None,
        *,
        soft_only: bool = False,
    ) -> BsdfSample:
        """Sample a direction of the specular lobes.

        Parameters
        ----------
        point
        sampler : PaddedSobolSampler
        choice : Float
            Selects the lobe, in [0, 1), transmission last; random by default.
        branch : UInt
            :class:`Branch` of each lane at interfaces; random by default. A sum over both branches has
            no noise of their choice. Other lobes are sampled as usual.
        soft_only
            As of :meth:`sample_diffuse`.
        """
        ...


def why_inseparable(renderer: Renderer) -> str:
    """Reason why a renderer can't estimate the lobes of its scene apart; empty if it can."""
    if isinstance(renderer, LobeRenderer):
        return renderer.why_inseparable()
    return f"the renderer {renderer.describe().renderer!r} does not separate lobes"
