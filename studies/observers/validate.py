"""The whole validation: both modes on all measurements of observers, and cross-validation of the fits."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from enfilade.monitor import Monitor
from studies.observers import fits, flicker, foley, modelfest, moving_texture, sensitivity
from studies.observers.figures import Figure, ModeResults
from studies.observers.fits import Fit
from studies.observers.gratings import STIMULI
from studies.observers.mode import MODERN, PAPER, Mode


@dataclass(frozen=True, eq=False)
class Validation:
    """Results of both modes.

    Attributes
    ----------
    modes : tuple of ModeResults
        The paper's and the modern mode.
    fits : tuple of Fit
        Cross-validation of the fitted constants.
    """

    modes: tuple[ModeResults, ...]
    fits: tuple[Fit, ...]

    @property
    def missed(self) -> tuple[Figure, ...]:
        """Figures that miss their targets."""
        figures = (figure for mode in self.modes for figure in mode.figures())
        return tuple(figure for figure in figures if not figure.is_met)

    @property
    def failed(self) -> tuple[Figure, ...]:
        """Those that miss them by more than is recorded."""
        return tuple(figure for figure in self.missed if figure.is_failed)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {
            "missed": [figure.name for figure in self.missed],
            "failed": [figure.name for figure in self.failed],
            "modes": [mode.to_dict() for mode in self.modes],
            "fits": [asdict(fit) for fit in self.fits],
        }


def measure(mode: Mode, monitor: Monitor, *, has_targets: bool) -> ModeResults:
    """Apply one mode of the metric to all stimuli.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Shows the progress over the stimuli.
    has_targets : bool
        Whether the targets apply to this mode.

    Notes
    -----
    Two to three minutes of CPU time.
    """
    return ModeResults(
        mode=mode.name,
        has_targets=has_targets,
        thresholds=modelfest.measure(mode, monitor),
        masking={angle: foley.measure(mode, monitor, angle_deg=angle) for angle in foley.ANGLES_DEG},
        sensitivities={
            study: sensitivity.measure(study, sensitivity.gratings(study), mode, monitor) for study in STIMULI
        },
        losses=moving_texture.measure(mode, monitor),
        flicker=flicker.measure(mode, monitor),
    )


def validate(monitor: Monitor) -> Validation:
    """Measure both modes, the modern one with targets, and cross-validate the fitted constants.

    Parameters
    ----------
    monitor : Monitor
        Shows the progress over the stimuli.
    """
    modes = (measure(PAPER, monitor, has_targets=False), measure(MODERN, monitor, has_targets=True))
    return Validation(modes, fits.measure(monitor))
