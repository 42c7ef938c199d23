"""What the stages ask of a renderer: the seam between enfilade and whatever traces the paths.

A backend is any class with these methods. Lanes are Dr.Jit arrays, so that a camera ray, its surface
query and the arithmetic on the answer become one kernel; lists of pixels and images are NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from enfilade.camera.pinhole import Camera
from enfilade.records import F32, U32, Shading


class Purpose(IntEnum):
    """What random numbers are drawn for: each purpose has a stream of its own."""

    REFERENCE = 0
    KEYFRAME = 1
    FILL = 2
    IRRADIANCE = 3
    DIFFUSE = 4
    SPECULAR = 5
    HASH_GRID = 6
    PILOT = 7
    GUIDE = 8
    PREPASS = 9
    PREPASS_HASH_GRID = 10


@dataclass(frozen=True)
class RandomKey:
    """What random numbers depend on, beside the pixel and the number of the path.

    Attributes
    ----------
    seed
        Of the run, 32 bits.
    frame
        Number of the frame; its lowest 24 bits count.
    purpose
    """

    seed: int
    frame: int
    purpose: Purpose


class PixelFilter(IntEnum):
    """Where in the image the paths of a pixel begin."""

    CENTRE = 0  # all through the pixel's centre: the paper's ray tracer, antialiased later (§5)
    BOX = 1  # uniform over the pixel
    GAUSSIAN = 2  # standard deviation 0.5 px, cut at 1.5 px: the support of 3x3 of §5.2


@dataclass(frozen=True)
class Rays:
    """Rays in the world, as lanes.

    Attributes
    ----------
    origin, direction : Array3f
        Directions need not have unit length: a hit's `distance` counts in their lengths.
    """

    origin: Any
    direction: Any


@dataclass(frozen=True)
class Surfaces:
    """First hits of rays, as lanes. Nothing is said of the fields where `is_hit` is false.

    Attributes
    ----------
    is_hit : Bool
    distance : Float
        Along the ray, in lengths of its direction.
    normal : Array3f
        Shading normal in the world, unit length, on the side of the ray's origin.
    albedo : Array3f
        Diffuse reflectance seen from there, a coat included, 0..1.
    shape_index : UInt
        Number of the shape, from 1.
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
    """First hits of rays with what shading them takes, as lanes.

    Attributes
    ----------
    surfaces : Surfaces
    position : Array3f
        Of the hit, in the world.
    emission : Array3f
        Radiance towards the ray's origin of what emits: the surface, or the environment where nothing is
        hit. Where lights were already sampled at the ray's origin, weighted against that.
    has_specular : Bool
        Whether the surface does anything but scatter diffusely.
    native : Any
        The backend's own record of the hit.
    """

    surfaces: Surfaces
    position: Any
    emission: Any
    has_specular: Any
    native: Any


@dataclass(frozen=True)
class Bounce:
    """Where rays come from that a lobe sent: what weights the light they find, as lanes.

    Attributes
    ----------
    position : Array3f
        On the surface.
    pdf : Float
        Density of the direction, per steradian.
    is_delta : Bool
        Whether it was the only one possible, so that sampling lights could not have found it.
    """

    position: Any
    pdf: Any
    is_delta: Any


@dataclass(frozen=True)
class BsdfSample:
    """One bounce off the diffuse lobe, or off everything else, as lanes.

    Attributes
    ----------
    rays : Rays
    bounce : Bounce
    throughput : Array3f
        Of the bounce; may be negative where a lobe is what remains after the diffuse one.
    direct : Array3f
        Radiance that the lobe sends back from sampled lights.
    is_alive : Bool
    """

    rays: Rays
    bounce: Bounce
    throughput: Any
    direct: Any
    is_alive: Any


@dataclass(frozen=True, eq=False)
class Emitters:
    """Points all over the surfaces that emit.

    Attributes
    ----------
    position : (N, 3) float32
        In the world.
    shape_index : (N,) uint32
    """

    position: F32
    shape_index: U32


