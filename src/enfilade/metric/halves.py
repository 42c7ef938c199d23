"""The published metric for noisy images: differences that two independent halves of them share.

Two path-traced images differ in every pixel, by noise. Of two halves of both, from independent paths, each
has a difference D_a, D_b in every channel. Their noise is independent, so that the product D_a D_b has the
expectation of the squared difference of converged images, at any number of paths, and (D_a - D_b)^2 / 2 that
of the noise of a half. Both are integrated under the aperture of the modern mode. The shared energy counts as
far as it exceeds that of the noise; without noise it counts whole. Masking contrasts are products of both
halves as well.

Of images without noise this is the published metric with energies integrated over space.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enfilade.metric.aperture import APERTURE_SIGMA_DEG, Aperture
from enfilade.metric.channels import ChannelBank, uniform_part
from enfilade.metric.comparison import Comparison
from enfilade.metric.cortex import Band
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.inputs import check_pair, fill_undefined
from enfilade.metric.masking import MASK_SLOPE, check_mask_slope, threshold_elevation
from enfilade.metric.paper import adapt
from enfilade.metric.pooling import POOLING_EXPONENT, Pool, raised
from enfilade.metric.sensitivity import SensitivityTable, coarse_velocity
from enfilade.records import F32, Mask
from enfilade.settings import Pursuit
from enfilade.viewing import Viewing

# dB, on all sensitivities. The one fitted number: the mean of ModelFest's 41 targets, and no other data
# (`tests/studies/test_modelfest.py` fits it again). Eq. 4 alone has errors of 3.9 dB RMS with it.
GAIN_DB = 2.36


@dataclass(frozen=True, eq=False)
class LuminanceHalves:
    """Luminance on the screen of two independent halves of an image, (H, W) float32 cd/m2."""

    first: F32
    second: F32


class HalvesAqm:
    """The published metric on images in two halves each, for one viewing condition and image size.

    Parameters
    ----------
    viewing, mask_slope
        As in `Aqm.paper`.
    """

    def __init__(self, viewing: Viewing, *, mask_slope: float = MASK_SLOPE) -> None:
        check_mask_slope(mask_slope)
        self.viewing = viewing
        self._mask_slope = mask_slope
        self._bank = ChannelBank(viewing, oversampling=1.0)
        gain = 10.0 ** (GAIN_DB / 20.0)
        self._table = SensitivityTable(
            lambda rho, velocity, _: gain * spatiovelocity_sensitivity(rho, velocity),
            self._bank.bands,
            viewing.pixels_per_degree,
        )
        self._aperture = Aperture(self._bank.image_shape, viewing.pixels_per_degree, APERTURE_SIGMA_DEG)

    def compare_each(
        self,
        test: LuminanceHalves,
        reference: LuminanceHalves,
        *,
        pursuits: Sequence[Pursuit],
        velocity: F32 | None = None,
        valid: Mask | None = None,
    ) -> list[Comparison]:
        """Predict the visible differences of two images for each of several eye movements; see `Aqm.compare`.

        Parameters
        ----------
        test, reference : LuminanceHalves
            The noise of all four images is independent.
        pursuits
            Eye movements while the image moves.
        velocity, valid
            As in `Aqm.compare`.

        Returns
        -------
        list of Comparison
            One for each of `pursuits`; exactly zero where both halves are equal.

        Raises
        ------
        InputError
            As `Aqm.compare`.
        """
        is_valid = np.ones(self._bank.image_shape, np.bool_) if valid is None else valid
        filled = []
        for one, other in ((test.first, reference.first), (test.second, reference.second)):
            check_pair(self._bank.image_shape, one, other, velocity, valid)
            filled.append(fill_undefined(one, other, is_valid))
        (test_a, reference_a), (test_b, reference_b) = filled

        # Adapt to the mean of the reference, and transform both references and both differences.
        adaptation = adapt(np.float32(0.5) * (reference_a + reference_b), is_valid)
        images = [adaptation.respond(one) for one in (reference_a, reference_b, test_a, test_b)]
        spectra = self._bank.spectra(*images[:2], images[2] - images[0], images[3] - images[1])
        moving = None if velocity is None else coarse_velocity(velocity, is_valid)
        eyes = [
            (
                adaptation.sensitivity(self._table, is_valid.shape, moving, pursuit.hypotheses),
                Pool(len(self._bank.bands), is_valid, POOLING_EXPONENT),
            )
            for pursuit in pursuits
        ]

        # Integrate what the halves share, and mask it.
        for band in self._bank.bands:
            ring, weights = self._bank.cortex.ring(spectra, band), [eye.weights(band) for eye, _ in eyes]
            for orientation in band.orientations:
                contrast = self._bank.crop(self._bank.cortex.fan(ring, band, orientation), band)
                for (sensitivity, pool), weight in zip(eyes, map(next, weights), strict=True):
                    channel = contrast * weight
                    tests = channel[:2] + channel[2:]
                    if band.is_base:
                        more = sensitivity.at_rest(band) - weight  # the uniform part stands still
                        sampled = is_valid[:: band.reduction, :: band.reduction]
                        channel[2:] += [uniform_part(one, sampled) * more for one in contrast[2:]]
                    products = _excess(*channel[2:]), channel[0] * channel[1], tests[0] * tests[1]
                    area = pool.area(band.reduction)
                    energy, *maskers = (self._integrated(one, area, band) for one in products)
                    elevation = threshold_elevation(np.sqrt(np.minimum(*maskers)), self._mask_slope)
                    energy /= np.square(elevation)
                    pool.add(band.level, raised(energy), self._aperture.reduction)
        return [pool.comparison() for _, pool in eyes]

    def _integrated(self, product: F32, area: F32 | None, band: Band) -> F32:
        """Energy under the aperture, 0 or more."""
        valid = product if area is None else product * area
        energy = self._aperture.integrate(self._aperture.coarse(valid, band.reduction), band.reduction)
        return np.maximum(energy, np.float32(0.0))


def _excess(first: F32, second: F32) -> F32:
    """Shared less unshared energy of two halves, a b - (a - b)^2 / 2; signed."""
    excess: F32 = first * second - np.float32(0.5) * np.square(first - second)
    return excess
