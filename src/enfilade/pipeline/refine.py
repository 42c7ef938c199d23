"""Adaptive refinement of keyframe placement: the metric decides which segments are split (§4.3)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from enfilade.camera.path import Segment
from enfilade.kernels.convolve import SIGMAS
from enfilade.methods.paper import agrees, reconstruct, warp_keyframe
from enfilade.methods.paper.masks import slow_pixels, specular_pixels, unseen_items
from enfilade.metric import Pursuit
from enfilade.pipeline.views import View
from enfilade.pipeline.workshop import Workshop
from enfilade.records import F32, Mask, Warped

JUDGED_SHARE = 0.05  # of the image: fewer unmasked pixels than this say nothing about a segment
GAIN = 0.9  # a half must show less than this part of its whole's differences to be split again


@dataclass(frozen=True)
class Verdict:
    """What the metric says of a segment.

    Attributes
    ----------
    middle : int or None
        The frame that was judged; None where there was none to judge.
    unseen : tuple of int
        Specular shapes whose reuse is not seen; all others must be traced in the whole segment.
    percent_visible, percent_visible_no_pursuit : float
        Unmasked pixels above 1 JND, percent, with and without smooth pursuit.
    is_split : bool
        More of them than the settings allow, and splitting still helps.
    """

    middle: int | None
    unseen: tuple[int, ...] = ()
    percent_visible: float = 0.0
    percent_visible_no_pursuit: float = 0.0
    is_split: bool = False

    def to_dict(self) -> dict[str, Any]:
        """As a plain table, fit for JSON."""
        return {**asdict(self), "unseen": list(self.unseen)}

    @staticmethod
    def from_dict(table: dict[str, Any]) -> Verdict:
        """Read back from :meth:`to_dict`."""
        return Verdict(**{**table, "unseen": tuple(table["unseen"])})


def refine(workshop: Workshop, segment: Segment, whole: Verdict | None = None) -> None:
    """Judge a segment: it is split until what is reused in it can't be told from what is traced.

    Or until splitting helps no more: differences that do not shrink with the segment, such as the
    aliasing of keyframes sampled at pixel centres, are not those of reuse.

    Parameters
    ----------
    workshop
    segment
    whole
        Verdict on the segment of which this is a half.
    """
    if not workshop.run.done(segment_unit(workshop, segment)):
        _judge_and_record(workshop, segment, whole)


def segment_unit(workshop: Workshop, segment: Segment) -> str:
    """Name of a segment's refinement in the ledger."""
    return f"segment {workshop.number(segment.first)}-{workshop.number(segment.last)}"


def _judge_and_record(workshop: Workshop, segment: Segment, whole: Verdict | None) -> None:
    workshop.keyframe(segment.first)
    workshop.keyframe(segment.last)
    verdict = judge(workshop, segment)
    if whole is not None and verdict.percent_visible >= GAIN * whole.percent_visible:
        verdict = replace(verdict, is_split=False)
    workshop.finish(
        segment_unit(workshop, segment),
        [],
        first=workshop.number(segment.first),
        last=workshop.number(segment.last),
        middle=None if verdict.middle is None else workshop.number(verdict.middle),
        depth=segment.depth,
        verdict=verdict.to_dict(),
    )


def judge(workshop: Workshop, segment: Segment) -> Verdict:
    """Warp both keyframes to the middle, and let the metric look for differences (§4.3, 2-5)."""
    settings = workshop.job.settings
    middle = workshop.job.path.middle(segment)
    if middle is None:
        return Verdict(None)
    view = workshop.views[middle]
    before, after = warped_pair(workshop, segment, middle)

    # Where both keyframes see the surface, the metric has something to compare.
    tolerance = settings.warp.depth_tolerance
    is_judged = agrees(before, view.geometry, tolerance) & agrees(after, view.geometry, tolerance)
    with workshop.costs.of("metric"):
        jnd, jnd_no_pursuit = _differences(workshop, view, before, after, is_judged)

    # Mask out what will be traced: slow pixels, then specular shapes whose reuse would be seen.
    unseen = unseen_items(jnd, is_judged, view.geometry, settings.masks)
    is_slow = slow_pixels(view.speed_deg_s, settings.masks)
    rest = is_judged & ~is_slow & ~specular_pixels(view.geometry, unseen)
    if (is_judged & ~rest).any() and rest.mean() >= JUDGED_SHARE:
        # Without it: the metric's filters spread a difference over what lies beside it.
        with workshop.costs.of("metric"):
            jnd, jnd_no_pursuit = _differences(workshop, view, before, after, rest)
    percent, percent_no_pursuit = (_percent_visible(j, rest) for j in (jnd, jnd_no_pursuit))
    return Verdict(
        middle=middle,
        unseen=tuple(sorted(unseen)),
        percent_visible=percent,
        percent_visible_no_pursuit=percent_no_pursuit,
        is_split=percent > settings.masks.split_percent,
    )


def warped_pair(workshop: Workshop, segment: Segment, frame: int) -> tuple[Warped, Warped]:
    """Both keyframes of a segment, seen from a frame between them."""
    first, last = workshop.keyframe(segment.first), workshop.keyframe(segment.last)
    camera, settings = workshop.job.path.cameras[frame], workshop.job.settings.warp
    with workshop.costs.of("warp"):
        return warp_keyframe(first, camera, settings), warp_keyframe(last, camera, settings)


def _differences(
    workshop: Workshop, view: View, before: Warped, after: Warped, is_judged: Mask
) -> tuple[F32, F32]:
    """JND maps between two warped keyframes, with smooth pursuit and without.

    Both are filtered as the viewer will see them, and a difference that their noise explains does
    not count.
    """
    support = workshop.spatial_support_px(view)
    shown = [
        workshop.shown(reconstruct(np.where(one.is_hole[..., None], other.color, one.color), support))
        for one, other in ((before, after), (after, before))
    ]
    noise = _shown_variance(workshop, before.variance + after.variance)
    pursuits = (Pursuit.PURSUIT, Pursuit.NONE)
    jnd, jnd_no_pursuit = (
        workshop.aqm.compare(
            *shown,
            velocity=view.velocity_deg_s,
            valid=is_judged,
            noise_variance=noise,
            noise_blur_px=support / np.float32(SIGMAS),
            pursuit=pursuit,
        ).jnd
        for pursuit in pursuits
    )
    return jnd, jnd_no_pursuit


def _shown_variance(workshop: Workshop, variance: F32) -> F32:
    """Variance on the screen, (cd/m2)^2: exposure and screen are linear but for the clipping."""
    of = workshop.job.settings.viewing
    slope = 2.0**of.exposure_ev * (of.peak_cd_m2 - of.black_cd_m2)
    shown: F32 = (variance * slope**2).astype(np.float32)
    return shown


def _percent_visible(jnd: F32, where: Mask) -> float:
    if where.mean() < JUDGED_SHARE:
        return 0.0
    return 100.0 * float((jnd[where] > 1.0).mean())