@dataclass(frozen=True)
class SceneFacts:
    """What a scene says about itself.

    Attributes
    ----------
    renderer : str
        Name and version of what traces.
    variant : str
        Of the renderer: what runs its kernels.
    shapes : tuple of str
        Name of shape 1, 2, ...
    fingerprint : str
        SHA-256 over the scene's files: the same scene, the same letters.
    """

    renderer: str
    variant: str
    shapes: tuple[str, ...]
    fingerprint: str


class Renderer(Protocol):
    """A renderer that the paper's method can drive."""

    def describe(self) -> SceneFacts:
        """Say what is rendered, and by what."""
        ...

    def surfaces(self, rays: Rays) -> Surfaces:
        """Find the first surface along each ray, looking through what lets everything pass."""
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
        """Path trace a list of pixels, at a cost in proportion to the list.

        Parameters
        ----------
        camera
        pixels : (N,) uint32
            Flat indices ``y * width + x``.
        random
            The random numbers of a pixel depend on this, on the pixel and on the path's number, and
            on nothing else: not on the list, the chunking or the worker.
        spp
            Paths a pixel.
        pixel_filter
            Where in the image the paths of a pixel begin.

        Returns
        -------
        Shading
            Of shape (N,). Non-finite samples are left out and counted.
        """
        ...


MAX_PATH_DEPTH = 4  # that a path may have behind it when the path tracer is asked for the rest of it


@runtime_checkable
class LobeRenderer(Renderer, Protocol):
    """A renderer that can also be asked for the light apart from the surfaces it falls on.

    Every BSDF is a sum: albedo times a diffuse lobe, and the rest. Exactly: what ``estimate_diffuse``
    estimates, times the albedo, plus what ``sample_specular`` finds, plus the emission, is what ``trace``
    converges to.
    """

    @property
    def why_inseparable(self) -> str:
        """Why this scene's light can't be told from its surfaces after all; empty where it can."""
        ...

    @property
    def state(self) -> Any:
        """All arrays that the other methods read: what a kernel that is recorded once must be told of."""
        ...

    @property
    def emitters(self) -> Emitters:
        """Where light comes from; few camera rays would miss what is small in the image."""
        ...

    def intersect(
        self, rays: Rays, bounce: Bounce | None = None, active: Any = True, *, opaque_only: bool = False
    ) -> ShadingPoint:
        """Find the first surface along rays, and the light it emits.

        Parameters
        ----------
        rays
        bounce
            Where the rays come from; None for camera rays.
        active : Bool
            Rays that are traced; others hit nothing.
        opaque_only
            Take surfaces for wholly there or not at all, as :meth:`surfaces` does: for camera rays whose
            light belongs to a G-buffer. Otherwise what is let through a surface is a lobe of it.
        """
        ...

    def estimate_diffuse(self, point: ShadingPoint, rng: Any, path_depth: int = 1) -> tuple[Any, Any]:
        """Estimate the radiance that the diffuse lobe would send if the albedo were one.

        One path, with lights sampled at its first vertex: irradiance over pi, as the material's own
        diffuse lobe weights it.

        Parameters
        ----------
        point
        rng : PCG32
        path_depth
            How many lead from the camera to the surface, 1 to ``MAX_PATH_DEPTH``: they count where the scene
            limits the length of paths.

        Returns
        -------
        direct, indirect : Array3f
            By light straight from emitters, and by all other.
        """
        ...

    def estimate_specular(self, point: ShadingPoint, rng: Any, path_depth: int = 1) -> tuple[Any, Any]:
        """Estimate the radiance that everything but the diffuse lobe sends; see :meth:`estimate_diffuse`."""
        ...

    def sample_diffuse(self, point: ShadingPoint, rng: Any) -> BsdfSample:
        """Sample one bounce off the diffuse lobe, as if the albedo were one.

        The estimate of :meth:`estimate_diffuse` is its direct light, and its throughput times what its rays
        find.
        """
        ...

    def sample_specular(self, point: ShadingPoint, rng: Any, choice: Any = None) -> BsdfSample:
        """Sample one bounce off everything but the diffuse lobe.

        Parameters
        ----------
        point
        rng : PCG32
        choice : Float
            In [0, 1): which of several lobes, those that let light through last. None leaves it to chance.
        """
        ...
