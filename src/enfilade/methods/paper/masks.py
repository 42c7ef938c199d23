"""Pixels of an in-between that must be traced, by the reason (§4.1, §4.3, §6)."""

from __future__ import annotations

import numpy as np
import scipy.ndimage

from enfilade.records import F32, U8, Geometry, Mask, Provenance
from enfilade.settings import MaskSettings

MIN_COMPARED = 0.5  # of a shape's pixels: with fewer compared, it must be traced
MIN_REGION = 0.05  # of a shape's compared pixels: the percentage above 1 JND is not taken of smaller regions
MIN_GROUP = 4  # connected pixels that count as a group: fewer are outliers
EIGHT_CONNECTED = np.ones((3, 3), bool)


def slow_pixels(speed_deg_s: F32, settings: MaskSettings) -> Mask:
    """Pixels whose velocity is below v_t (§5.2), (H, W): errors of reuse are visible in them."""
    return speed_deg_s < settings.slow_deg_s


def reusable_specular_shapes(
    jnd: F32, is_compared: Mask, is_inside: Mask, geometry: Geometry, settings: MaskSettings
) -> frozenset[int]:
    """Specular shapes whose reuse can't be seen (§4.3 step 4b, thresholds of §6).

    Each connected region of a specular shape is compared separately. It is visible if a group of its pixels
    differs by more than 2 JND, or if more than a quarter of them differ by more than 1 JND. The latter is
    not applied to small regions, of which shapes behind foliage and railings have many. A shape of whose
    inside both keyframes show less than half can't be compared.

    Parameters
    ----------
    jnd : (H, W) float32
        Visible difference between the two warped keyframes.
    is_compared : (H, W) bool
        Pixels inside of surfaces at which both keyframes show the surface.
    is_inside : (H, W) bool
        Pixels inside of surfaces: not at their outlines.
    geometry
        G-buffer of the frame.
    settings

    Returns
    -------
    frozenset of int
        Shape indices. All other specular shapes must be traced in the whole segment, also those that this
        frame does not show.
    """
    is_candidate = geometry.is_specular & is_compared
    reusable: set[int] = set()
    for shape_index in np.unique(geometry.shape_index[is_candidate]).tolist():
        # Skip shapes that can't be compared.
        shown = geometry.is_specular & is_inside & (geometry.shape_index == shape_index)
        compared = shown & is_compared
        if np.count_nonzero(compared) < MIN_COMPARED * np.count_nonzero(shown):
            continue

        # Compare its connected regions.
        regions, _ = scipy.ndimage.label(compared, EIGHT_CONNECTED)
        boxes = enumerate(scipy.ndimage.find_objects(regions), 1)
        least = MIN_REGION * np.count_nonzero(compared)
        if not any(_is_visible(jnd[box], regions[box] == region, least, settings) for region, box in boxes):
            reusable.add(int(shape_index))
    return frozenset(reusable)


def specular_pixels(geometry: Geometry, reusable: frozenset[int]) -> Mask:
    """Specular pixels that must be traced, (H, W): all but those of `reusable_specular_shapes`."""
    must: Mask = geometry.is_specular & ~np.isin(geometry.shape_index, list(reusable))
    return must


def provenance_of(is_slow: Mask, is_specular: Mask, is_disoccluded: Mask) -> U8:
    """Provenance of the pixels of an in-between, each counted once, in the paper's order (§6).

    Returns
    -------
    (H, W) uint8
        ``records.Provenance``: slow before specular before disoccluded; all others are reused.
    """
    provenance = np.full(is_slow.shape, Provenance.REUSED, np.uint8)
    provenance[is_disoccluded] = Provenance.DISOCCLUDED
    provenance[is_specular] = Provenance.SPECULAR
    provenance[is_slow] = Provenance.SLOW
    return provenance


def _is_visible(jnd: F32, region: Mask, least: float, settings: MaskSettings) -> bool:
    """Whether a region differs visibly; `least` is the size from which the percentage above 1 JND counts."""
    # Compare the percentage above 1 JND.
    size = np.count_nonzero(region)
    percent = 100.0 * float(np.mean(jnd[region] > 1.0))
    if size >= least and percent > settings.specular_percent:
        return True

    # Find a group above 2 JND.
    groups, count = scipy.ndimage.label(region & (jnd > settings.specular_jnd), EIGHT_CONNECTED)
    return count > 0 and int(np.bincount(groups.ravel())[1:].max()) >= MIN_GROUP
