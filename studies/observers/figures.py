"""Figures of merit of the metric on observers, and their targets."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studies.observers.flicker import Pair
from studies.observers.foley import Masking
from studies.observers.modelfest import Thresholds
from studies.observers.moving_texture import SCREENS, TEXTURES, Losses
from studies.observers.sensitivity import Sensitivities

__all__ = ["TARGETS", "Figure", "ModeResults", "Target"]

DARK = frozenset({"grass"})  # its mean luminance is a thirtieth of that of the others
DIM = frozenset({"headset"})


@dataclass(frozen=True)
class Target:
    """The bound that a figure must keep.

    Attributes
    ----------
    bound : float
        In the figure's unit.
    is_least : bool
        Whether the bound is a lower one instead of an upper one.
    """

    bound: float
    is_least: bool = False

    def is_met(self, value: float) -> bool:
        """Whether a value keeps to the bound."""
        return value >= self.bound if self.is_least else value <= self.bound


TARGETS = {  # of the modern mode
    "ModelFest": Target(2.0),
    "Foley masking": Target(2.0),
    "Robson 1966": Target(3.0),
    "Laird 2006": Target(3.0),
    "ModelFest Gabors": Target(3.0),
    "moving texture, 54 conditions": Target(0.82, is_least=True),
    "moving texture, 36 conditions": Target(0.90, is_least=True),
    "flicker against blur": Target(1.01, is_least=True),
}


@dataclass(frozen=True)
class Figure:
    """One number of a validation.

    Attributes
    ----------
    name : str
        Experiment, or part of one.
    unit : str
        Of the value.
    value : float
        As measured.
    target : Target or None
        None: reported only.
    """

    name: str
    unit: str
    value: float
    target: Target | None = None

    @property
    def is_met(self) -> bool:
        """Whether the value meets its target; true without one."""
        return self.target is None or self.target.is_met(self.value)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {**asdict(self), "is_met": self.is_met}


@dataclass(frozen=True, eq=False)
class ModeResults:
    """Results of one mode of the metric, beside those of the observers.

    Attributes
    ----------
    mode : str
        Name of the mode.
    has_targets : bool
        Whether the targets apply to it.
    thresholds : Thresholds
        ModelFest.
    masking : Masking
        Foley 1994.
    sensitivities : dict of Sensitivities
        By study.
    losses : Losses
        Moving textures.
    flicker : dict of Pair
        By example.
    """

    mode: str
    has_targets: bool
    thresholds: Thresholds
    masking: Masking
    sensitivities: dict[str, Sensitivities]
    losses: Losses
    flicker: dict[str, Pair]

    def figures(self) -> tuple[Figure, ...]:
        """All figures, in the order of the table."""
        rows = (*self._of_thresholds(), *self._of_sequences())
        return tuple(
            Figure(name, unit, value, TARGETS.get(name) if self.has_targets else None)
            for name, unit, value in rows
        )

    def _of_thresholds(self) -> list[tuple[str, str, float]]:
        robson, laird, gabors = (self.sensitivities[s] for s in ("robson1966", "laird2006", "modelfest"))
        return [
            ("ModelFest", "dB RMS", self.thresholds.rms_db),
            ("  cross-validated gain", "dB RMS", self.thresholds.cross_validation_rms_db),
            ("  gain", "dB", self.thresholds.gain_db),
            ("Foley masking", "dB RMS", self.masking.rms_db),
            ("Robson 1966", "dB RMS", robson.rms_db),
            ("Laird 2006", "dB RMS", laird.rms_db),
            ("ModelFest Gabors", "dB RMS", gabors.rms_db),
        ]

    def _of_sequences(self) -> list[tuple[str, str, float]]:
        light, bright = TEXTURES - DARK, SCREENS - DIM
        ratios = {f"  {name}": pair.ratio for name, pair in self.flicker.items()}
        return [
            ("moving texture, 72 conditions", "Spearman", self.losses.spearman()),
            ("moving texture, 54 conditions", "Spearman", self.losses.spearman(textures=light)),
            (
                "moving texture, 36 conditions",
                "Spearman",
                self.losses.spearman(textures=light, displays=bright),
            ),
            ("flicker against blur", "least ratio", float(np.min(list(ratios.values())))),
            *((name, "ratio", ratio) for name, ratio in ratios.items()),
        ]

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON and for plots: the figures and the points behind them."""
        return {
            "mode": self.mode,
            "figures": [figure.to_dict() for figure in self.figures()],
            "modelfest": _plain(self.thresholds) | {"error_db": self.thresholds.error_db.tolist()},
            "masking": _plain(self.masking),
            "sensitivity": {study: _plain(found) for study, found in self.sensitivities.items()},
            "moving_texture": _plain(self.losses)
            | {"conditions": [asdict(condition) for condition in self.losses.conditions]},
            "flicker": {name: asdict(pair) for name, pair in self.flicker.items()},
        }


def _plain(record: Any) -> dict[str, Any]:
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(record).items()}
