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
from studies.observers.threshold import rms_db

DARK = frozenset({"grass"})  # its mean luminance is a thirtieth of that of the others
DIM = frozenset({"headset"})


@dataclass(frozen=True)
class Target:
    """The bound that a figure should keep.

    Attributes
    ----------
    bound : float
        In the figure's unit.
    is_least : bool
        Whether the bound is a lower one instead of an upper one.
    recorded : float or None
        A value that misses the bound and is accepted until the metric improves; None: no miss is accepted.
    """

    bound: float
    is_least: bool = False
    recorded: float | None = None

    def is_met(self, value: float) -> bool:
        """Whether a value keeps to the bound."""
        return _keeps(value, self.bound, self.is_least)

    def is_failed(self, value: float) -> bool:
        """Whether a value misses the bound, and is worse than the recorded miss."""
        accepted = self.bound if self.recorded is None else self.recorded
        return not (self.is_met(value) or _keeps(value, accepted, self.is_least))


def _keeps(value: float, bound: float, is_least: bool) -> bool:
    return value >= bound if is_least else value <= bound


TARGETS = {  # of the modern mode
    "ModelFest": Target(2.0),
    "ModelFest Gabors": Target(3.0),
    "Foley masking": Target(2.0),
    "Robson 1966": Target(3.0, recorded=10.1),
    "Laird 2006": Target(3.0),
    "moving texture, 54 conditions": Target(0.82, is_least=True),
    "moving texture, 36 conditions": Target(0.90, is_least=True),
    "flicker against blur": Target(1.01, is_least=True),
}

CASTLE = "castleCSF (its authors)"
FITTED = {  # constants of the modern mode that were fitted to the data of a figure, and by whom
    "ModelFest": f"gain, aperture (enfilade); {CASTLE}",
    "ModelFest Gabors": f"aperture (enfilade); {CASTLE}",
    "Foley masking": "gain, transducer (enfilade)",
    "Foley masking, 45 deg": "gain (enfilade)",
    "Foley masking, 90 deg": "gain (enfilade)",
    "Robson 1966": CASTLE,
    "Laird 2006": CASTLE,
    "Rovamo 1993": CASTLE,
    "moving texture, 72 conditions": "none (known in the design)",
    "moving texture, 54 conditions": "none (known in the design)",
    "moving texture, 36 conditions": "none (known in the design)",
    "flicker against blur": "none (synthetic)",
}
SMALL_DEG2 = 1.0  # divides the areas of Rovamo


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
    def fitted(self) -> str:
        """Constants of the modern mode that were fitted to these data; empty for parts of an experiment."""
        return FITTED.get(self.name, "")

    @property
    def is_met(self) -> bool:
        """Whether the value meets its target; true without one."""
        return self.target is None or self.target.is_met(self.value)

    @property
    def is_failed(self) -> bool:
        """Whether the value misses its target by more than is recorded; false without one."""
        return self.target is not None and self.target.is_failed(self.value)

    @property
    def status(self) -> str:
        """For tables: ``ok``, ``missed, as recorded`` or ``FAILED``; empty without a target."""
        if self.target is None:
            return ""
        if self.is_failed:
            return "FAILED"
        return "ok" if self.is_met else "missed, as recorded"

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return asdict(self) | {"fitted": self.fitted, "status": self.status}


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
    masking : dict of Masking
        Foley 1994, by the angle of the mask in degrees.
    sensitivities : dict of Sensitivities
        By study, one of `gratings.STIMULI`.
    losses : Losses
        Moving textures.
    flicker : dict of Pair
        By example.
    """

    mode: str
    has_targets: bool
    thresholds: Thresholds
    masking: dict[int, Masking]
    sensitivities: dict[str, Sensitivities]
    losses: Losses
    flicker: dict[str, Pair]

    def figures(self) -> tuple[Figure, ...]:
        """All figures, in the order of the table."""
        rows = (*self._of_thresholds(), *self._of_gratings(), *self._of_sequences())
        return tuple(
            Figure(name, unit, value, TARGETS.get(name) if self.has_targets else None)
            for name, unit, value in rows
        )

    def _of_thresholds(self) -> list[tuple[str, str, float]]:
        return [
            ("ModelFest", "dB RMS", self.thresholds.rms_db),
            ("  cross-validated gain", "dB RMS", self.thresholds.cross_validation_rms_db),
            ("  gain", "dB", self.thresholds.gain_db),
            ("ModelFest Gabors", "dB RMS", self.thresholds.gabors_rms_db),
            ("Foley masking", "dB RMS", self.masking[0].rms_db),
            ("Foley masking, 45 deg", "dB RMS", self.masking[45].rms_db),
            ("Foley masking, 90 deg", "dB RMS", self.masking[90].rms_db),
        ]

    def _of_gratings(self) -> list[tuple[str, str, float]]:
        errors_db = {study: found.error_db for study, found in self.sensitivities.items()}
        by_cpd, by_hz = errors_db["robson1966_cpd"], errors_db["robson1966_hz"]
        is_small = self.sensitivities["rovamo1993"].area_deg2 <= SMALL_DEG2
        by_area = errors_db["rovamo1993"]
        rows = [
            ("Robson 1966", np.concatenate((by_cpd, by_hz))),
            ("  by cpd, at 1 to 23 Hz", by_cpd),
            ("  by Hz, at 0.5 and 4 cpd", by_hz),
            ("Laird 2006", errors_db["laird2006"]),
            ("Rovamo 1993", by_area),
            ("  areas up to 1 deg2", by_area[is_small]),
            ("  larger areas", by_area[~is_small]),
        ]
        return [(name, "dB RMS", rms_db(errors)) for name, errors in rows]

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
            "masking": {str(angle_deg): _plain(found) for angle_deg, found in self.masking.items()},
            "sensitivity": {study: _plain(found) for study, found in self.sensitivities.items()},
            "moving_texture": _plain(self.losses)
            | {"conditions": [asdict(condition) for condition in self.losses.conditions]},
            "flicker": {name: asdict(pair) for name, pair in self.flicker.items()},
        }


def _plain(record: Any) -> dict[str, Any]:
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(record).items()}
