"""The whole validation: both modes over all that is known of people, and what each departure earns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from enfilade.metric import MetricOptions
from enfilade.monitor import Monitor
from studies.observers import fits, flicker, foley, modelfest, moving_texture, sensitivity
from studies.observers.figures import Figure, Measured
from studies.observers.fits import Fit
from studies.observers.mode import MODERN, PAPER, Mode

__all__ = ["Validation", "ablate", "measure", "validate"]


@dataclass(frozen=True, eq=False)
class Validation:
    """What was measured.

    Attributes
    ----------
    modes : tuple of Measured
        The paper's and the modern mode, or those of an ablation.
    fits : tuple of Fit
        What was fitted, judged by data left out; none for an ablation.
    """

    modes: tuple[Measured, ...]
    fits: tuple[Fit, ...] = ()

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
    return Validation(modes, fits.measure(MODERN, monitor))


def ablate(monitor: Monitor) -> Validation:
    """The paper's mode with each departure alone, the modern mode without each. Nothing is asked.

    Parameters
    ----------
    monitor : Monitor
        Is told of each stimulus.
    """
    return Validation(tuple(measure(mode, monitor, is_bound=False) for mode in ablations()))


def ablations() -> tuple[Mode, ...]:
    """The modes of `ablate`, in the order of the departures."""
    names = MetricOptions.departures()
    added = (Mode(f"paper + {name}", _with(name)) for name in names)
    taken = (Mode(f"modern - {name}", MODERN.options.without(name)) for name in names)
    return (PAPER, *added, MODERN, *taken)


def _with(departure: str) -> MetricOptions:
    value: Any = getattr(MODERN.options, departure)
    return replace(PAPER.options, **{departure: value})
