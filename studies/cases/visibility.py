"""Visible differences between frames, in motion and as stills, by both modes of the metric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from enfilade.kernels.tone import display_luminance
from enfilade.metric import Aqm, HalvesAqm, LuminanceHalves, Pursuit
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.records import F32, Mask
from enfilade.settings import MetricSettings, Settings, ViewingSettings
from enfilade.viewing import Viewing

Scores = dict[str, float | None]

VISIBLE_JND = 1.0  # detected in 75 % of trials (§6)


@dataclass(frozen=True)
class Viewer:
    """Both modes of the metric for frames of one size.

    Attributes
    ----------
    viewing : Viewing
    settings : Settings
        Exposure, and the slope of masking.
    """

    viewing: Viewing
    settings: Settings

    def luminance(self, color: F32) -> F32:
        """Displayed luminance of linear colours, (H, W) cd/m2."""
        exposure_ev = self.settings[ViewingSettings].exposure_ev
        displayed: F32 = display_luminance(
            color,
            exposure_ev=exposure_ev,
            peak_cd_m2=self.viewing.peak_cd_m2,
            black_cd_m2=self.viewing.black_cd_m2,
        )
        return displayed

    def paper(
        self,
        test: F32,
        reference: F32,
        velocity_deg_s: F32 | None,
        *,
        valid: Mask | None = None,
    ) -> F32:
        """JND map by the paper's mode, the worse of pursuit and the eye at rest (§3.3).

        Parameters
        ----------
        test, reference : (H, W, 3) float32
            Linear colours.
        velocity_deg_s : (H, W, 2) float32 or None
            None: compared as stills.
        valid : (H, W) bool, optional
            Pixels to compare.
        """
        images = self.luminance(test), self.luminance(reference)
        return self._paper.compare(*images, velocity=velocity_deg_s, valid=valid).jnd

    def halves(
        self,
        test: Sequence[F32],
        reference: Sequence[F32],
        velocity_deg_s: F32 | None,
        *,
        valid: Mask | None = None,
    ) -> F32:
        """JND map of what two halves with independent noise share, as in a run; the arguments of `paper`."""
        images = [LuminanceHalves(*map(self.luminance, of)) for of in (test, reference)]
        (found,) = self._halves.compare_each(
            *images, pursuits=[Pursuit.BOTH], velocity=velocity_deg_s, valid=valid
        )
        return found.jnd

    def modern(self, test: F32, reference: F32, velocity_deg_s: F32 | None) -> F32:
        """JND map by the modern mode, of single frames (no flicker)."""
        images = self.luminance(test), self.luminance(reference)
        return self._modern.compare(*images, velocity=velocity_deg_s).jnd

    @cached_property
    def _paper(self) -> Aqm:
        return Aqm.paper(self.viewing, mask_slope=self.settings[MetricSettings].mask_slope)

    @cached_property
    def _halves(self) -> HalvesAqm:
        return HalvesAqm(self.viewing, mask_slope=self.settings[MetricSettings].mask_slope)

    @cached_property
    def _modern(self) -> Aqm:
        return Aqm.modern(self.viewing)


def score_in(jnd: F32, where: Mask) -> float | None:
    """Score of a region of a map, JND, (mean J^3.5)^(1/3.5); None for no pixel."""
    if not where.any():
        return None
    return float(np.mean(jnd[where].astype(np.float64) ** POOLING_EXPONENT) ** (1.0 / POOLING_EXPONENT))


def visible_percent(jnd: F32, where: Mask) -> float | None:
    """Share of a region of a map above 1 JND, percent; None for no pixel."""
    return 100.0 * float((jnd[where] > VISIBLE_JND).mean()) if where.any() else None


def scores_in(jnd: F32, where: Mask) -> Scores:
    """``score`` and ``visible_percent`` of a region of a map."""
    return {"score": score_in(jnd, where), "visible_percent": visible_percent(jnd, where)}
