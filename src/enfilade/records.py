"""Records passed between stages: frozen dataclasses of arrays, which check their shapes.

Images are NumPy arrays of shape (H, W) or (H, W, C), row 0 at the top. Validity is a mask beside the
values, never a NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from enfilade.camera.pinhole import Camera

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
U32 = npt.NDArray[np.uint32]
U8 = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]


class SurfaceClass(IntEnum):
    """Class of a surface by the lobes of its material; of two that apply, the later one."""

    NONE = 0
    DIFFUSE = 1
    EMISSIVE = 2
    GLOSSY = 3
    MIRROR = 4
    TRANSPARENT = 5


SPECULAR = (SurfaceClass.GLOSSY, SurfaceClass.MIRROR, SurfaceClass.TRANSPARENT)
MIN_DIFFUSE_ALBEDO = 1e-4  # below it a surface counts as having no diffuse lobe


class Provenance(IntEnum):
    """The origin of a pixel's value."""

    KEYFRAME = 0
    REUSED = 1
    SLOW = 2
    SPECULAR = 3
    DISOCCLUDED = 4


@dataclass(frozen=True, eq=False)
class Geometry:
    """The G-buffer of one frame: the surfaces visible at the pixels' centres.

    Attributes
    ----------
    camera : Camera
    depth : (H, W) float32
        Distance along the optical axis, scene units; 0 where nothing is hit.
    normal : (H, W, 3) float32
        Shading normal in the world, unit length, towards the camera; 0 where nothing is hit.
    albedo : (H, W, 3) float32
        Diffuse reflectance seen from there, a coat included, 0..1.
    shape_index : (H, W) uint32
        Number of the shape that is seen, from 1; 0 where nothing is hit (the item buffer, §4.3).
    surface : (H, W) uint8
        :class:`SurfaceClass`.
    """

    camera: Camera
    depth: F32
    normal: F32
    albedo: F32
    shape_index: U32
    surface: U8

    def __post_init__(self) -> None:
        size = (self.camera.height, self.camera.width)
        check_array(self.depth, size, np.float32, "depth")
        check_array(self.normal, (*size, 3), np.float32, "normal")
        check_array(self.albedo, (*size, 3), np.float32, "albedo")
        check_array(self.shape_index, size, np.uint32, "shape_index")
        check_array(self.surface, size, np.uint8, "surface")

    @property
    def is_hit(self) -> Mask:
        """Pixels that see a surface."""
        return self.shape_index > 0

    @property
    def has_diffuse(self) -> Mask:
        """Pixels that see a diffuse surface, (H, W): those that show the light that falls on it."""
        has_diffuse: Mask = self.is_hit & (self.albedo.max(axis=2) > MIN_DIFFUSE_ALBEDO)
        return has_diffuse

    @property
    def disparity(self) -> F32:
        """One over the depth, (H, W); 0 where nothing is hit: at infinity."""
        return np.divide(1.0, self.depth, out=np.zeros_like(self.depth), where=self.is_hit)

    @property
    def is_specular(self) -> Mask:
        """Pixels that see a glossy, mirroring or transparent surface."""
        return np.isin(self.surface, SPECULAR)


@dataclass(frozen=True, eq=False)
class Flow:
    """Image flow of one frame (§3.3, Fig. 5): motion of each pixel's surface point, pixels per frame.

    Attributes
    ----------
    backward, forward : (H, W, 2) float32
        Displacement to the previous and to the next frame, x right, y down; 0 where there is none.
    has_backward, has_forward : bool
        Whether there is such a frame in the same shot.
    """

    backward: F32
    forward: F32
    has_backward: bool
    has_forward: bool

    def __post_init__(self) -> None:
        check_array(self.backward, (*self.forward.shape[:2], 2), np.float32, "backward")
        check_array(self.forward, (*self.backward.shape[:2], 2), np.float32, "forward")

    @property
    def motion(self) -> F32:
        """Signed motion, the mean of forward and negated backward flow, (H, W, 2) pixels per frame."""
        count = max(self.has_backward + self.has_forward, 1)
        mean: F32 = (self.forward - self.backward) / np.float32(count)
        return mean

    @property
    def speed(self) -> F32:
        """Mean of the magnitudes to the previous and the next frame (§3.3), (H, W) pixels per frame."""
        count = max(self.has_backward + self.has_forward, 1)
        back = np.hypot(self.backward[..., 0], self.backward[..., 1])
        ahead = np.hypot(self.forward[..., 0], self.forward[..., 1])
        mean: F32 = np.asarray((back + ahead) / count, np.float32)
        return mean


