"""Records of the decoupled method: irradiance images of keyframes, and shaded frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from enfilade.arrays import to_float
from enfilade.records import F32, U8, Mask, Shading

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
    """

    direct: Shading
    indirect: Shading
    is_known: Mask

    def __post_init__(self) -> None:
        if self.is_known.shape != self.direct.variance.shape:
            raise ValueError(f"is_known is {self.is_known.shape}, expected {self.direct.variance.shape}")

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

    Attributes
    ----------
    color : (H, W, 3) float16
    deviation : (H, W) float16
        Standard deviation of the luminance.
    """

    color: F16
    deviation: F16


@dataclass(frozen=True, eq=False)
class ShadedFrame:
    """A frame before temporal accumulation.

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

    @property
    def specular(self) -> list[SpecularAov]:
        """The specular AOVs of the frame."""
        return [aov for aov in (self.reflection, self.transmission) if aov is not None]

    @property
    def color(self) -> F32:
        """Sum of all AOVs, (H, W, 3)."""
        return sum((to_float(aov.color) for aov in self.specular), to_float(self.diffuse))
