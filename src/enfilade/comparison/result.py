"""The result of a comparison: per frame, per band, steady and transient, and as one number."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from enfilade.comparison.measures.psnr import psnr_db
from enfilade.comparison.noise import NoiseEstimate, NoiseFloor
from enfilade.metric import Part, sequence_score
from enfilade.viewing import Viewing

IDENTICAL = "identical"
INVISIBLE = "not identical, but without a visible difference in luminance"
INVISIBLE_JND = 0.005  # below, a score of two decimals is 0.00
WORDS = (  # for scores up to so many JND, of all pixels and frames together; docs/metric.md has examples
    (0.25, "next to none overall"),
    (0.75, "faint overall"),
    (1.5, "noticeable overall"),
    (3.0, "obvious overall"),
    (8.0, "strong overall"),
    (16.0, "very strong overall"),
    (32.0, "severe overall"),
    (math.inf, "extreme overall"),
)


@dataclass(frozen=True)
class FrameDifference:
    """The visible difference between two frames.

    Attributes
    ----------
    name : str
        Of the test's frame.
    number : int
        Of the test's frame; counted from 1 where it has none of its own.
    percent_visible : float
        Pixels above 1 JND, percent.
    score : float
        The map of visible differences pooled to one number, JND.
    steady, transient : Part
        Errors that stay on their surface, and errors that change from frame to frame. Both are part of the
        score; the paper's mode has no transient errors.
    squared_error : float
        Mean over pixels and channels, sRGB-encoded and clipped to 0..1. With two references it excludes
        their noise (:attr:`enfilade.comparison.pairs.Pair.squared_error`) and may be negative.
    velocity_deg_s : float
        Mean image velocity.
    largest_jnd : float
        Largest value of the map, JND.
    is_identical : bool
        Whether no pixel differs in any channel, also above white.
    """

    name: str
    number: int
    percent_visible: float
    score: float
    steady: Part
    transient: Part
    squared_error: float
    velocity_deg_s: float
    largest_jnd: float
    is_identical: bool

    def to_dict(self) -> dict[str, Any]:
        """The difference as plain values, fit for JSON; an infinite PSNR is None."""
        return {
            "name": self.name,
            "number": self.number,
            "score_jnd": self.score,
            "steady_jnd": self.steady.score,
            "transient_jnd": self.transient.score,
            "percent_visible": self.percent_visible,
            "largest_jnd": self.largest_jnd,
            "is_identical": self.is_identical,
            "steady_bands_jnd": list(self.steady.band_jnd),
            "transient_bands_jnd": list(self.transient.band_jnd),
            "psnr_db": _finite(psnr_db(max(self.squared_error, 0.0))),
            "velocity_deg_s": self.velocity_deg_s,
        }


@dataclass(frozen=True)
class SequenceDifference:
    """The visible difference between two sequences.

    Attributes
    ----------
    frames : tuple of FrameDifference
    viewing : Viewing
        Viewing conditions.
    bands_cpd : tuple of (float, float)
        Frequencies that each radial band passes, cycles per degree, finest first; the base from 0.
    mode : str
        Of the metric: ``modern`` or ``paper``.
    flow : str
        Origin of the motion vectors: ``layers``, ``estimate`` or ``none``.
    scores : mapping of str to float
        Results of further measures, by name.
    noise_floor : NoiseFloor or None
        Of two references.
    noise_estimate : NoiseEstimate or None
        Of a single reference.
    """

    frames: tuple[FrameDifference, ...]
    viewing: Viewing
    bands_cpd: tuple[tuple[float, float], ...]
    mode: str
    flow: str
    scores: Mapping[str, float] = field(default_factory=dict)
    noise_floor: NoiseFloor | None = None
    noise_estimate: NoiseEstimate | None = None

    @property
    def score(self) -> float:
        """One number for the sequence, JND: (mean over frames of score^3.5)^(1/3.5)."""
        return sequence_score([f.score for f in self.frames])

    @property
    def is_identical(self) -> bool:
        """Whether no pixel of any frame differs."""
        return all(f.is_identical for f in self.frames)

    @property
    def meaning(self) -> str:
        """The score in words, whether it is undecided, and the frame with the largest visible difference."""
        is_visible = any(f.percent_visible for f in self.frames)
        words = IDENTICAL if self.is_identical else words_of(self.score, is_visible=is_visible)
        if self.noise_floor is not None and self.noise_floor.significance(self.score) == "undecided":
            words += ", undecided"
        worst = max(self.frames, key=lambda f: f.largest_jnd)
        if not is_visible:
            return words
        return f"{words}; up to {worst.largest_jnd:.1f} JND in {short_name(worst.name)}"

    @property
    def noise_note(self) -> str:
        """Meaning of the reference's noise for the score; empty where there is little of it."""
        if self.is_identical:
            return ""
        noise = self.noise_floor or self.noise_estimate
        return "" if noise is None else noise.sentence(self.score)

    @property
    def psnr_db(self) -> float:
        """PSNR of the whole sequence, of the mean squared error over all frames, without noise of references.

        Infinite where no displayed pixel differs, or the noise of two references hides the error.
        """
        return psnr_db(max(sum(f.squared_error for f in self.frames) / len(self.frames), 0.0))

    def to_dict(self) -> dict[str, Any]:
        """The result as plain values, fit for JSON."""
        viewing = self.viewing
        return {
            "score_jnd": self.score,
            "meaning": self.meaning,
            "is_identical": self.is_identical,
            "noise_floor": self.noise_floor and self.noise_floor.to_dict(self.score),
            "noise_estimate": self.noise_estimate and self.noise_estimate.to_dict(self.score),
            "noise_note": self.noise_note,
            "steady_jnd": sequence_score([f.steady.score for f in self.frames]),
            "transient_jnd": sequence_score([f.transient.score for f in self.frames]),
            "percent_visible": _mean_and_most([f.percent_visible for f in self.frames]),
            "largest_jnd": max(f.largest_jnd for f in self.frames),
            "psnr_db": _finite(self.psnr_db),
            "scores": {name: _finite(score) for name, score in self.scores.items()},
            "worst_frame": max(range(len(self.frames)), key=lambda i: self.frames[i].score),
            "frames": len(self.frames),
            "size": [viewing.width_px, viewing.height_px],
            "fps": viewing.fps,
            "pixels_per_degree": viewing.pixels_per_degree,
            "distance_m": viewing.distance_m,
            "peak_cd_m2": viewing.peak_cd_m2,
            "black_cd_m2": viewing.black_cd_m2,
            "persistence": viewing.persistence,
            "mode": self.mode,
            "flow": self.flow,
            "bands_cpd": [list(band) for band in self.bands_cpd],
            "per_frame": [frame.to_dict() for frame in self.frames],
        }


def words_of(score: float, *, is_visible: bool = False) -> str:
    """The score of sequences that differ in any pixel, in words.

    It is that of all pixels and frames together: a small or brief defect has a low score, however plain it
    is.

    Parameters
    ----------
    score
        JND, 0 or more.
    is_visible
        Whether any pixel of any frame is above 1 JND.
    """
    if score < INVISIBLE_JND and not is_visible:
        return INVISIBLE
    return next(text for most, text in WORDS if score <= most)


def short_name(name: str) -> str:
    """The name of a frame without its video, "frame 3 of walk.mp4", or without the folder of its image."""
    return name.partition(" of ")[0] if name.startswith("frame ") else name.rpartition("/")[2]


def _mean_and_most(values: list[float]) -> dict[str, float]:
    return {"mean": sum(values) / len(values), "most": max(values)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
