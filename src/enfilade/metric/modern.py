"""The modern metric: the published chain with each stage brought up to later measurements of vision."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enfilade.metric.adaptation import adapting_luminance
from enfilade.metric.aperture import APERTURE_SIGMA_DEG, REFERENCE_AREA_DEG2, Aperture, patch_gain
from enfilade.metric.castlecsf import castlecsf_sensitivity
from enfilade.metric.channels import ChannelBank
from enfilade.metric.comparison import Comparison
from enfilade.metric.cortex import Band, Complex64
from enfilade.metric.direction import MotionDirection
from enfilade.metric.eye import EYE_DRIFT_DEG_S
from enfilade.metric.inputs import Pair
from enfilade.metric.pooling import Pool
from enfilade.metric.pyramid import Pyramid
from enfilade.metric.sensitivity import ChannelSensitivity, SensitivityTable
from enfilade.metric.transducer import Transducer, energy_difference
from enfilade.metric.transient import FlickerWeight
from enfilade.records import F32, F64
from enfilade.settings import Pursuit
from enfilade.viewing import Viewing

CHANNEL_EXPONENT = 1.0  # no unit, of energies: contrasts add with exponent 2, without ripple between channels
MIDDLE_GREY = 0.18  # of the screen's peak: luminance at which the CSF within bands is taken
TRANSDUCER = Transducer()


class ModernMetric:
    """The modern metric for one viewing condition and image size; see `Aqm.modern`.

    1. Contrast over the adapting luminance around each pixel: `adaptation`.
    2. Cortex transform (Watson 1987, Daly 1993), the CSF within each band included: `channels`, `cortex`.
    3. Retinal velocity (Eq. 5), and the smear of held frames: `eye`.
    4. castleCSF by luminance and velocity (Ashraf et al. 2024): `castlecsf`, `sensitivity`.
    5. Contrast energy integrated over an aperture (Watson and Ahumada 2005): `aperture`.
    6. Sensitivity corrected for the direction of motion within a channel: `direction`.
    7. Masking by a transducer, over orientations and bands (Legge and Foley 1980, Foley 1994): `transducer`.
    8. Errors that change from frame to frame, by the transient channel of castleCSF: `transient`.
    9. Pooling over channels and probability of detection (§6): `pooling`, `comparison`.

    Parameters
    ----------
    viewing
        As in `Aqm.modern`.
    transducer : Transducer
        Constants of masking.
    aperture_sigma_deg : float
        Standard deviation of the aperture, degrees.
    """

    has_transient = True

    def __init__(
        self,
        viewing: Viewing,
        *,
        transducer: Transducer = TRANSDUCER,
        aperture_sigma_deg: float = APERTURE_SIGMA_DEG,
    ) -> None:
        self.viewing = viewing
        self._transducer = transducer
        self._gain = patch_gain(aperture_sigma_deg)
        self._bank = ChannelBank(viewing, tilt=self._csf_within_band, oversampling=1.0)
        self.bands = self._bank.bands
        density = viewing.pixels_per_degree
        self._aperture = Aperture(self._bank.image_shape, density, aperture_sigma_deg)
        self._table = SensitivityTable(self._csf, self.bands, density, by_luminance=True)
        self._flicker = FlickerWeight(self.bands, viewing, self._gain)

    def compare(self, pair: Pair, eyes: Sequence[Pursuit]) -> Comparison:
        """Compare two images; the most sensitive of several eye movements counts."""
        # Adapt to the luminance around each pixel.
        luminance = adapting_luminance(pair.reference, self.viewing.pixels_per_degree)
        adapting = Pyramid(luminance)
        sensitivity = ChannelSensitivity(
            self._table,
            pair.valid.shape,
            adapting=adapting,
            contrast=Pyramid(np.float32(1.0) / luminance),
            velocity=pair.velocity,
            eyes=eyes,
            hold_s=self.viewing.persistence / self.viewing.fps,
        )
        # Transform the difference rather than the test, so that equal images give exactly zero.
        spectra = self._bank.spectra(pair.reference - luminance, pair.test - pair.reference)
        # Integrate energies, then compare them, masked by those of the same band and its neighbours.
        pool = Pool(len(self.bands), pair.valid, CHANNEL_EXPONENT)
        energies = self._energies(pair, spectra, sensitivity, pool)
        for index, band in enumerate(self.bands):
            neighbours = energies[max(index - 1, 0) : index] + energies[index + 1 : index + 2]
            jnd = self._transducer.difference(energies[index], neighbours)
            pool.add(band.level, jnd.sum(axis=0), self._aperture.reduction)
        # Add the change of the error, all orientations together; nothing masks it.
        if pair.change is not None:
            spectrum = self._bank.spectra(pair.change)[0]
            for band in self.bands:
                change = self._aperture.coarse(np.square(self._bank.ring(spectrum, band)), band.reduction)
                energy = self._aperture.integrate(change, band.reduction)
                energy *= np.square(self._flicker.at(band, adapting.at(self._aperture.reduction)))
                jnd = self._transducer.difference(np.stack((np.zeros_like(energy), energy, energy))[:, None])
                pool.add(band.level, jnd[0], self._aperture.reduction, is_transient=True)
        return pool.comparison()

    def _energies(
        self, pair: Pair, spectra: Complex64, sensitivity: ChannelSensitivity, pool: Pool
    ) -> list[F32]:
        """Integrated energies of each band, (3, n, h', w') as `Transducer` takes them."""
        found = []
        for band in self.bands:
            area = pool.area(band.reduction)
            channels = self._bank.channels(spectra, band, pair.valid)
            if pair.velocity is not None and not band.is_base:
                direction = MotionDirection(sensitivity, pair.velocity, self._aperture, band)
                contrast = sensitivity.contrast(band)
                for channel in channels:
                    difference = channel.counted * contrast
                    direction.accumulate(
                        difference, _energies(channel.reference * contrast, difference, area)
                    )
                found.append(direction.integrated())
                continue
            energies = np.empty((3, len(band.orientations), *self._aperture.shape), dtype=np.float32)
            for index, (channel, weight) in enumerate(zip(channels, sensitivity.weights(band), strict=True)):
                # Express contrasts in units of the threshold; the uniform part stands still.
                difference = channel.counted * weight
                if channel.uniform is not None:
                    difference += channel.uniform * sensitivity.at_rest(band)
                maps = _energies(channel.reference * weight, difference, area)
                energies[:, index] = [self._aperture.coarse(energy, band.reduction) for energy in maps]
            found.append(self._aperture.integrate(energies, band.reduction))
        return found

    def _csf(self, frequency_cpd: float, velocity_deg_s: F64, luminance_cd_m2: F64) -> F64:
        """Sensitivity to patterns that move over the retina, scaled for the aperture (castleCSF)."""
        hertz = velocity_deg_s * frequency_cpd
        return self._gain * castlecsf_sensitivity(frequency_cpd, hertz, luminance_cd_m2, REFERENCE_AREA_DEG2)

    def _csf_within_band(self, rho_cpp: F32, band: Band, base: Band) -> F32:
        """The CSF of a still image relative to that of the band's centre, level below half the base's."""
        density = self.viewing.pixels_per_degree
        rho = np.maximum(rho_cpp, 0.5 * base.centre_cpp).astype(np.float64) * density
        grey = MIDDLE_GREY * self.viewing.peak_cd_m2
        here, centre = (
            castlecsf_sensitivity(f, EYE_DRIFT_DEG_S * f, grey, REFERENCE_AREA_DEG2)
            for f in (rho, np.asarray(band.centre_cpp * density))
        )
        return np.asarray(here / centre, dtype=np.float32)


def _energies(reference: F32, difference: F32, area: F32 | None) -> tuple[F32, F32, F32]:
    """Energies of `energy_difference`, the difference over the valid area only; overwrites the reference."""
    maps = energy_difference(reference, reference + difference)
    if area is not None:
        np.multiply(maps[2], area, out=maps[2])
    return maps