@dataclass(frozen=True, eq=False)
class Shading:
    """Traced colours of an image or of a list of pixels.

    Attributes
    ----------
    color : (..., 3) float32
        Linear Rec.709 radiance.
    variance : (...) float32
        Variance of the mean of the luminance, estimated from its paths; 0 where spp is 1.
    dropped : int
        Samples that were NaN or infinite and were left out.
    """

    color: F32
    variance: F32
    dropped: int = 0

    def __post_init__(self) -> None:
        check_array(self.color, (*self.variance.shape, 3), np.float32, "color")
        check_array(self.variance, self.color.shape[:-1], np.float32, "variance")

    def to_image(self, where: Mask) -> Shading:
        """Scatter the values of a list of pixels, those of a mask (H, W), into an image; 0 elsewhere."""
        color, variance = np.zeros((*where.shape, 3), np.float32), np.zeros(where.shape, np.float32)
        color[where], variance[where] = self.color, self.variance
        return Shading(color, variance, self.dropped)


@dataclass(frozen=True, eq=False)
class Halves:
    """An image in two halves, of independent paths: what both show is no noise.

    Attributes
    ----------
    first, second : (H, W, 3) float32
        Linear Rec.709 radiance.
    dropped : int
        Samples that were NaN or infinite and were left out.
    """

    first: F32
    second: F32
    dropped: int = 0

    def __post_init__(self) -> None:
        check_array(self.first, (*self.second.shape[:2], 3), np.float32, "first")
        check_array(self.second, self.first.shape, np.float32, "second")

    @property
    def color(self) -> F32:
        """Mean of both halves, (H, W, 3)."""
        mean: F32 = np.float32(0.5) * (self.first + self.second)
        return mean


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame that is traced whole."""

    geometry: Geometry
    shading: Halves


@dataclass(frozen=True, eq=False)
class Warped:
    """A keyframe reprojected to another camera (§2.2). All values of disoccluded pixels are 0.

    Attributes
    ----------
    shading : Halves
    depth : (H, W) float32
        From the new camera.
    shape_index : (H, W) uint32
        0 where the keyframe shows the sky.
    magnification : (H, W) float32
        Area of the keyframe's pixel in pixels of the new image.
    footprint : (H, W) float32
        Extent of the surface that the pixel averages: variance along an axis, square pixels of the new image.
    is_disoccluded : (H, W) bool
        Pixels without a splat; the paper calls them holes.
    is_mixed : (H, W) bool
        Pixels from an outline in the keyframe: their colour may have a share of another surface.
    """

    shading: Halves
    depth: F32
    shape_index: U32
    magnification: F32
    footprint: F32
    is_disoccluded: Mask
    is_mixed: Mask

    def __post_init__(self) -> None:
        size = self.is_disoccluded.shape
        check_array(self.shading.first, (*size, 3), np.float32, "shading.first")
        check_array(self.depth, size, np.float32, "depth")
        check_array(self.shape_index, size, np.uint32, "shape_index")
        check_array(self.magnification, size, np.float32, "magnification")
        check_array(self.footprint, size, np.float32, "footprint")
        check_array(self.is_mixed, size, np.bool_, "is_mixed")

    @property
    def color(self) -> F32:
        """Mean of both halves, (H, W, 3)."""
        return self.shading.color


@dataclass(frozen=True, eq=False)
class Frame:
    """The colours of a frame, and the origin of each pixel's value.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear Rec.709 radiance.
    provenance : (H, W) uint8
        :class:`Provenance`.
    """

    color: F32
    provenance: U8

    def __post_init__(self) -> None:
        check_array(self.color, (*self.provenance.shape, 3), np.float32, "color")
        check_array(self.provenance, self.color.shape[:2], np.uint8, "provenance")

    @property
    def counts(self) -> dict[str, int]:
        """Number of pixels by provenance, by its name in lower case."""
        counts = np.bincount(self.provenance.ravel(), minlength=len(Provenance))
        return {of.name.lower(): int(counts[of]) for of in Provenance}


def check_array(array: npt.NDArray[Any], shape: tuple[int, ...], kind: type, name: str) -> None:
    """Raise ValueError unless an array has a shape and a type."""
    if array.shape != shape or array.dtype != kind:
        raise ValueError(f"{name} is {array.dtype} {array.shape}, expected {np.dtype(kind)} {shape}")
