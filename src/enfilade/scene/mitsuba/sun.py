"""The sun of an environment: a small area of the sky with a considerable part of its flux."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import numpy.typing as npt
import scipy.ndimage

from enfilade.arrays import Array3f, Float, UInt, lanes, opaque
from enfilade.kernels.random import Discrete, one_sequence
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.records import F32

SEARCH_WIDTH = 1024  # of the latitude-longitude map in which the sun is searched: texels of 0.35 degrees
SAMPLES = 4096  # of the environment's own density, beside these
MAX_RADIUS = math.radians(2.5)  # the disc seen from the Earth has 0.27 degrees; many photographs blur it
MIN_SHARE = 0.05  # of the sky's flux
CONTAINED = 0.99  # of the flux within that radius, to be on the map
MARGIN = 1.0 / 32.0  # beyond it, as a part of the radius in which the flux is compared
TEXELS = 256  # of the map along each axis
SUBDIVIDED = 4  # parts of a texel along each axis, whose mean is its weight
LEAST_BESIDE = 0.25  # of the largest weight beside it: bounds the noise of texels that the sun's outline cuts


@dataclass(frozen=True)
class Sun:
    """A map of the sun in square texels, on the plane that touches the sphere of directions at its centre.

    Attributes
    ----------
    environment : mitsuba.Emitter
    frame : mitsuba.Frame3f
        Its normal points to the centre.
    extent : Float
        Of the map from the centre to each side: a tangent.
    texels : Discrete
        Flux of each texel, row by row.
    """

    environment: Any
    frame: Any
    extent: Any
    texels: Any

    @property
    def state(self) -> Any:
        """Arrays that the methods read."""
        return self.frame, self.extent, self.texels

    def contains(self, direction: Any) -> Any:
        """Whether directions (Vector3f, unit length) are on the map; Bool."""
        local = self.frame.to_local(direction)
        limit = self.extent * local.z
        return (local.z > 0.0) & (dr.abs(local.x) < limit) & (dr.abs(local.y) < limit)

    def pdf(self, direction: Any) -> Any:
        """Density of :meth:`sample` in directions on the map, per steradian; 0 in others; Float."""
        local = self.frame.to_local(direction)
        half = 0.5 * TEXELS
        column, row = (
            UInt(dr.clip((of / (local.z * self.extent) + 1.0) * half, 0.0, TEXELS - 1.0)) for of in local.xy
        )
        # Rays that are not active may have no direction: NaN becomes an index out of bounds.
        is_inside = self.contains(direction)
        pmf = dr.gather(Float, self.texels.pmf, row * TEXELS + column, is_inside)
        return dr.select(is_inside, pmf / self._solid_angle(local.z), 0.0)

    def _solid_angle(self, cosine: Any) -> Any:
        """Of a texel at an angle to the centre; Float."""
        return dr.square(self.extent * (2.0 / TEXELS)) * cosine**3

    def sample(self, sampler: Any) -> tuple[Any, Any, Any]:
        """A direction on the map (Vector3f), its radiance over its density (Color3f), and the density."""
        sample_point = sampler.next_2d()
        texel, across, pmf = self.texels.sample(sample_point.x)
        row = texel // TEXELS
        x = (Float(texel - row * TEXELS) + across) * (2.0 / TEXELS) - 1.0
        y = (Float(row) + sample_point.y) * (2.0 / TEXELS) - 1.0
        direction = mi.Vector3f(x * self.extent, y * self.extent, 1.0)
        cosine = dr.rsqrt(dr.squared_norm(direction))
        direction = self.frame.to_world(direction * cosine)
        density = pmf / self._solid_angle(cosine)
        return direction, _radiance(self.environment, direction) / density, density


def find_sun(environment: Any) -> Sun | None:
    """Find the sun of an environment.

    Parameters
    ----------
    environment : mitsuba.Emitter or None

    Returns
    -------
    Sun or None
        None where no direction within 2.5 degrees of the brightest one stands out.
    """
    if environment is None:
        return None
    # Find the brightest direction of the sphere.
    step = 2.0 * math.pi / SEARCH_WIDTH
    polar, azimuth = (np.mgrid[0 : SEARCH_WIDTH // 2, 0:SEARCH_WIDTH] + 0.5).reshape(2, -1) * step
    sine = np.sin(polar)
    directions = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)], axis=1)
    sky = _luminance(environment, mi.Vector3f(lanes(directions.astype(np.float32)[None])))
    frame = _facing(_brightest(environment, directions, sky))

    # Compare the flux around it, beyond that of its surroundings, with that of the sphere. A disc may be
    # smaller than the texels of a map.
    for limit in math.tan(MAX_RADIUS) / np.array([1.0, 4.0, 16.0]):
        x, y, luminance = _map(environment, frame, limit)
        excess = np.where(np.hypot(x, y) < limit, luminance - luminance.min(), 0.0)
        flux = float(excess.sum()) * (2.0 * limit / TEXELS) ** 2
        if flux > MIN_SHARE * float(np.dot(sky, sine)) * step**2:
            break
    else:
        return None

    # Map the disc alone.
    x_centre, y_centre = (float(np.average(axis, weights=excess)) for axis in (x, y))
    distance = np.hypot(x - x_centre, y - y_centre)
    order = np.argsort(distance)
    contained = np.cumsum(excess[order]) / excess.sum()
    radius = distance[order][np.searchsorted(contained, CONTAINED)] + MARGIN * limit
    frame = _facing(np.array(frame.to_world(mi.Vector3f(x_centre, y_centre, 1.0))).ravel())
    _, _, luminance = _map(environment, frame, float(radius), SUBDIVIDED)
    # Texels at the outline may be brighter elsewhere than where they were evaluated.
    weights = luminance.reshape(TEXELS, SUBDIVIDED, TEXELS, SUBDIVIDED).mean(axis=(1, 3), dtype=np.float64)
    least = np.maximum(LEAST_BESIDE * scipy.ndimage.maximum_filter(weights, 3), 1e-6 * weights.max())
    texels = Discrete.of(np.maximum(weights, least).ravel())
    return Sun(environment, frame, opaque(float(radius)), texels)


def _brightest(environment: Any, directions: npt.NDArray[np.float64], sky: F32) -> Any:
    """The brightest direction of a grid of known luminances, and of samples by the environment's own density.

    The samples find discs between the directions of the grid.
    """
    si = dr.zeros(mi.SurfaceInteraction3f, SAMPLES)
    sample, _ = environment.sample_direction(si, mi.Point2f(one_sequence(SAMPLES).next_2d()))
    found = _luminance(environment, sample.d)
    if found.max() > sky.max():
        return np.array(sample.d).T[np.argmax(found)]
    return directions[np.argmax(sky)]


def _map(environment: Any, frame: Any, extent: float, subdivided: int = 1) -> tuple[F32, F32, F32]:
    """Coordinates of the texels of a map, or of parts of them, and the luminance there, (N,) each."""
    parts = subdivided * TEXELS
    along = (((np.arange(parts) + 0.5) * (2.0 / parts) - 1.0) * extent).astype(np.float32)
    x, y = np.tile(along, parts), np.repeat(along, parts)
    directions = mi.Vector3f(lanes(x), lanes(y), 1.0)
    return x, y, _luminance(environment, frame.to_world(dr.normalize(directions)))


def _facing(direction: Any) -> Any:
    found = mi.Frame3f(dr.normalize(mi.Vector3f(*(float(axis) for axis in direction))))
    dr.make_opaque(found)
    return found


def _luminance(environment: Any, directions: Any) -> F32:
    radiance = Array3f(_radiance(environment, directions)) + dr.zeros(Array3f, dr.width(directions))
    found: F32 = np.array(dr.dot(radiance, Array3f(*REC709_LUMINANCE)))
    return found


def _radiance(environment: Any, direction: Any) -> Any:
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(direction))
    si.wi = -direction
    return environment.eval(si)
