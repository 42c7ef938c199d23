"""Which pixels of an in-between must be traced, and why (§4.1, §4.3, §6)."""

from __future__ import annotations

import numpy as np

from enfilade.records import F32, U8, U32, Geometry, Mask, Source
from enfilade.settings import MaskSettings

GROUP = 4  # fewest connected pixels that count as a group: less is an outlier, not a feature
EIGHT_CONNECTED = np.ones((3, 3), bool)


def slow_pixels(speed_deg_s: F32, settings: MaskSettings) -> Mask:
    """Pixels whose pattern is too slow for anything but tracing (§5.2): below v_t, (H, W)."""
    return speed_deg_s < settings.slow_deg_s


def visible_items(jnd: F32, is_judged: Mask, geometry: Geometry, settings: MaskSettings) -> frozenset[int]:
    """Specular items whose reuse would be seen (§4.3 step 4b, thresholds of §6).

    Each connected region of a specular item is judged by itself: when a group of its pixels differs
    by more than 2 JND, or when more than a quarter of them differ by more than 1 JND, its item is
    selected, for the whole segment.

    Parameters
    ----------
    jnd : (H, W) float32
        Difference between the two warped keyframes.
    is_judged : (H, W) bool
        Pixels at which both of them see the surface.
    geometry
        Of the frame itself.
    """
    import scipy.ndimage

    is_candidate = geometry.is_specular & is_judged
    selected: set[int] = set()
    for item in np.unique(geometry.item[is_candidate]).tolist():
        regions, count = scipy.ndimage.label(is_candidate & (geometry.item == item), EIGHT_CONNECTED)
        if any(_is_seen(jnd, regions == r, settings) for r in range(1, count + 1)):
            selected.add(int(item))
    return frozenset(selected)


def item_pixels(item: U32, items: frozenset[int]) -> Mask:
    """Pixels that show one of these items, (H, W)."""
    return np.isin(item, list(items))


def sources(is_slow: Mask, is_specular: Mask, is_hole: Mask) -> U8:
    """Why each pixel of an in-between has its value, each counted once, in the paper's order (§6).

    Returns
    -------
    (H, W) uint8
        ``records.Source``: slow before specular before hole; the rest is reused.
    """
    source = np.full(is_slow.shape, Source.REUSED, np.uint8)
    source[is_hole] = Source.HOLE
    source[is_specular] = Source.SPECULAR
    source[is_slow] = Source.SLOW
    return source


def _is_seen(jnd: F32, region: Mask, settings: MaskSettings) -> bool:
    import scipy.ndimage

    box = scipy.ndimage.find_objects(region.astype(np.uint8))[0]
    region, jnd = region[box], jnd[box]
    if (region & (jnd > 1.0)).sum() * 100.0 > settings.specular_percent * region.sum():
        return True
    groups, count = scipy.ndimage.label(region & (jnd > settings.specular_jnd), EIGHT_CONNECTED)
    return count > 0 and int(np.bincount(groups.ravel())[1:].max()) >= GROUP
