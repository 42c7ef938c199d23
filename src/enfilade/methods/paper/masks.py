"""Which pixels of an in-between must be traced, and why (§4.1, §4.3, §6)."""

from __future__ import annotations

import numpy as np

from enfilade.records import F32, U8, Geometry, Mask, Provenance
from enfilade.renderer import Emitters
from enfilade.settings import MaskSettings

JUDGED_SHARE = 0.5  # of a shape's pixels: with fewer judged nothing is known of the shape
HIDDEN = 1.01  # times the farthest depth around: a lamp beyond that is not seen
PART = 0.05  # of a shape's judged pixels: of a smaller region a quarter is no share of the shape
GROUP = 4  # fewest connected pixels that count as a group: less is an outlier, not a feature
EIGHT_CONNECTED = np.ones((3, 3), bool)


def slow_pixels(speed_deg_s: F32, settings: MaskSettings) -> Mask:
    """Pixels whose pattern is too slow for anything but tracing (§5.2): below v_t, (H, W)."""
    return speed_deg_s < settings.slow_deg_s


def reusable_specular_shapes(
    jnd: F32, is_judged: Mask, geometry: Geometry, settings: MaskSettings
) -> frozenset[int]:
    """Specular shapes whose reuse is not seen (§4.3 step 4b, thresholds of §6).

    Each connected region of a specular shape is judged by itself: when a group of its pixels differs
    by more than 2 JND, or when more than a quarter of them differ by more than 1 JND, its shape is
    seen; the latter not by splinters, of which shapes have many behind leaves and railings. What can't
    be judged is taken for seen: a shape of which both keyframes show less than half.

    Parameters
    ----------
    jnd : (H, W) float32
        Difference between the two warped keyframes.
    is_judged : (H, W) bool
        Pixels at which both of them see the surface.
    geometry
        Of the frame itself.

    Returns
    -------
    frozenset of int
        All others, also those that the frame does not show, must be traced in the whole segment.
    """
    import scipy.ndimage

    is_candidate = geometry.is_specular & is_judged
    unseen: set[int] = set()
    for shape_index in np.unique(geometry.shape_index[is_candidate]).tolist():
        shown = geometry.is_specular & (geometry.shape_index == shape_index)
        judged = shown & is_judged
        if np.count_nonzero(judged) < JUDGED_SHARE * np.count_nonzero(shown):
            continue
        regions, _ = scipy.ndimage.label(judged, EIGHT_CONNECTED)
        boxes = enumerate(scipy.ndimage.find_objects(regions), 1)
        part = PART * np.count_nonzero(judged)
        if not any(_is_seen(jnd[box], regions[box] == region, part, settings) for region, box in boxes):
            unseen.add(int(shape_index))
    return frozenset(unseen)


def specular_pixels(geometry: Geometry, unseen: frozenset[int]) -> Mask:
    """Pixels that must be traced since they shine, (H, W): all but those of `reusable_specular_shapes`."""
    must: Mask = geometry.is_specular & ~np.isin(geometry.shape_index, list(unseen))
    return must


def provenance_of(is_slow: Mask, is_specular: Mask, is_disoccluded: Mask) -> U8:
    """Why each pixel of an in-between has its value, each counted once, in the paper's order (§6).

    Returns
    -------
    (H, W) uint8
        ``records.Provenance``: slow before specular before hole; the rest is reused.
    """
    provenance = np.full(is_slow.shape, Provenance.REUSED, np.uint8)
    provenance[is_disoccluded] = Provenance.DISOCCLUDED
    provenance[is_specular] = Provenance.SPECULAR
    provenance[is_slow] = Provenance.SLOW
    return provenance


def emitter_pixels(emitters: Emitters, geometry: Geometry) -> Mask:
    """Pixels of emitters that are small in the image, and of the outlines of larger ones, (H, W).

    Parameters
    ----------
    emitters
    geometry
        Of the frame: what hides a lamp, and where all around is the same lamp.
    """
    import scipy.ndimage

    camera = geometry.camera
    height, width = geometry.shape_index.shape
    x, y, depth = camera.pixel_from_direction @ (emitters.position - camera.eye).T
    is_inside = (depth > 0.0) & (x >= 0.0) & (y >= 0.0) & (x < width * depth) & (y < height * depth)
    row, column = (np.floor(v[is_inside] / depth[is_inside]).astype(int) for v in (y, x))
    depth, shape_index = depth[is_inside], emitters.shape_index[is_inside]

    farthest = np.where(geometry.is_hit, geometry.depth, np.inf)
    farthest = scipy.ndimage.maximum_filter(farthest, 3, mode="nearest")
    lowest, highest = (
        extreme(geometry.shape_index, 3, mode="nearest")
        for extreme in (scipy.ndimage.minimum_filter, scipy.ndimage.maximum_filter)
    )
    is_amid = (lowest[row, column] == shape_index) & (highest[row, column] == shape_index)
    is_seen = (depth < HIDDEN * farthest[row, column]) & ~is_amid
    mask = np.zeros((height, width), bool)
    mask[row[is_seen], column[is_seen]] = True
    return mask


def _is_seen(jnd: F32, region: Mask, part: float, settings: MaskSettings) -> bool:
    import scipy.ndimage

    size = np.count_nonzero(region)
    share = np.count_nonzero(region & (jnd > 1.0)) * 100.0
    if size >= part and share > settings.specular_percent * size:
        return True
    groups, count = scipy.ndimage.label(region & (jnd > settings.specular_jnd), EIGHT_CONNECTED)
    return count > 0 and int(np.bincount(groups.ravel())[1:].max()) >= GROUP
