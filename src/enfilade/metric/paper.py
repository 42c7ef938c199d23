"""The published metric: the stages of Fig. 6 in their order (§3.2 to §3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enfilade.metric.adaptation import DARKEST_CD_M2
from enfilade.metric.amplitude import contrast_gain, response
from enfilade.metric.channels import ChannelBank
from enfilade.metric.comparison import Comparison
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.inputs import Pair
from enfilade.metric.masking import MASK_SLOPE, check_mask_slope, threshold_elevation
from enfilade.metric.pooling import POOLING_EXPONENT, Pool, raised
from enfilade.metric.pyramid import Pyramid
from enfilade.metric.sensitivity import ChannelSensitivity, SensitivityTable
from enfilade.records import F32, Mask
from enfilade.settings import Pursuit
from enfilade.viewing import Viewing


class PaperMetric:
    """The published metric for one viewing condition and image size; see `Aqm.paper`.

    1. Amplitude nonlinearity (Daly 1993), contrast over the mean of the reference: `amplitude`.
    2. Cortex transform (Watson 1987, Daly 1993): `channels`, `cortex`.
    3. Retinal velocity, with smooth pursuit and without (Eq. 5): `eye`.
    4. Spatiovelocity contrast sensitivity (Eq. 4): `csf`, `sensitivity`.
    5. Mutual visual masking by threshold elevation (Daly 1993): `masking`.
    6. Pooling over channels and probability of detection (§6): `pooling`, `comparison`.

    Parameters
    ----------
    viewing, mask_slope
        As in `Aqm.paper`.
    """

    has_transient = False

    def __init__(self, viewing: Viewing, *, mask_slope: float = MASK_SLOPE) -> None:
        check_mask_slope(mask_slope)
        self.viewing = viewing
        self._mask_slope = mask_slope
        self._bank = ChannelBank(viewing)
        self.bands = self._bank.bands
        self._table = SensitivityTable(
            lambda rho, velocity, _: spatiovelocity_sensitivity(rho, velocity),
            self.bands,
            viewing.pixels_per_degree,
        )

    def compare(self, pair: Pair, eyes: Sequence[Pursuit]) -> Comparison:
        """Compare two images; the most sensitive of several eye movements counts."""
        # Respond to luminance; the reference's mean sets adaptation and contrast.
        adaptation = adapt(pair.reference, pair.valid)
        test, reference = adaptation.respond(pair.test), adaptation.respond(pair.reference)
        # Transform the difference rather than the test, so that equal images give exactly zero.
        spectra = self._bank.spectra(reference, test - reference)
        sensitivity = adaptation.sensitivity(self._table, pair.valid.shape, pair.velocity, eyes)
        pool = Pool(len(self.bands), pair.valid, POOLING_EXPONENT)
        for band in self.bands:
            channels = self._bank.channels(spectra, band, pair.valid)
            for channel, weight in zip(channels, sensitivity.weights(band), strict=True):
                # Express contrasts in units of the threshold; the uniform part stands still.
                difference = channel.counted * weight
                if channel.uniform is not None:
                    difference += channel.uniform * sensitivity.at_rest(band)
                # Elevate the threshold by the lower contrast of the two images.
                masker = np.abs(channel.reference + channel.difference)
                masker = np.minimum(np.abs(channel.reference), masker) * weight
                difference /= threshold_elevation(masker, self._mask_slope)
                pool.add(band.level, raised(np.square(difference)), band.reduction)
        return pool.comparison()


@dataclass(frozen=True)
class Adaptation:
    """State of an eye adapted to the mean of an image.

    Attributes
    ----------
    luminance_cd_m2 : float
        Mean luminance.
    mean_response : float
        Mean response (`metric.amplitude`).
    contrast : float
        Luminance contrast of a response of one.
    """

    luminance_cd_m2: float
    mean_response: float
    contrast: float

    def respond(self, luminance_cd_m2: F32) -> F32:
        """Response to an image, less the mean."""
        return response(luminance_cd_m2) - np.float32(self.mean_response)

    def sensitivity(
        self,
        table: SensitivityTable,
        shape: tuple[int, int],
        velocity: F32 | None,
        eyes: Sequence[Pursuit],
    ) -> ChannelSensitivity:
        """Sensitivity to responses of channels; the arguments are those of `ChannelSensitivity`."""
        return ChannelSensitivity(
            table,
            shape,
            adapting=Pyramid(np.asarray(self.luminance_cd_m2, dtype=np.float32)),
            contrast=Pyramid(np.asarray(self.contrast, dtype=np.float32)),
            velocity=velocity,
            eyes=eyes,
        )


def adapt(reference_cd_m2: F32, valid: Mask) -> Adaptation:
    """Adapt to the valid pixels of an image."""
    adapting = max(_mean(reference_cd_m2, valid), DARKEST_CD_M2)
    mean = _mean(response(reference_cd_m2), valid)
    darkest = float(response(np.asarray(DARKEST_CD_M2, dtype=np.float32)))
    return Adaptation(adapting, mean, 1.0 / (max(mean, darkest) * contrast_gain(adapting)))


def _mean(image: F32, valid: Mask) -> float:
    return float(image.sum(dtype=np.float64, where=valid)) / max(int(np.count_nonzero(valid)), 1)
