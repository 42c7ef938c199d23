"""The cache: pages of arriving light, ready to be looked up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, image, lanes, matrix3, opaque, pixel_grid, vector3
from enfilade.irradiance.cells import Cells
from enfilade.pixels.estimate import GAUSSIAN_SIGMA_PX, LUMINANCE
from enfilade.pixels.lookup import Page, footprint, lookup, packed
from enfilade.pixels.rays import pinhole_directions
from enfilade.pixels.wavelet import Guide, smooth, with_soft_edges, with_spread_speckles, without_speckles
from enfilade.records import F32, U32, Geometry, LightPage, Mask, Shading

BEHIND = np.uint32(1 << 30)  # added to the number of an item that is seen in a mirror or through glass
PLANE_TOLERANCE = 0.01  # of the depth
KNOWN = 0.02  # least weight of all taps together at which a surface counts as known

EVEN = 0.5  # of the spread of rays that share out their directions evenly counts as noise
SPECKLE = 2.0  # times the brightest of its neighbours, of a page the second brightest, that a pixel may be
SPECKLE_LEVELS = 5  # of the wavelet that spreads what is more in a page
LEVELS = 4  # of the wavelet that smooths a page
DEVIATIONS = 3.0  # of the luminance, across which it smooths
APART = 3.0  # deviations by which frames may differ that are averaged
NORMAL_EXPONENT = 64.0  # light on surfaces that are turned by 12 degrees mixes by a quarter


@dataclass(frozen=True)
class LightCache:
    """What several pages know of the light; empty, it knows nothing, and every lookup is a miss.

    Attributes
    ----------
    pages : tuple of Page
    shares : tuple of Float
        How much each counts where several know a surface.
    cells : Cells or None
        What is known of surfaces that no page sees.
    """

    pages: tuple[Page, ...] = ()
    shares: tuple[Any, ...] = ()
    cells: Cells | None = None

    def find(self, position: Any, normal: Any, item: Any) -> tuple[Any, Any]:
        """Light at points of surfaces.

        Parameters
        ----------
        position, normal : Array3f
        item : UInt

        Returns
        -------
        light : Array3f
            Radiance that the diffuse lobe would send if the albedo were one; 0 where unknown.
        is_known : Bool
        """
        total, weight = Array3f(0), Float(0)
        known = Float(0)
        for page, share in zip(self.pages, self.shares, strict=True):
            found = lookup(position, normal, item, page, plane_tolerance=PLANE_TOLERANCE)
            total += share * sum(found.totals, Array3f(0))
            weight += share * found.weight
            known += dr.select(share > 0.0, found.weight, 0.0)
        is_known = known > KNOWN
        return dr.select(is_known, total / weight, 0.0), is_known


def open_cache(pages: Sequence[Page], shares: Sequence[float], cells: Cells | None = None) -> LightCache:
    """Pages, and how much each counts where several know a surface; and cells for what none sees."""
    return LightCache(tuple(pages), tuple(opaque(float(share)) for share in shares), cells)


def open_page(page: LightPage) -> Page:
    """Make a page ready to be looked up."""
    guide = _guide(page.geometry, np.where(page.is_known, page.geometry.item, np.uint32(0)))
    indirect = lanes(page.indirect.color), lanes(page.indirect.variance)
    indirect = with_spread_speckles(*indirect, guide, times=SPECKLE, levels=SPECKLE_LEVELS)
    direct = lanes(page.direct.color), lanes(page.direct.variance)
    return _page(page.geometry, lanes(page.is_known), [direct, indirect])


def pooled(page: LightPage, around: Sequence[Page], denoised: Callable[[F32], F32] | None = None) -> Page:
    """What all pages together know of the surfaces of one, smoothed along them.

    Light that falls on a surface does not depend on who looks: each page that sees a point has an estimate
    of its own. Those of coarser resolution count less.

    Parameters
    ----------
    page
    around
        Pages opened, the one itself among them.
    denoised
        Takes an image of light, (H, W, 3), and takes the noise out of it; None smooths along surfaces.

    Direct light, which has edges, is smoothed apart from indirect light, which has more noise.

    Returns
    -------
    Page
        Opened, of one layer; known where ``page`` is.
    """
    layers, _ = _gathered(page.geometry, around, [1.0] * len(around))
    if denoised is None:
        groups = np.where(page.is_known, page.geometry.item, np.uint32(0))
        smoothed = [_smooth(page.geometry, groups, light, variance) for light, variance in layers]
    else:
        size = page.is_known.shape
        smoothed = [(lanes(denoised(image(light, *size))), variance) for light, variance in layers]
    light = sum((light for light, _ in smoothed), Array3f(0))
    variance = sum((variance for _, variance in smoothed), Float(0))
    return _page(page.geometry, lanes(page.is_known), [(light, variance)])


def light_of(page: Page) -> F32:
    """The light that a page knows, all layers together, (H, W, 3); 0 where it knows none."""
    return image(sum(page.values, Array3f(0)), page.height, page.width)


def smoothed(geometry: Geometry, shading: Shading, where: Mask) -> Shading:
    """Smooth what surfaces scatter, along them, as far as its noise asks for; with the noise that is left.

    Parameters
    ----------
    geometry
        Of the frame, with virtual images (:class:`~enfilade.irradiance.virtual.VirtualImages`).
    shading : Shading
        (H, W).
    where : (H, W) bool
        Pixels that were asked. Others of the same items have nothing to tell them.
    """
    # Virtual images: their normals are not those of the planes in which they seem to lie.
    geometry = replace(geometry, depth=np.where(geometry.item < BEHIND, geometry.depth, np.float32(0)))
    noise = EVEN * lanes(shading.variance)
    groups = np.where(where, geometry.item, np.uint32(0))
    light, variance = _smooth(geometry, groups, _without_speckles(shading), noise)
    size = shading.variance.shape
    light = with_soft_edges(
        light, lanes(geometry.item), width=size[1], height=size[0], sigma=GAUSSIAN_SIGMA_PX
    )
    return Shading(image(light, *size), image(variance, *size), shading.dropped)


@dataclass(frozen=True, eq=False)
class Sight:
    """What lobes scatter in a frame, with where it seems to be.

    Attributes
    ----------
    geometry : Geometry
        Of the frame, with virtual images (:class:`~enfilade.irradiance.virtual.VirtualImages`).
    page : Page
        The light, as :func:`open_scattered` made it.
    """

    geometry: Geometry
    page: Page


def open_scattered(geometry: Geometry, scattered: Shading, where: Mask) -> Sight:
    """Make what lobes scatter ready for :func:`over_time`.

    Parameters
    ----------
    geometry
        Of the frame, with virtual images (:class:`~enfilade.irradiance.virtual.VirtualImages`).
    scattered : Shading
        Smoothed, with the noise that is left, (H, W).
    where : (H, W) bool
        Pixels that have it.
    """
    layers = [(lanes(scattered.color), lanes(scattered.variance))]
    return Sight(geometry, _page(geometry, lanes(where), layers, has_normals=False))


def over_time(here: Sight, others: Sequence[tuple[Sight, float]]) -> F32:
    """Average what surfaces scatter with what frames around saw of it, each along its own motion.

    A virtual image is looked up where it seemed to be. What differs from the frame's own value by more than
    its noise counts less: highlights and reflections in rough surfaces stay where they are.

    Parameters
    ----------
    here
        Of the frame itself.
    others
        Of frames around it, and how much each counts; the frame itself counts one.

    Returns
    -------
    (H, W, 3) float32
        0 where the frame has none.
    """
    own = here.page
    (color,), (variance,) = own.values, own.variances
    position, normal = _points(here.geometry, own.depths), _fronts(here)
    total, weight = Array3f(color), dr.ones(Float, dr.width(color))
    luminance = dr.dot(color, Array3f(*LUMINANCE))
    dr.eval(position, normal, total, weight, luminance)
    for other, share in others:
        found = lookup(position, normal, own.items, other.page, plane_tolerance=PLANE_TOLERANCE)
        scale = dr.rcp(dr.maximum(found.weight, 1e-6))
        value, noise = found.totals[0] * scale, found.variances[0] * scale
        apart = dr.abs(dr.dot(value, Array3f(*LUMINANCE)) - luminance)
        counts = dr.exp(-apart * dr.rcp(APART * dr.sqrt(noise + variance) + 1e-8))
        counts = dr.select(found.weight > KNOWN, opaque(share) * counts, 0.0)
        total += counts * value
        weight += counts
        dr.eval(total, weight)  # so that one kernel serves any number of frames
    return image(total / weight, own.height, own.width)


def _fronts(sight: Sight) -> Any:
    """Normals; of virtual images, those of planes that face the eye."""
    geometry, page = sight.geometry, sight.page
    toward = vector3(geometry.camera.eye) - _points(geometry, page.depths)
    return dr.select(page.items < BEHIND, lanes(geometry.normal), toward)


def _without_speckles(shading: Shading) -> Any:
    height, width = shading.variance.shape
    return without_speckles(lanes(shading.color), width=width, height=height, times=SPECKLE)


def _smooth(geometry: Geometry, groups: U32, light: Any, variance: Any) -> tuple[Any, Any]:
    return smooth(light, variance, _guide(geometry, groups), levels=LEVELS, deviations=DEVIATIONS)


def _guide(geometry: Geometry, groups: U32) -> Guide:
    return Guide(
        depths=lanes(geometry.depth),
        normals=lanes(geometry.normal),
        items=lanes(groups),
        direction_from_pixel=matrix3(geometry.camera.direction_from_pixel),
        width=geometry.camera.width,
        height=geometry.camera.height,
        plane_tolerance=PLANE_TOLERANCE,
        normal_exponent=NORMAL_EXPONENT,
    )


def known(geometry: Geometry, pages: Sequence[Page]) -> Mask:
    """Pixels of a view of which some page knows the light, (H, W)."""
    _, is_known = _gathered(geometry, pages, [1.0] * len(pages))
    return image(is_known, *geometry.item.shape)


def seen_from(geometry: Geometry, pages: Sequence[Page], shares: Sequence[float]) -> Page:
    """What pages know of all that a view sees: a page of its own, which its camera rays look up."""
    layers, is_known = _gathered(geometry, pages, shares)
    return _page(geometry, is_known, layers)


def _gathered(
    geometry: Geometry, pages: Sequence[Page], shares: Sequence[float]
) -> tuple[list[tuple[Any, Any]], Any]:
    """Light at what the pixels' centres of a view see, with its variance, by layer; and where it is known."""
    position, normal, item = (
        _points(geometry, lanes(geometry.depth)),
        lanes(geometry.normal),
        lanes(geometry.item),
    )
    camera = geometry.camera
    own = footprint(position, normal, vector3(camera.eye), matrix3(camera.direction_from_pixel))
    layers = range(len(pages[0].values))
    totals, variances = [Array3f(0) for _ in layers], [Float(0) for _ in layers]
    weight, known = Float(0), Float(0)
    dr.eval(position, own)
    for page, share in zip(pages, shares, strict=True):
        found = lookup(position, normal, item, page, plane_tolerance=PLANE_TOLERANCE)
        its = footprint(position, normal, page.eye, page.direction_from_pixel)
        counts = opaque(float(share)) * dr.minimum(own / its, 1.0)
        for layer in layers:
            totals[layer] += counts * found.totals[layer]
            variances[layer] += counts * counts * found.variances[layer] * found.weight
        weight += counts * found.weight
        known += found.weight
        dr.eval(totals, variances, weight, known)  # so that one kernel serves any number of pages
    is_known = known > KNOWN
    light = [dr.select(is_known, total / weight, 0.0) for total in totals]
    variance = [dr.select(is_known, v / (weight * weight), 0.0) for v in variances]
    dr.eval(light, variance, is_known)
    return list(zip(light, variance, strict=True)), is_known


