"""Records of the decoupled method: irradiance images of keyframes, and shaded frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from enfilade.arrays import to_float, to_half
from enfilade.records import F32, U8, Mask, Shading, check_array

F16 = npt.NDArray[np.float16]


@dataclass(frozen=True, eq=False)
class IrradianceImage:
    """Irradiance of the surfaces in an image.

    Attributes
    ----------
    direct, indirect : Shading
        Of shape (H, W): irradiance over pi, that is radiance reflected by the diffuse lobe at an albedo of
        one, from emitters directly and by all other light; 0 where it was not estimated.
    is_known : (H, W) bool
        Pixels whose irradiance was estimated.

    The variance of a denoised image is 0 everywhere; it is not smoothed again.
    """

    direct: Shading
    indirect: Shading
    is_known: Mask

    def __post_init__(self) -> None:
        check_array(self.is_known, self.direct.variance.shape, np.bool_, "is_known")
        check_array(self.indirect.variance, self.direct.variance.shape, np.float32, "indirect.variance")

    def with_noise(self, share: float) -> IrradianceImage:
        """A copy with its variances multiplied by a factor."""
        direct, indirect = (
            replace(layer, variance=np.float32(share) * layer.variance)
            for layer in (self.direct, self.indirect)
        )
        return replace(self, direct=direct, indirect=indirect)


@dataclass(frozen=True, eq=False)
class SpecularAov:
    """Radiance reflected or transmitted by specular lobes, before temporal accumulation.

    In a unit of the shot, near the radiance that is shown, for which half floats are precise.

    Attributes
    ----------
    color : (H, W, 3) float16
    deviation : (H, W) float16
        Standard deviation of the luminance.
    """

    color: F16
    deviation: F16

    def __post_init__(self) -> None:
        check_array(self.color, (*self.deviation.shape, 3), np.float16, "color")
        check_array(self.deviation, self.color.shape[:2], np.float16, "deviation")

    @staticmethod
    def of(color: F32, deviation: F32, unit: float) -> SpecularAov:
        """The AOV of radiance (H, W, 3) and its deviation (H, W); `unit` is stored as 1."""
        scale = np.float32(1.0 / unit)
        return SpecularAov(to_half(scale * color), to_half(scale * deviation))


@dataclass(frozen=True, eq=False)
class ShadedFrame:
    """A frame before temporal accumulation, in the units of :class:`SpecularAov`.

    Attributes
    ----------
    diffuse : (H, W, 3) float16
        Radiance emitted, reflected by diffuse lobes, and by specular lobes from sharp emitters.
    reflection : SpecularAov
    transmission : SpecularAov or None
        Straight through clear surfaces; None for frames without any.
    deviation : (H, W) float16
        Standard deviation of the luminance of refined pixels; 0 elsewhere.
    provenance : (H, W) uint8
        :class:`enfilade.records.Provenance`.
    """

    diffuse: F16
    reflection: SpecularAov
    transmission: SpecularAov | None
    deviation: F16
    provenance: U8

    def __post_init__(self) -> None:
        size = self.provenance.shape
        check_array(self.provenance, self.diffuse.shape[:2], np.uint8, "provenance")
        check_array(self.diffuse, (*size, 3), np.float16, "diffuse")
        check_array(self.deviation, size, np.float16, "deviation")
        for aov in self.specular:
            check_array(aov.deviation, size, np.float16, "deviation of a specular AOV")

    @property
    def specular(self) -> list[SpecularAov]:
        """The specular AOVs of the frame."""
        return [aov for aov in (self.reflection, self.transmission) if aov is not None]

    @property
    def color(self) -> F32:
        """Sum of all AOVs, (H, W, 3)."""
        return sum((to_float(aov.color) for aov in self.specular), to_float(self.diffuse))
