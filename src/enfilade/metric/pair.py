"""Two images on their way through the channels: responses, adaptation, spectra, noise (Fig. 6)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.metric.adaptation import DARKEST_CD_M2, AdaptingLight, adapting_luminance
from enfilade.metric.amplitude import contrast_shrinkage, response
from enfilade.metric.borders import MirrorBorder
from enfilade.metric.cortex import Complex64Array, CortexTransform
from enfilade.metric.noise import ChannelNoise, Noise, NoiseFilters, response_noise

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

    def uniform_part(self, difference: Float32Array, reduction: int) -> Float32Array:
        """The part of a coarse map of differences that is the same everywhere.

        At each pixel what it has of the median over the judged area: all of it, or less where its own
        difference is less or of the other sign. 0 where nothing is judged.

        The part of a difference that is the same everywhere has no frequency, so that it does not
        move over the retina however fast the image does, and it is seen as if it stood still. (As
        part of the base band it would be taken for a pattern of 0.2 cycles per degree, to which
        Eq. 4 is thirty times more sensitive at 20 deg/s than at rest.) The median rather than the mean
        leaves a local defect local; and where most of an image differs, the rest that does not stays 0.
        """
        is_judged = self.is_judged[::reduction, ::reduction]
        rows, columns = is_judged.shape
        judged = difference[:rows, :columns][is_judged]
        median = np.float32(np.median(judged) if judged.size else 0.0)
        return np.clip(difference, np.minimum(median, 0.0), np.maximum(median, 0.0))


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

    def pair(
        self,
        test: Float32Array,
        reference: Float32Array,
        is_judged: BoolArray,
        noise: Noise | None,
        change: Float32Array | None,
    ) -> ImagePair:
        """Take two images in.

        Parameters
        ----------
        test, reference, is_judged, change
            As in `Aqm.compare`; equal and finite where not judged.
        noise : Noise or None
            In test - reference.
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
        channel_noise: ChannelNoise | None = None
        if noise is not None:
            variance = np.where(is_judged, noise.variance, np.float32(0.0))
            if not self._is_adaptive:
                variance = response_noise(np.float32(0.5) * (test + reference), variance)
            blur_px = None if noise.blur_px is None else self._border.pad(noise.blur_px)
            channel_noise = ChannelNoise(self._noise_filters, self._border.pad(variance), blur_px)
        return ImagePair(self._cortex.spectra(images), light, contrast, channel_noise, is_judged)

    @cached_property
    def _noise_filters(self) -> NoiseFilters:
        return NoiseFilters(self._cortex)


def _mean(image: Float32Array, is_judged: BoolArray) -> float:
    weight = max(int(np.count_nonzero(is_judged)), 1)
    return float(image.sum(dtype=np.float64, where=is_judged)) / weight


def _as_it_is(luminance_cd_m2: Float32Array) -> Float32Array:
    return luminance_cd_m2