def _points(geometry: Geometry, depths: Any) -> Any:
    """Where pixels' centres meet surfaces at some depths, in the world."""
    camera = geometry.camera
    _, column, row = pixel_grid(camera.height, camera.width)
    direction = pinhole_directions(
        Float(column) + 0.5, Float(row) + 0.5, direction_from_pixel=matrix3(camera.direction_from_pixel)
    )
    return vector3(camera.eye) + depths * direction


def _page(
    geometry: Geometry, is_known: Any, layers: Sequence[tuple[Any, Any]], *, has_normals: bool = True
) -> Page:
    """A page in memory of Dr.Jit's own: what shares NumPy's can't be freed while a kernel is recorded."""
    camera = geometry.camera
    page = Page(
        depths=dr.select(is_known, lanes(geometry.depth), 0.0),
        items=dr.select(is_known, lanes(geometry.item), 0),
        normals=packed(lanes(geometry.normal)) if has_normals else None,
        values=tuple(dr.select(is_known, light, 0.0) for light, _ in layers),
        variances=tuple(dr.select(is_known, variance, 0.0) for _, variance in layers),
        eye=vector3(camera.eye),
        direction_from_pixel=matrix3(camera.direction_from_pixel),
        pixel_from_direction=matrix3(camera.pixel_from_direction),
        width=camera.width,
        height=camera.height,
    )
    dr.eval(page.depths, page.items, page.normals, page.values, page.variances)
    return page
