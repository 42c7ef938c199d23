"""What the stages ask of a renderer: the seam between enfilade and whatever traces the paths.

A backend is any class with these methods. Lanes are Dr.Jit arrays, so that a camera ray, its surface
query and the arithmetic on the answer become one kernel; lists of pixels and images are NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from enfilade.camera import Camera
from enfilade.records import Shading


class Purpose(IntEnum):
    """What random numbers are drawn for: each purpose has a stream of its own."""

    REFERENCE = 0
    KEYFRAME = 1
    FILL = 2


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
        Diffuse reflectance, 0..1.
    item : UInt
        Number of the shape, from 1.
    surface : UInt
        ``records.SurfaceClass``.
    """

    is_hit: Any
    distance: Any
    normal: Any
    albedo: Any
    item: Any
    surface: Any


@dataclass(frozen=True)
class SceneFacts:
    """What a scene says about itself.

    Attributes
    ----------
    renderer : str
        Name and version of what traces.
    variant : str
        Of the renderer: what runs its kernels.
    items : tuple of str
        Name of item 1, 2, ...
    fingerprint : str
        SHA-256 over the scene's files: the same scene, the same letters.
    """

    renderer: str
    variant: str
    items: tuple[str, ...]
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
        *,
        spp: int,
        seed: int,
        frame: int,
        purpose: Purpose,
        pixel_filter: PixelFilter = PixelFilter.CENTRE,
    ) -> Shading:
        """Path trace a list of pixels, at a cost in proportion to the list.

        Parameters
        ----------
        camera
        pixels : (N,) uint32
            Flat indices ``y * width + x``.
        spp
            Paths a pixel.
        seed, frame, purpose
            The random numbers of a pixel depend on these, on the pixel and on the path's number, and
            on nothing else: not on the list, the chunking or the worker.
        pixel_filter
            Where in the image the paths of a pixel begin.

        Returns
        -------
        Shading
            Of shape (N,). Non-finite samples are left out and counted.
        """
        ...
