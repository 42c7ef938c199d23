"""Path guiding: directions towards bright surfaces that reflection alone rarely finds.

The inside of a lamp shade, a sunlit patch behind a door ajar: they light a room, and subtend a small solid
angle. A guide describes them as spheres. A sample of a lobe is replaced, with a probability that depends on
what the spheres contribute, by a uniform direction in the cone that a sphere subtends (Jensen 1995; Vorba et
al. 2014). The density of the mixture is known, so that expectations do not change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr

from enfilade.arrays import Array3f, Bool, Float, UInt

REGIONS = 8  # spheres of a guide
OCTANTS = 8  # around the centre of a sphere: lamp shades shine to one side
LEAST_ODDS = 3.0  # of the lobe against all cones: it is sampled in three of four cases or more
MAX_SINE = 0.99  # of the half angle of a cone; points nearer to a sphere, and inside, are not guided to it
MIN_VERSINE = 1e-5  # 1 - cosine of the half angle
BOUNDARY = 1e-3  # of the versine: directions so near to a cone count as inside, whatever their rounding


@dataclass(frozen=True)
class PathGuide:
    """Spheres that contain bright surfaces, on the device.

    Attributes
    ----------
    centers : Array3f
        World space, :data:`REGIONS` lanes.
    radii : Float
        Scene units.
    radiance : Float
        Mean luminance of a sphere as points in each octant around it see it: :data:`REGIONS` times
        :data:`OCTANTS` lanes. 0 if not used.
    background : Float
        Mean luminance of all other light; one lane.
    """

    centers: Any
    radii: Any
    radiance: Any
    background: Any

    def cones(self, position: Any, normal: Any) -> list[Cone]:
        """The cone of each sphere from surface points; arguments as of :class:`GuidedLobe`."""
        found = []
        for k in range(REGIONS):
            to = dr.gather(Array3f, self.centers, UInt(k)) - position
            inverse = dr.rcp(dr.maximum(dr.norm(to), 1e-20))
            axis, sine = to * inverse, dr.gather(Float, self.radii, UInt(k)) * inverse
            versine = dr.square(sine) / (1.0 + dr.sqrt(dr.maximum(1.0 - dr.square(sine), 0.0)))
            cosine = dr.clip(dr.dot(axis, normal) + sine, 0.0, 1.0)
            share = dr.select(sine < MAX_SINE, 2.0 * versine * cosine, 0.0)
            octant = sum((dr.select(of < 0.0, UInt(1 << i), 0) for i, of in enumerate(to)), UInt(0))
            found.append(Cone(axis, dr.maximum(versine, MIN_VERSINE), share, OCTANTS * k + octant))
        return found


@dataclass(frozen=True)
class Cone:
    """Directions from points towards a sphere, as lanes.

    Attributes
    ----------
    axis : Array3f
        World space, unit length.
    versine : Float
        1 - cosine of the half angle.
    share : Float
        Of the cosine-weighted hemisphere; 0 where a point is too near to the sphere.
    side : UInt
        Index of the sphere's radiance towards the points.
    """

    axis: Any
    versine: Any
    share: Any
    side: Any

    def contains(self, direction: Any) -> Any:
        """Whether directions (Array3f of unit length) are inside; Bool."""
        return 0.5 * dr.squared_norm(direction - self.axis) <= (1.0 + BOUNDARY) * self.versine


class GuidedLobe:
    """A mixture of a lobe and cones.

    A cone is sampled in proportion to its radiance times its share of the hemisphere, the lobe in proportion
    to the background, and at least in three of four cases.

    Parameters
    ----------
    guide
    position, normal : Array3f
        Of surface points, world space; the normal in the hemisphere of the light.
    """

    def __init__(self, guide: PathGuide, position: Any, normal: Any) -> None:
        self._cones = guide.cones(position, normal)
        weights = [dr.gather(Float, guide.radiance, cone.side) * cone.share for cone in self._cones]
        total = sum(weights, Float(0))
        scale = dr.rcp(dr.maximum(total + dr.maximum(guide.background, LEAST_ODDS * total), 1e-30))
        self._probabilities = [weight * scale for weight in weights]
        self._guided = total * scale

    def sample(self, choice: Any, sample_point: Any) -> tuple[Any, Any]:
        """Directions in the cones, and where one of these is chosen over the lobe.

        Parameters
        ----------
        choice : Float
            0..1.
        sample_point : Array2f
            In the unit square.

        Returns
        -------
        direction : Array3f
            World space, unit length.
        is_guided : Bool
        """
        axis, versine, first = Array3f(0, 0, 1), Float(1), Float(0)
        for cone, probability in zip(self._cones, self._probabilities, strict=True):
            is_chosen = (choice >= first) & (choice < first + probability)
            axis = dr.select(is_chosen, cone.axis, axis)
            versine = dr.select(is_chosen, cone.versine, versine)
            first += probability
        below = versine * sample_point.y  # 1 - cosine
        sine, angle = dr.sqrt(below * (2.0 - below)), dr.two_pi * sample_point.x
        tangent, bitangent = _basis(axis)
        direction = (1.0 - below) * axis + sine * (dr.cos(angle) * tangent + dr.sin(angle) * bitangent)
        return Array3f(direction), Bool(choice < first)

    def pdf(self, direction: Any, lobe_pdf: Any) -> Any:
        """Density of the mixture, per steradian; Float.

        Parameters
        ----------
        direction : Array3f
            World space, unit length.
        lobe_pdf : Float
            Density of the lobe.
        """
        density = (1.0 - self._guided) * lobe_pdf
        for cone, probability in zip(self._cones, self._probabilities, strict=True):
            uniform = probability * dr.rcp(dr.two_pi * cone.versine)
            density += dr.select(cone.contains(direction), uniform, 0.0)
        return density


def _basis(axis: Any) -> tuple[Any, Any]:
    """Two vectors orthogonal to an axis and to each other (Duff et al. 2017)."""
    sign = dr.copysign(Float(1), axis.z)
    a = dr.rcp(-(sign + axis.z))
    b = axis.x * axis.y * a
    tangent = Array3f(1.0 + sign * dr.square(axis.x) * a, sign * b, -(sign * axis.x))
    return tangent, Array3f(b, sign + dr.square(axis.y) * a, -axis.y)
