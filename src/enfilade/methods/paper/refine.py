"""Adaptive refinement of keyframe placement: segments are split by the metric (§4.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import scipy.fft

from enfilade.camera.path import Segment
from enfilade.gbuffer import View
from enfilade.methods.paper.composite import agrees
from enfilade.methods.paper.disparity import outline_pixels
from enfilade.methods.paper.footprint import shown_alike
from enfilade.methods.paper.masks import reusable_specular_shapes, slow_pixels, specular_pixels
from enfilade.methods.paper.support import spatial_support_px
from enfilade.methods.paper.warp import warped_pair
from enfilade.methods.walkthrough import Walkthrough
from enfilade.metric import HalvesAqm, LuminanceHalves, Pursuit
from enfilade.records import F32, Keyframe, Mask, Warped
from enfilade.settings import AntialiasSettings, MaskSettings, MetricSettings, WarpSettings

MIN_COMPARED = 0.05  # of the image: fewer unmasked pixels are not representative of a segment
MOST_DISOCCLUDED = 0.5  # of the image: with more disoccluded pixels to trace a keyframe costs little more
FFT_THREADS = 2  # at most


@dataclass(frozen=True)
class SegmentResult:
    """The metric's result for a segment.

    Attributes
    ----------
    first, last : int
        The keyframes, as indices on the path.
    depth : int
        Number of splits that led to the segment.
    middle : int or None
        The frame that was compared; None for segments without in-betweens.
    reusable : frozenset of int
        Specular shapes whose reuse can't be seen; all others must be traced in the whole segment.
    percent_visible, percent_visible_no_pursuit : float or None
        Unmasked pixels above 1 JND, percent, with and without smooth pursuit; None where too few pixels can
        be compared.
    is_split : bool
        More of them than the settings allow, or most pixels are disoccluded.
    """

    first: int
    last: int
    depth: int
    middle: int | None
    reusable: frozenset[int] = frozenset()
    percent_visible: float | None = None
    percent_visible_no_pursuit: float | None = None
    is_split: bool = False

    @property
    def segment(self) -> Segment:
        """The segment."""
        return Segment(self.first, self.last, self.depth)

    def to_table(self, numbers: Sequence[int]) -> dict[str, Any]:
        """The result as a table, fit for JSON, with frame numbers in place of indices."""
        return {
            "first": numbers[self.first],
            "last": numbers[self.last],
            "depth": self.depth,
            "middle": None if self.middle is None else numbers[self.middle],
            "reusable": sorted(self.reusable),
            "percent_visible": self.percent_visible,
            "percent_visible_no_pursuit": self.percent_visible_no_pursuit,
            "is_split": self.is_split,
        }

    @staticmethod
    def from_table(table: Mapping[str, Any], numbers: Sequence[int]) -> SegmentResult:
        """Read back from :meth:`to_table`."""
        places = {key: table[key] for key in ("first", "last", "middle")}
        frames = {key: None if number is None else numbers.index(number) for key, number in places.items()}
        return SegmentResult(**{**table, **frames, "reusable": frozenset(table["reusable"])})


def leaf_of(results: Sequence[SegmentResult], frame: int) -> SegmentResult:
    """The unsplit segment of an in-between."""
    return next(r for r in results if not r.is_split and r.first < frame < r.last)


class Refinement:
    """Splits segments until the metric finds few visible differences between their warped keyframes.

    Parameters
    ----------
    walk
    """

    def __init__(self, walk: Walkthrough) -> None:
        self._walk = walk
        self._metric = HalvesAqm(walk.viewing, mask_slope=walk.settings[MetricSettings].mask_slope)

    def refine(self, initial: Segment, keyframe: Callable[[int], Keyframe]) -> list[SegmentResult]:
        """Compare a segment, and its halves where it is split.

        Parameters
        ----------
        initial
        keyframe
            Returns the keyframe at a frame, and traces it at the first call.
        """
        results: list[SegmentResult] = []
        pending = [initial]
        while pending:
            segment = pending.pop()
            result = self.compare(segment, keyframe)
            results.append(result)
            if result.is_split and result.middle is not None:
                pending += reversed(segment.split(result.middle))
        return results

    def compare(self, segment: Segment, keyframe: Callable[[int], Keyframe]) -> SegmentResult:
        """Warp both keyframes to the middle of a segment and measure the visible difference (§4.3, 2-5)."""
        walk = self._walk
        middle = walk.path.middle(segment)
        ends = segment.first, segment.last, segment.depth
        if middle is None:
            return SegmentResult(*ends, middle=None)
        view, masks = walk.view(middle), walk.settings[MaskSettings]
        warped = warped_pair(walk, keyframe(segment.first), keyframe(segment.last), middle)

        # Find the inside of the surfaces that both keyframes show.
        tolerance = walk.settings[WarpSettings].depth_tolerance
        is_outline = outline_pixels(view.geometry, tolerance)
        is_inside = ~is_outline
        agreed = [agrees(one, view.geometry, is_outline, tolerance) for one in warped]
        is_compared = is_inside & agreed[0] & agreed[1]

        # Mask the pixels that will be traced: slow ones, and specular shapes whose reuse is visible.
        reusable: frozenset[int] = frozenset()
        if (is_compared & view.geometry.is_specular).any():
            (jnd,) = self._differences(view, warped, is_compared, Pursuit.PURSUIT)
            reusable = reusable_specular_shapes(jnd, is_compared, is_inside, view.geometry, masks)
        is_slow = slow_pixels(view.speed_deg_s, masks)
        is_masked = is_slow | specular_pixels(view.geometry, reusable)
        unmasked = is_compared & ~is_masked
        disoccluded = float((~is_masked & ~agreed[0] & ~agreed[1]).mean())

        # Compare without them: the metric's filters spread a difference over its neighbourhood.
        percent = percent_no_pursuit = None
        if unmasked.mean() >= MIN_COMPARED:
            maps = self._differences(view, warped, unmasked, Pursuit.PURSUIT, Pursuit.NONE)
            percent, percent_no_pursuit = (100.0 * float((jnd[unmasked] > 1.0).mean()) for jnd in maps)
        return SegmentResult(
            *ends,
            middle=middle,
            reusable=reusable,
            percent_visible=percent,
            percent_visible_no_pursuit=percent_no_pursuit,
            is_split=(percent or 0.0) > masks.split_percent or disoccluded > MOST_DISOCCLUDED,
        )

    def _differences(
        self, view: View, warped: tuple[Warped, Warped], is_compared: Mask, *pursuits: Pursuit
    ) -> list[F32]:
        """JND maps between two warped keyframes, one for each eye movement."""
        walk = self._walk
        density, settings = walk.viewing.pixels_per_degree, walk.settings[AntialiasSettings]
        support = spatial_support_px(view.speed_deg_s, density, settings)
        images = [
            LuminanceHalves(walk.display_luminance(one.first), walk.display_luminance(one.second))
            for one in shown_alike(*warped, is_compared, support)
        ]
        with scipy.fft.set_workers(min(FFT_THREADS, dr.thread_count())):
            found = self._metric.compare_each(
                *images, pursuits=pursuits, velocity=view.velocity_deg_s, valid=is_compared
            )
        return [one.jnd for one in found]
