"""The guide of a keyframe: surfaces beside lamps that light the scene, and that reflection rarely finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt

from enfilade.arrays import Array3f, Bool, UInt, lanes, opaque, rows
from enfilade.kernels.guiding import LEAST_ODDS, OCTANTS, REGIONS, PathGuide
from enfilade.kernels.random import samplers
from enfilade.kernels.rays import camera_rays, pixel_centres, points_at
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.decoupled.paths import Path, spawn
from enfilade.records import F32, F64, Geometry
from enfilade.renderer import LobeRenderer, Photons, RandomKey

PIXELS, PATHS = 512, 4  # that probe the scene for each size of regions: pixels, and paths of each
MORE_PATHS = 32  # ... of each pixel that measure the regions of a guide that is used
HALVINGS = range(3, 7)  # of the extent of the photons: sizes of the voxels that group them
MIN_PHOTONS = 8  # in a voxel
WIDTH = 1.5  # radius of a region over the root mean square distance from its centre, which is 1.41 of a disk
OUTLIER = 16  # times the mean light: brighter paths are limited
MAX_MOMENT_RATIO = 0.4  # second moment with a guide over that without: a guide of a larger one is not used


@dataclass(frozen=True, eq=False)
class Regions:
    """Spheres that contain bright surfaces, with their radiance.

    Attributes
    ----------
    spheres : (N, 4) float64
        Centre in world space, and radius, scene units; at most :data:`REGIONS`.
    radiance : (N, 8) float64
        Mean luminance as points in each octant around the centre see it.
    background : float
        Mean luminance of all other light.
    """

    spheres: F64
    radiance: F64
    background: float

    @staticmethod
    def from_json(stored: list[list[float]]) -> Regions | None:
        """Regions of :meth:`to_json`; None of an empty list."""
        if not stored:
            return None
        *of_spheres, (background,) = stored
        table = np.array(of_spheres)
        return Regions(table[:, :4], table[:, 4:], background)

    def to_json(self) -> list[list[float]]:
        """A row of each sphere and its radiance, then one of the background."""
        return [*np.hstack([self.spheres, self.radiance]).tolist(), [self.background]]

    def upload(self) -> PathGuide:
        """Upload them as a guide."""
        table = np.zeros((REGIONS, 4 + OCTANTS), np.float32)
        table[: len(self.spheres)] = np.hstack([self.spheres, self.radiance])
        guide = PathGuide(
            lanes(table[None, :, :3]), lanes(table[:, 3]), lanes(table[:, 4:]), opaque(self.background)
        )
        dr.make_opaque(guide)
        return guide


@dataclass(frozen=True)
class Probes:
    """Paths from surfaces by their diffuse lobe, with a guide; as lanes.

    Attributes
    ----------
    light : Float
        Luminance that the surface receives over pi, as the path estimates it, other than from emitters.
    shares : tuple of Float
        Of each region in the cosine-weighted hemisphere of the surface.
    sides : tuple of UInt
        Index of each region's radiance towards the surface.
    region : UInt
        The first region from which the light comes; their number for other light.
    is_used : Bool
    """

    light: Any
    shares: tuple[Any, ...]
    sides: tuple[Any, ...]
    region: Any
    is_used: Any


def trace_probes(renderer: LobeRenderer, guide: PathGuide, path: Path) -> Probes:
    """Estimate the light on the surfaces that paths meet, half of them after another bounce; a kernel."""
    sampler = path.sampler.copy()
    point = renderer.intersect(path.rays, opaque_only=True)
    bounced = renderer.sample_diffuse(point, sampler)
    point = renderer.intersect(dr.select((path.lane & 1) == 0, path.rays, bounced.rays), opaque_only=True)
    sample = renderer.sample_diffuse(point, sampler.copy(), guide=guide)  # that of the estimate, too
    _, indirect = renderer.estimate_diffuse(point, sampler, path_depth=2, guide=guide)
    light, region = dr.dot(indirect, Array3f(*REC709_LUMINANCE)), UInt(REGIONS)
    cones = guide.cones(point.position, point.surfaces.normal)
    for k, cone in reversed(list(enumerate(cones))):
        region = dr.select(cone.contains(sample.rays.direction), k, region)
    return Probes(
        light=dr.select(sample.is_alive, light, 0.0),
        shares=tuple(cone.share for cone in cones),
        sides=tuple(cone.side for cone in cones),
        region=region,
        is_used=Bool(point.surfaces.is_hit & dr.isfinite(light)),
    )


def find_regions(
    photons: Photons,
    probe: Callable[[PathGuide, Path], Probes],
    geometry: Geometry,
    random: RandomKey,
) -> tuple[Regions | None, int]:
    """Find the regions of a guide from a keyframe.

    Groups of photons in voxels of several sizes are proposed, and the light from there is estimated.

    Parameters
    ----------
    photons
    probe
        :func:`trace_probes` of a renderer, recorded.
    geometry
        G-buffer of the prepass image.
    random

    Returns
    -------
    regions : Regions or None
        None if no guide is of use.
    traced : int
        Number of paths.
    """
    pixels = np.flatnonzero(geometry.has_diffuse).astype(np.uint32)
    if not len(pixels) or len(photons.flux) < MIN_PHOTONS:
        return None, 0

    # Take pixels at equal distances in the image.
    pixels = pixels[np.linspace(0, len(pixels) - 1, PIXELS).astype(np.int64)]
    depths = lanes(geometry.depth.ravel()[pixels])
    position = rows(points_at(geometry.camera, depths, lanes(pixels)))
    normal = geometry.normal.reshape(-1, 3)[pixels]

    def probed(guide: PathGuide, paths: int) -> Probes:
        lane, path = lanes(np.repeat(pixels, paths)), np.tile(np.arange(paths, dtype=np.uint32), PIXELS)
        rays = camera_rays(geometry.camera, pixel_centres(geometry.camera, lane))
        return probe(guide, spawn(rays, samplers(lane, lanes(path), random), spread=0.0))

    # Propose regions of several sizes, the largest first: small ones cover a part of what is bright.
    traced = 0
    corner, extent = photons.position.min(axis=0), max(float(np.ptp(photons.position, axis=0).max()), 1e-9)
    for halvings in HALVINGS:
        count = 2**halvings + 1  # along each axis
        voxel = ((photons.position - corner) * ((count - 1) / extent)).astype(np.int64) @ (1, count, count**2)
        proposed = _proposed(photons, voxel, position, normal)
        if proposed is None:
            continue
        guide = proposed.upload()
        for paths in (PATHS, MORE_PATHS):
            regions, moment_ratio = _measured(probed(guide, paths), proposed)
            traced += PIXELS * paths
            if moment_ratio > MAX_MOMENT_RATIO:
                break
        else:
            return regions, traced
    return None, traced


def _proposed(photons: Photons, voxel: npt.NDArray[np.int64], position: F32, normal: F32) -> Regions | None:
    """Spheres around the groups that may contribute most to the second moment of the light on some points.

    With the radiance of their photons, the same to all sides; None if no group has enough photons.
    """
    # Describe the groups.
    _, group, counts = np.unique(voxel, return_inverse=True, return_counts=True)
    flux = np.bincount(group, photons.flux)
    mean = np.stack([np.bincount(group, photons.flux * axis) / flux for axis in photons.position.T], axis=1)
    spread = np.bincount(group, photons.flux * np.square(photons.position - mean[group]).sum(axis=1)) / flux
    chosen = (counts >= MIN_PHOTONS) & (spread > 0.0)
    center, radius = mean[chosen], WIDTH * np.sqrt(spread[chosen])
    radiance = flux[chosen] / np.square(np.pi * radius)

    # Take the brightest as they are seen from the points, without occluders.
    to = center[None] - position[:, None].astype(np.float64)
    distance = np.maximum(np.linalg.norm(to, axis=2), radius)
    cosine = np.maximum((to * normal[:, None]).sum(axis=2) / distance, 0.0)
    share = (np.square(radius / distance) * cosine).mean(axis=0)
    order = np.argsort(-np.square(radiance) * share, kind="stable")[:REGIONS]
    if not len(order):
        return None
    sides = np.repeat(radiance[order, None], OCTANTS, axis=1)
    return Regions(np.hstack([center[order], radius[order, None]]), sides, background=0.0)


def _measured(probes: Probes, proposed: Regions) -> tuple[Regions, float]:
    """Regions with their measured radiance, and the second moment with this guide over that without one."""
    used = np.flatnonzero(np.array(probes.is_used))
    if not len(used):
        return proposed, 1.0

    def taken(values: Any) -> Any:
        return np.array(values)[used]

    # Estimate the radiance of each side of each region, and the light from elsewhere.
    light = taken(probes.light).astype(np.float64)
    light = np.minimum(light, OUTLIER * light.mean())
    share, side = np.stack(list(map(taken, probes.shares))), np.stack(list(map(taken, probes.sides)))
    region, lane = taken(probes.region), np.arange(len(used))
    found = np.zeros(REGIONS * OCTANTS)
    is_from = region < REGIONS
    np.add.at(found, side[region[is_from], lane[is_from]], light[is_from])
    seen = np.bincount(side.ravel(), share.ravel(), REGIONS * OCTANTS)
    found[seen == 0.0] = 0.0  # of points inside of a region, from which no cone to it is sampled
    radiance = np.maximum(found, 0.0) / np.maximum(seen, 1e-12)
    background = max(float(light[~is_from].sum()) / len(used), 0.0)

    # Compare the second moments: with a uniform radiance of each side, and of the background.
    rest = np.maximum(1.0 - share.sum(axis=0), 0.0)
    dim = background / max(float(rest.mean()), 1e-12)
    weights = radiance[side] * share
    plain = (radiance[side] * weights).sum(axis=0) + dim**2 * rest
    total = weights.sum(axis=0)
    guided = weights / np.maximum(total + np.maximum(background, LEAST_ODDS * total), 1e-30)
    own = 1.0 - guided.sum(axis=0)
    moments = np.square(weights) / np.maximum(own * share + guided, 1e-30)
    mixed = moments.sum(axis=0) + dim**2 * rest / own
    spheres = proposed.spheres
    regions = Regions(spheres, radiance.reshape(REGIONS, OCTANTS)[: len(spheres)], background)
    return regions, float(mixed.mean() / plain.mean()) if plain.any() else 1.0
