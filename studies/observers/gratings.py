"""Gratings of Robson 1966, Laird et al. 2006 and Rovamo et al. 1993, as a display shows them.

Robson's gratings flicker: their contrast is modulated sinusoidally in time, in a square field. Laird's drift
behind a Gaussian window that is at rest. Rovamo's are static, in square fields of 0.02 to 981 deg2; as in the
experiment, the distance of the screen changes with the spatial frequency, so that a period is always as wide.
Bars are upright, edges of fields are sharp, and the surround has the mean luminance. The phase of Robson's
gratings is our choice: the mean of the field stays constant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from enfilade.records import F64
from enfilade.viewing import Viewing
from studies.observers.screen import screen

FPS = 120.0  # of the display: 3.75 frames in a period of the fastest flicker, 32 Hz
PIXELS_PER_DEGREE = 40.0  # of the gratings that flicker or drift
FLICKER_SIZE_PX = 128  # 3.2 degrees, of which the field takes 2.5
LEAST_FLICKER_FRAMES = 12  # and a quarter of a period, from largest contrast to largest change
DRIFT_SIZE_PX = 240  # 6 degrees, 4.9 standard deviations of the window
DRIFT_FRAMES = 4  # frames differ in phase only; the first has no previous frame
PERIOD_PX = 12  # of static gratings
STATIC_SIZE_PX = 34 * PERIOD_PX  # the largest field has 31.5 periods


@dataclass(frozen=True)
class Grating:
    """A grating of an experiment.

    Attributes
    ----------
    frequency_cpd, temporal_hz : float
        Spatial and temporal frequency.
    luminance_cd_m2, area_deg2 : float
        Mean luminance and size: of a square field, or pi sigma^2 of a Gaussian window.
    sensitivity : float
        Of the observers, 1 / contrast at threshold.
    """

    frequency_cpd: float
    temporal_hz: float
    luminance_cd_m2: float
    area_deg2: float
    sensitivity: float


@dataclass(frozen=True, eq=False)
class Stimulus:
    """Frames of a grating.

    Attributes
    ----------
    viewing : Viewing
        Of the display.
    patterns : tuple of (H, W) float64
        Each frame at contrast 1: relative deviation from the mean luminance.
    step_px : float
        Motion to the right, pixels per frame.
    """

    viewing: Viewing
    patterns: tuple[F64, ...]
    step_px: float = 0.0


def flickering(grating: Grating) -> Stimulus:
    """Grating of Robson, from its largest contrast on; see LEAST_FLICKER_FRAMES."""
    x, y = _plane(FLICKER_SIZE_PX, PIXELS_PER_DEGREE)
    pattern = np.sin(2.0 * np.pi * grating.frequency_cpd * x) * _square(x, y, grating.area_deg2)
    count = max(LEAST_FLICKER_FRAMES, math.ceil(0.25 * FPS / grating.temporal_hz) + 1)
    contrasts = np.cos(2.0 * np.pi * grating.temporal_hz / FPS * np.arange(count))
    viewing = screen(FLICKER_SIZE_PX, PIXELS_PER_DEGREE, fps=FPS)
    return Stimulus(viewing, tuple(contrast * pattern for contrast in contrasts))


def drifting(grating: Grating) -> Stimulus:
    """Grating of Laird, which drifts to the right."""
    x, y = _plane(DRIFT_SIZE_PX, PIXELS_PER_DEGREE)
    window = np.exp(-0.5 * np.pi * (x**2 + y**2) / grating.area_deg2)
    periods = grating.temporal_hz / FPS
    patterns = tuple(
        np.cos(2.0 * np.pi * (grating.frequency_cpd * x - periods * frame)) * window
        for frame in range(DRIFT_FRAMES)
    )
    step_px = periods / grating.frequency_cpd * PIXELS_PER_DEGREE
    return Stimulus(screen(DRIFT_SIZE_PX, PIXELS_PER_DEGREE, fps=FPS), patterns, step_px)


def static(grating: Grating) -> Stimulus:
    """Grating of Rovamo, one frame."""
    pixels_per_degree = PERIOD_PX * grating.frequency_cpd
    x, y = _plane(STATIC_SIZE_PX, pixels_per_degree)
    pattern = np.cos(2.0 * np.pi * grating.frequency_cpd * x) * _square(x, y, grating.area_deg2)
    return Stimulus(screen(STATIC_SIZE_PX, pixels_per_degree, fps=FPS), (pattern,))


STIMULI: dict[str, Callable[[Grating], Stimulus]] = {
    "robson1966_cpd": flickering,
    "robson1966_hz": flickering,
    "laird2006": drifting,
    "rovamo1993": static,
}


def _plane(size_px: int, pixels_per_degree: float) -> tuple[F64, F64]:
    """Degrees from the centre, between four pixels: x to the right, y down.

    Unlike `screen.plane`, which centres on a pixel and makes the fields half a pixel too wide.
    """
    steps = (np.arange(size_px) - 0.5 * (size_px - 1)) / pixels_per_degree
    x, y = np.meshgrid(steps, steps)
    return x, y


def _square(x: F64, y: F64, area_deg2: float) -> F64:
    """1 in a square field, 0 around it."""
    return np.where(np.maximum(np.abs(x), np.abs(y)) <= 0.5 * math.sqrt(area_deg2), 1.0, 0.0)
