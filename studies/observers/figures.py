"""The figures by which the metric is judged against people, and what is asked of them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studies.observers.flicker import Pair
from studies.observers.foley import Masking
from studies.observers.modelfest import Thresholds
from studies.observers.moving_texture import SCREENS, TEXTURES, Losses
from studies.observers.sensitivity import Sensitivities

__all__ = ["ASKED", "Asked", "Figure", "Measured"]

DARK = frozenset({"grass"})  # its mean is a thirtieth of the others'
DIM = frozenset({"headset"})


@dataclass(frozen=True)
class Asked:
    """A bound on a figure.

    Attributes
    ----------
    bound : float
        In the figure's unit.
    is_least : bool
        Whether the figure must be at least the bound, instead of at most.
    """

    bound: float
    is_least: bool = False

    def is_met(self, value: float) -> bool:
        """Whether a value keeps to the bound."""
        return value >= self.bound if self.is_least else value <= self.bound


ASKED = {  # of the modern mode
    "ModelFest": Asked(2.0),
    "Foley masking": Asked(2.0),
    "Robson 1966": Asked(3.0),
    "Laird 2006": Asked(3.0),
    "ModelFest Gabors": Asked(3.0),
    "moving texture, 54 conditions": Asked(0.82, is_least=True),
    "moving texture, 36 conditions": Asked(0.90, is_least=True),
    "flicker against blur": Asked(1.01, is_least=True),
}


@dataclass(frozen=True)
class Figure:
    """One number of a validation.

    Attributes
    ----------
    name : str
        What it is a figure of.
    unit : str
        Of the value.
    value : float
        As measured.
    asked : Asked or None
        None: reported only.
    """

    name: str
    unit: str
    value: float
    asked: Asked | None = None

    @property
    def is_met(self) -> bool:
        """Whether the value keeps to what is asked; true where nothing is."""
        return self.asked is None or self.asked.is_met(self.value)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {**asdict(self), "is_met": self.is_met}


@dataclass(frozen=True, eq=False)
class Measured:
    """Everything that one mode of the metric says, beside what people said.

    Attributes
    ----------
    mode : str
        Its name.
    is_bound : bool
        Whether anything is asked of it.
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
    is_bound: bool
    thresholds: Thresholds
    masking: Masking
    sensitivities: dict[str, Sensitivities]
    losses: Losses
    flicker: dict[str, Pair]

    def figures(self) -> tuple[Figure, ...]:
        """The table's rows."""
        rows = (*self._of_thresholds(), *self._of_sequences())
        return tuple(
            Figure(name, unit, value, ASKED.get(name) if self.is_bound else None)
            for name, unit, value in rows
        )

    def _of_thresholds(self) -> list[tuple[str, str, float]]:
        robson, laird, gabors = (self.sensitivities[s] for s in ("robson1966", "laird2006", "modelfest"))
        return [
            ("ModelFest", "dB RMS", self.thresholds.rms_db),
            ("  each target by the others' gain", "dB RMS", self.thresholds.left_out_rms_db),
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
