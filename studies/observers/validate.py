"""The whole validation: both modes over all measurements of observers, and the fits with data left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from enfilade.monitor import Monitor
from studies.observers import fits, flicker, foley, modelfest, moving_texture, sensitivity
from studies.observers.figures import Figure, Measured
from studies.observers.fits import Fit
from studies.observers.mode import MODERN, PAPER, Mode

__all__ = ["Validation", "measure", "validate"]


@dataclass(frozen=True, eq=False)
class Validation:
    """Measurements of both modes.

    Attributes
    ----------
    modes : tuple of Measured
        The paper's and the modern mode.
    fits : tuple of Fit
        Fitted constants, assessed by data left out.
    """

    modes: tuple[Measured, ...]
    fits: tuple[Fit, ...]

    @property
    def missed(self) -> tuple[Figure, ...]:
        """Figures that do not keep to what is asked of them."""
        figures = (figure for mode in self.modes for figure in mode.figures())
        return tuple(figure for figure in figures if not figure.is_met)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {
            "is_met": not self.missed,
            "missed": [figure.name for figure in self.missed],
            "modes": [mode.to_dict() for mode in self.modes],
            "fits": [found.to_dict() for found in self.fits],
        }


def measure(mode: Mode, monitor: Monitor, *, is_bound: bool) -> Measured:
    """Show one mode of the metric all that people were shown.

    Parameters
    ----------
    mode : Mode
        The metric.
    monitor : Monitor
        Is told of each stimulus.
    is_bound : bool
        Whether anything is asked of this mode.

    Notes
    -----
    About a minute and a quarter of CPU time.
    """
    return Measured(
        mode=mode.name,
        is_bound=is_bound,
        thresholds=modelfest.measure(mode, monitor),
        masking=foley.measure(mode, monitor),
        sensitivities={study: sensitivity.measure(study, mode) for study in sensitivity.STUDIES},
        losses=moving_texture.measure(mode, monitor),
        flicker=flicker.measure(mode, monitor),
    )


def validate(monitor: Monitor) -> Validation:
    """Both modes, of which something is asked of the modern one, and what was fitted.

    Parameters
    ----------
    monitor : Monitor
        Is told of each stimulus.
    """
    modes = (measure(PAPER, monitor, is_bound=False), measure(MODERN, monitor, is_bound=True))
    return Validation(modes, fits.measure(monitor))
