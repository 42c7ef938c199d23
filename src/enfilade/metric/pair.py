"""Two images on their way through the channels: responses, adaptation, spectra, noise (Fig. 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.adaptation import DARKEST_CD_M2, AdaptingLight, adapting_luminance
from enfilade.metric.amplitude import contrast_shrinkage, response
from enfilade.metric.borders import MirrorBorder
from enfilade.metric.cortex import Complex64Array, CortexTransform
from enfilade.metric.noise import ChannelNoise, NoiseFilters, response_noise

__all__ = ["ImagePair", "Retina"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ImagePair:
    """Two images on their way through the channels.

    Attributes
    ----------
    spectra : (2 or 3, padded height, padded width / 2 + 1) complex64
        Of the reference's response, its mean taken off, of the difference test - reference, and of
        the change of that since the last frame.
    light : AdaptingLight
        Luminance that the eye is adapted to.
    contrast : AdaptingLight
        What turns responses into contrasts of luminance: 1 / (mean R * g), or 1 / light.
    noise : ChannelNoise or None
        Noise in the difference of the responses.
    is_judged : (H, W) bool
        Pixels that count.
    """

    spectra: Complex64Array
    light: AdaptingLight
    contrast: AdaptingLight
    noise: ChannelNoise | None
    is_judged: BoolArray

    def uniform_part(self, difference: Float32Array, reduction: int) -> float:
        """Median over the judged area of a coarse map of differences, 0 where nothing is judged.

        The part of a difference that is the same everywhere has no frequency, so that it does not
        move over the retina however fast the image does, and it is seen as if it stood still. (As
        part of the base band it would be taken for a pattern of 0.2 cycles per degree, to which
        Eq. 4 is thirty times more sensitive at 20 deg/s than at rest.) The median rather than the mean
        leaves a local defect local.
        """
        is_judged = self.is_judged[::reduction, ::reduction]
        rows, columns = is_judged.shape
        judged = difference[:rows, :columns][is_judged]
        return float(np.median(judged)) if judged.size else 0.0


class Retina:
    """Makes pairs of one size: from luminance to spectra, with what the eye is adapted to.

    Parameters
    ----------
    border : MirrorBorder
        Continues the images.
    cortex : CortexTransform
        Transforms them.
    pixels_per_degree : float
        Of the viewing conditions.
    is_adaptive : bool
        Contrast over the light around each pixel, instead of contrast of the retina's response
        over the mean of the image.
    """

    def __init__(
        self, border: MirrorBorder, cortex: CortexTransform, pixels_per_degree: float, *, is_adaptive: bool
    ) -> None:
        self._border = border
        self._cortex = cortex
        self._pixels_per_degree = pixels_per_degree
        self._is_adaptive = is_adaptive
        self._noise_filters: NoiseFilters | None = None

    def pair(
        self,
        test: Float32Array,
        reference: Float32Array,
        is_judged: BoolArray,
        noise_variance: Float32Array | None,
        change: Float32Array | None,
    ) -> ImagePair:
        """Take two images in.

        Parameters
        ----------
        test, reference, is_judged, noise_variance, change
            As in `Aqm.compare`; equal and finite where not judged.
        """
        mean_cd_m2 = max(_mean(reference, is_judged), DARKEST_CD_M2)
        respond = _as_it_is if self._is_adaptive else response
        response_test, response_reference = respond(test), respond(reference)
        mean = np.float32(_mean(response_reference, is_judged))
        # The difference is transformed rather than the test, so that equal images give zero.
        planes = [response_reference - mean, response_test - response_reference]
        planes += [] if change is None else [change]
        images = np.empty((len(planes), *self._border.padded_shape), dtype=np.float32)
        for image, plane in zip(images, planes, strict=True):
            image[...] = self._border.pad(plane)
        if self._is_adaptive:
            light = AdaptingLight(adapting_luminance(reference, self._pixels_per_degree))
            contrast = AdaptingLight(np.float32(1.0) / light.at(1))
        else:
            light = AdaptingLight(np.asarray(mean_cd_m2, dtype=np.float32))
            darkest = response(np.asarray(DARKEST_CD_M2, dtype=np.float32))
            scale = 1.0 / (max(float(mean), float(darkest)) * contrast_shrinkage(mean_cd_m2))
            contrast = AdaptingLight(np.asarray(scale, dtype=np.float32))
        noise = None
        if noise_variance is not None:
            variance = np.where(is_judged, noise_variance, np.float32(0.0))
            noise = self._channel_noise(test, reference, variance)
        return ImagePair(self._cortex.spectra(images), light, contrast, noise, is_judged)

    def _channel_noise(
        self, test: Float32Array, reference: Float32Array, variance: Float32Array
    ) -> ChannelNoise:
        if self._noise_filters is None:
            self._noise_filters = NoiseFilters(self._cortex)
        if not self._is_adaptive:
            variance = response_noise(np.float32(0.5) * (test + reference), variance)
        return ChannelNoise(self._noise_filters, self._border.pad(variance))


def _mean(image: Float32Array, is_judged: BoolArray) -> float:
    weight = max(int(np.count_nonzero(is_judged)), 1)
    return float(image.sum(dtype=np.float64, where=is_judged)) / weight


def _as_it_is(luminance_cd_m2: Float32Array) -> Float32Array:
    return luminance_cd_m2
