"""Noise of the reference in a comparison: measured from two references, or estimated from one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from enfilade.comparison.measures.psnr import psnr_db
from enfilade.metric import sequence_score

MARGIN = 1.0 / 3.0  # of the floor: a score less than that apart from it is undecided
NOTABLE_SHARE = 1.0 / 3.0  # of the score
SHARED_SHARE = (
    4.0 / 3.0
)  # of the score: noise that alone would score more is no part of it; estimates are low
NOTABLE_JND = 0.25  # least score of noise that is mentioned: "next to none" ends there


@dataclass(frozen=True)
class NoiseFloor:
    """The difference between two references of independent noise, which is their noise alone.

    Attributes
    ----------
    frame_scores : tuple of float
        Score of the first reference against the second by frame, JND.
    percent_visible : float
        Their pixels above 1 JND, percent, mean over the frames.
    squared_error : float
        Mean over pixels, channels and frames, sRGB-encoded.
    """

    frame_scores: tuple[float, ...]
    percent_visible: float
    squared_error: float

    @property
    def score(self) -> float:
        """The floor, JND, pooled over the frames."""
        return sequence_score(self.frame_scores)

    def significance(self, score: float) -> Literal["above", "undecided", "below"]:
        """Whether a score against the mean of both references stands out from their noise.

        Parameters
        ----------
        score
            JND.

        Returns
        -------
        str
            ``undecided`` where the distance from the floor is less than a third of the floor. A test without
            any error is ``below``, at a third to two thirds of the floor: the noise of the mean of both
            references has half the deviation of their difference, of which the score is no linear function.
        """
        if abs(score - self.score) < MARGIN * self.score:
            return "undecided"
        return "below" if score < self.score else "above"

    def sentence(self, score: float) -> str:
        """The floor and the significance of a score."""
        floor = f"reference noise: one reference against the other scores {self.score:.2f} JND"
        match self.significance(score):
            case "undecided":
                return (
                    f"{floor}; the score of {score:.2f} JND is less than a third of that apart from "
                    "it, so it is undecided; render both references with more --spp"
                )
            case "below":
                return (
                    f"{floor}; the score of {score:.2f} JND is below that, where noise hides small errors: "
                    "a test without any error scores a third to two thirds of it"
                )
            case _:
                return f"{floor}; the score of {score:.2f} JND stands out from it"

    def to_dict(self, score: float) -> dict[str, Any]:
        """The floor as plain values, fit for JSON, with the significance of a score."""
        ratio = psnr_db(self.squared_error)
        return {
            "score_jnd": self.score,
            "percent_visible": self.percent_visible,
            "psnr_db": ratio if math.isfinite(ratio) else None,
            "significance": self.significance(score),
            "per_frame_jnd": list(self.frame_scores),
        }


@dataclass(frozen=True)
class NoiseEstimate:
    """Noise of a single reference, estimated from its images (:mod:`enfilade.comparison.noise_estimate`).

    Attributes
    ----------
    sigma : float
        Standard deviation of the luminance's noise, sRGB-encoded, 1 = white; 0 where none was found.
    score : float
        Score of the reference with synthetic noise of that deviation against itself, JND.
    frames : int
        Number of frames that were looked at.
    """

    sigma: float
    score: float
    frames: int

    def is_notable(self, score: float) -> bool:
        """Whether the noise is a third or more of a score, JND, and alone would have more than 0.25 JND."""
        is_part = NOTABLE_SHARE * score <= self.score <= SHARED_SHARE * score
        return self.score > NOTABLE_JND and is_part

    def is_shared(self, score: float) -> bool:
        """Whether the noise alone would score more than 4/3 of a score, JND, and more than 0.25 JND.

        Then the test has the same noise: it is the reference compressed, or a run of one method and seed.
        """
        return self.score > NOTABLE_JND and self.score > SHARED_SHARE * score

    def sentence(self, score: float) -> str:
        """The estimate and its remedy, where it is notable beside a score, or shared; else empty."""
        noise = f"reference noise: the reference looks noisy (about {100.0 * self.sigma:.1f} % of white)"
        if self.is_shared(score):
            return (
                f"{noise}, but that noise alone would score about {self.score:.1f} JND, more than the "
                f"{score:.2f} JND: the test seems to have the same noise, which is then no part of the score"
            )
        if not self.is_notable(score):
            return ""
        return (
            f"{noise}, and that noise alone would score about {self.score:.1f} JND, of {score:.2f} JND in "
            "all; render a second reference with another --seed and pass it by --second-reference, or take "
            "more --spp"
        )

    def to_dict(self, score: float) -> dict[str, Any]:
        """The estimate as plain values, fit for JSON."""
        return {
            "score_jnd": self.score,
            "sigma_percent": 100.0 * self.sigma,
            "is_notable": self.is_notable(score),
            "is_shared": self.is_shared(score),
            "frames": self.frames,
        }
