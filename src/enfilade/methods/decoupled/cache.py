"""The cache: pages of arriving light, ready to be looked up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, image, lanes, matrix3, opaque, vector3
from enfilade.kernels.lookup import Page, footprint, lookup
from enfilade.kernels.wavelet import with_spread_speckles
from enfilade.methods.decoupled.cells import Cells
from enfilade.methods.decoupled.page import KNOWN, PLANE_TOLERANCE, guide_of, page_of, points_of, smooth_along
from enfilade.records import F32, Geometry, LightPage, Mask

SPECKLE = 2.0  # times the second brightest of its neighbours that a pixel may be
SPECKLE_LEVELS = 5  # of the wavelet that spreads what is more


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

    def find(self, position: Any, normal: Any, shape_index: Any) -> tuple[Any, Any]:
        """Light at points of surfaces.

        Parameters
        ----------
        position, normal : Array3f
        shape_index : UInt

        Returns
        -------
        light : Array3f
            Radiance that the diffuse lobe would send if the albedo were one; 0 where unknown.
        is_known : Bool
        """
        total, weight = Array3f(0), Float(0)
        known = Float(0)
        for page, share in zip(self.pages, self.shares, strict=True):
            found = lookup(position, normal, shape_index, page, plane_tolerance=PLANE_TOLERANCE)
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
    guide = guide_of(page.geometry, np.where(page.is_known, page.geometry.shape_index, np.uint32(0)))
    indirect = lanes(page.indirect.color), lanes(page.indirect.variance)
    indirect = with_spread_speckles(*indirect, guide, times=SPECKLE, levels=SPECKLE_LEVELS)
    direct = lanes(page.direct.color), lanes(page.direct.variance)
    return page_of(page.geometry, lanes(page.is_known), [direct, indirect])


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
        groups = np.where(page.is_known, page.geometry.shape_index, np.uint32(0))
        smoothed = [smooth_along(page.geometry, groups, light, variance) for light, variance in layers]
    else:
        size = page.is_known.shape
        smoothed = [(lanes(denoised(image(light, *size))), variance) for light, variance in layers]
    light = sum((light for light, _ in smoothed), Array3f(0))
    variance = sum((variance for _, variance in smoothed), Float(0))
    return page_of(page.geometry, lanes(page.is_known), [(light, variance)])


def light_of(page: Page) -> F32:
    """The light that a page knows, all layers together, (H, W, 3); 0 where it knows none."""
    return image(sum(page.values, Array3f(0)), page.height, page.width)


def known(geometry: Geometry, pages: Sequence[Page]) -> Mask:
    """Pixels of a view of which some page knows the light, (H, W)."""
    _, is_known = _gathered(geometry, pages, [1.0] * len(pages))
    return image(is_known, *geometry.shape_index.shape)


def seen_from(geometry: Geometry, pages: Sequence[Page], shares: Sequence[float]) -> Page:
    """What pages know of all that a view sees: a page of its own, which its camera rays look up."""
    layers, is_known = _gathered(geometry, pages, shares)
    return page_of(geometry, is_known, layers)


def _gathered(
    geometry: Geometry, pages: Sequence[Page], shares: Sequence[float]
) -> tuple[list[tuple[Any, Any]], Any]:
    """Light at what the pixels' centres of a view see, with its variance, by layer; and where it is known."""
    position, normal, shape_index = (
        points_of(geometry, lanes(geometry.depth)),
        lanes(geometry.normal),
        lanes(geometry.shape_index),
    )
    camera = geometry.camera
    own = footprint(position, normal, vector3(camera.eye), matrix3(camera.direction_from_pixel))
    layers = range(len(pages[0].values))
    totals, variances = [Array3f(0) for _ in layers], [Float(0) for _ in layers]
    weight, known = Float(0), Float(0)
    dr.eval(position, own)
    for page, share in zip(pages, shares, strict=True):
        found = lookup(position, normal, shape_index, page, plane_tolerance=PLANE_TOLERANCE)
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
