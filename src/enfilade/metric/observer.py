"""The observer that some options describe: which CSF at each band, which exponents."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.castle import castle_sensitivity
from enfilade.metric.cortex import OVERSAMPLING, Band
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.eye import EYE_DRIFT_DEG_S
from enfilade.metric.options import Fitted, MetricOptions
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.metric.spatial import REFERENCE_AREA_DEG2, SPATIAL_EXPONENT, patch_gain
from enfilade.metric.transient import flicker_sensitivity
from enfilade.viewing import Viewing

__all__ = ["Observer"]

Float32Array: TypeAlias = npt.NDArray[np.float32]
Float64Array: TypeAlias = npt.NDArray[np.float64]

LIGHT_KNOTS = np.geomspace(1e-3, 1e4, 64)  # cd/m2, between which sensitivity is a power of light
ENERGY = 2.0  # no unit: exponent with which channels sum without ripple
MIDDLE_GREY = 0.18  # of the screen's peak: where the CSF's course within bands is taken


class Observer:
    """Sensitivity, and the exponents of pooling, under some options.

    Parameters
    ----------
    viewing : Viewing
        Screen and distance.
    options : MetricOptions
        Departures from the paper.
    fitted : Fitted
        Of which the aperture counts.

    Attributes
    ----------
    channel_exponent : float
        Exponent with which the J of channels are summed.
    spatial_exponent : float
        Exponent with which J is gathered over the aperture.
    gain : float
        What spatial pooling asks of the sensitivities (`spatial.patch_gain`), else 1.
    oversampling : float
        Of the bands: energies that are gathered need none.
    """

    def __init__(self, viewing: Viewing, options: MetricOptions, fitted: Fitted) -> None:
        self._viewing = viewing
        self._options = options
        # Exponents are of contrast; the transducer's J is of energy already.
        power = ENERGY if options.transducer else 1.0
        self.channel_exponent = (ENERGY if options.ripple_free else POOLING_EXPONENT) / power
        self.spatial_exponent = SPATIAL_EXPONENT / power
        self.gain = patch_gain(fitted.aperture_sigma_deg) if options.spatial_pooling else 1.0
        self._flicker: dict[int, Float64Array] = {}
        gathers = options.transducer and options.spatial_pooling
        self.oversampling = 1.0 if gathers else OVERSAMPLING

    @property
    def knows_luminance(self) -> bool:
        """Whether sensitivity depends on luminance."""
        return self._options.csf == "castle"

    def csf(
        self, frequency_cpd: float, velocity_deg_s: Float64Array, luminance_cd_m2: Float64Array
    ) -> Float64Array:
        """Sensitivity to what moves over the retina, `gain` included; arrays broadcast."""
        if self.knows_luminance:
            hertz = velocity_deg_s * frequency_cpd
            sensitivity = castle_sensitivity(frequency_cpd, hertz, luminance_cd_m2, REFERENCE_AREA_DEG2)
        else:
            sensitivity = spatiovelocity_sensitivity(frequency_cpd, velocity_deg_s)
        return np.asarray(self.gain * sensitivity, dtype=np.float64)

    def tilt(self, rho_cpp: Float32Array, band: Band, base: Band) -> Float32Array:
        """The CSF within a band, relative to that of its centre, for a still image.

        Parameters
        ----------
        rho_cpp : (...) float32
            Radial frequency, cycles per pixel.
        band, base : Band
            The band, and the lowest one, below half of whose centre the CSF is taken as level.
        """
        density = self._viewing.pixels_per_degree
        rho = np.maximum(rho_cpp, 0.5 * base.centre_cpp).astype(np.float64) * density
        centre = np.asarray(band.centre_cpp * density)
        if self.knows_luminance:
            grey = MIDDLE_GREY * self._viewing.peak_cd_m2
            here, there = (
                castle_sensitivity(f, EYE_DRIFT_DEG_S * f, grey, REFERENCE_AREA_DEG2) for f in (rho, centre)
            )
        else:
            still = np.asarray(EYE_DRIFT_DEG_S)
            here, there = (
                np.asarray(spatiovelocity_sensitivity(f, still), dtype=np.float64) for f in (rho, centre)
            )
        return np.asarray(here / there, dtype=np.float32)

    def flicker_weight(self, band: Band, luminance_cd_m2: Float32Array) -> Float32Array:
        """From the change of the error, cd/m2, to units of its threshold, at some light."""
        if band.level not in self._flicker:
            frequency = band.centre_cpp * self._viewing.pixels_per_degree
            seen = flicker_sensitivity(frequency, self._viewing.fps, LIGHT_KNOTS, REFERENCE_AREA_DEG2)
            self._flicker[band.level] = 0.5 * self.gain * seen / LIGHT_KNOTS
        log_weight = np.log(self._flicker[band.level])
        weight = np.exp(np.interp(np.log(luminance_cd_m2), np.log(LIGHT_KNOTS), log_weight))
        return np.asarray(weight, dtype=np.float32)
