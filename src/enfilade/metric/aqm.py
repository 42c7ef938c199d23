"""The animation quality metric: from two images to a map of visible differences (§3.4, Fig. 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError
from enfilade.metric.amplitude import contrast_shrinkage, response
from enfilade.metric.borders import MirrorBorder, fill_undefined
from enfilade.metric.comparison import Comparison, Pool
from enfilade.metric.cortex import (
    ORIENTATIONS_DEG,
    Band,
    Complex64Array,
    CortexTransform,
    Partition,
    bands,
)
from enfilade.metric.csf import spatiovelocity_sensitivity
from enfilade.metric.eye import Pursuit, retinal_velocity
from enfilade.metric.inputs import check_luminance, check_map, check_valid
from enfilade.metric.masking import MASK_SLOPE, masked_difference_squared
from enfilade.metric.noise import NOISE_SIGMAS, ChannelNoise, NoiseFilters, response_noise
from enfilade.metric.pooling import raised
from enfilade.metric.pyramid import halved_shape
from enfilade.metric.sensitivity import ChannelSensitivity, SensitivityTable
from enfilade.viewing import Viewing

__all__ = ["Aqm"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]

DARKEST_CD_M2 = 1e-3  # an image darker than this on average is judged as if it were this bright


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two images on their way through the channels.

    Attributes
    ----------
    spectra : (2, padded height, padded width / 2 + 1) complex64
        Of the reference's response, its mean taken off, and of the difference test - reference.
    contrast_scale : float
        From response to luminance contrast: 1 / (mean R * g).
    noise : ChannelNoise or None
        Noise in the difference of the responses.
    is_judged : (H, W) bool
        Pixels that count.
    """

    spectra: Complex64Array
    contrast_scale: float
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


class Aqm:
    """The animation quality metric for one viewing condition and image size (§3.4).

    Stages, each a module: amplitude nonlinearity, Cortex transform, contrast over the mean of the
    reference, sensitivity by retinal velocity (Eq. 4 and 5), mutual masking, pooling. Filters are
    made once and reused from frame to frame. One instance serves one thread at a time.

    Parameters
    ----------
    viewing : Viewing
        Screen, distance and size of the images. `Viewing.cropped` serves for images that are a
        part of the screen.
    pursuit : Pursuit
        What the eye does while the image moves; `compare` may override it.
    mask_slope : float
        Slope of visual masking, 0 to 1 (`metric.masking`).
    workers : int
        Threads of the FFT, 1 or more.

    Raises
    ------
    InputError
        `mask_slope` or `workers` is out of range.

    Notes
    -----
    What it does not see: colour, flicker (each frame is judged alone), anything that depends on
    the luminance of the surround, the fall of acuity away from the gaze. Contrasts are over the
    mean of the whole image, so errors in dark corners of a bright image count less than they look.
    Images of any size from 1x1 up are continued by mirroring; the number of radial levels depends
    on the pixels per degree only.

    Cost: about 0.3 s of CPU time for a pair of 640x480 (see `benchmarks/metric.py`).
    """

    def __init__(
        self,
        viewing: Viewing,
        *,
        pursuit: Pursuit = Pursuit.BOTH,
        mask_slope: float = MASK_SLOPE,
        workers: int = 1,
    ) -> None:
        if not 0.0 <= mask_slope <= 1.0:
            msg = f"metric: mask_slope is {mask_slope!r}; give a number from 0 to 1"
            raise InputError(msg)
        if workers < 1:
            msg = f"metric: workers is {workers!r}; give 1 or more threads"
            raise InputError(msg)
        self.viewing = viewing
        self.pursuit = pursuit
        self.mask_slope = mask_slope
        self._shape = (viewing.height_px, viewing.width_px)
        density = viewing.pixels_per_degree
        base = bands(density)[-1]
        self._border = MirrorBorder(
            *self._shape,
            margin_px=2 ** (base.level - 1),  # one period of the lowest ring's centre
            multiple_px=2 * base.reduction,
        )
        self.cortex = CortexTransform(
            *self._border.padded_shape, density, partition=Partition.POWER, workers=workers
        )
        self._table = SensitivityTable(spatiovelocity_sensitivity, self.cortex.bands, density)
        self._noise_filters: NoiseFilters | None = None

    def compare(
        self,
        test: Float32Array,
        reference: Float32Array,
        *,
        velocity: Float32Array | None = None,
        valid: BoolArray | None = None,
        noise_variance: Float32Array | None = None,
        pursuit: Pursuit | None = None,
    ) -> Comparison:
        """Where a viewer sees a difference between two images, and how surely.

        Parameters
        ----------
        test, reference : (H, W) float32
            Luminance on the screen, cd/m2 (`pixels.tone.display_luminance`), 0 or more. The
            reference's mean sets contrast and adaptation; otherwise the two are treated alike.
        velocity : (H, W, 2) float32, optional
            Image velocity, deg/s, x to the right and y down: the mean of backward and forward flow.
            None: nothing moves.
        valid : (H, W) bool, optional
            Pixels to judge. Others may hold anything; they are filled from the other image.
        noise_variance : (H, W) float32, optional
            Variance of the Monte Carlo noise in test - reference, (cd/m2)^2, which is the sum of
            the two images' variances when their samples are independent. See `metric.noise` for
            how much of a difference is then not counted.
        pursuit : Pursuit, optional
            Instead of the one given to the constructor.

        Returns
        -------
        Comparison
            Maps and figures; exactly zero when the images are equal.

        Raises
        ------
        InputError
            An array has the wrong type or shape, or judged pixels that are NaN, infinite or
            negative; the message names the array and the first such pixel.
        """
        self._check(test, reference, velocity, valid, noise_variance)
        is_judged = np.ones(self._shape, dtype=np.bool_) if valid is None else valid
        test, reference = fill_undefined(test, reference, valid)
        spectra, scale = self._transformed(test, reference, is_judged)
        noise = None
        if noise_variance is not None:
            variance = np.where(is_judged, noise_variance, np.float32(0.0))
            noise = self._channel_noise(test, reference, variance)
        pair = _Pair(spectra, scale, noise, is_judged)
        velocities = self._retinal_velocities(velocity, is_judged, pursuit or self.pursuit)
        pool = Pool(self.cortex.bands, is_judged)
        rings = [self.cortex.ring(spectra, band) for band in self.cortex.bands]
        for orientation in (*range(len(ORIENTATIONS_DEG)), None):
            sensitivity = ChannelSensitivity(self._table, velocities, orientation)
            for band, ring in zip(self.cortex.bands, rings, strict=True):
                if orientation in self.cortex.orientations(band):
                    squared = self._channel_squared(pair, ring, band, orientation, sensitivity)
                    pool.add(band, raised(squared))
        return pool.comparison()

    def _check(
        self,
        test: Float32Array,
        reference: Float32Array,
        velocity: Float32Array | None,
        valid: BoolArray | None,
        noise_variance: Float32Array | None,
    ) -> None:
        if valid is not None:
            check_valid(valid, self._shape)
        check_luminance("test", test, self._shape, valid)
        check_luminance("reference", reference, self._shape, valid)
        if velocity is not None:
            check_map("velocity", velocity, (*self._shape, 2), valid, is_signed=True)
        if noise_variance is not None:
            check_map("noise_variance", noise_variance, self._shape, valid, is_signed=False)

    def _transformed(
        self, test: Float32Array, reference: Float32Array, is_judged: BoolArray
    ) -> tuple[Complex64Array, float]:
        response_test, response_reference = response(test), response(reference)
        weight = max(int(np.count_nonzero(is_judged)), 1)
        mean = float(response_reference.sum(dtype=np.float64, where=is_judged)) / weight
        adapted = float(reference.sum(dtype=np.float64, where=is_judged)) / weight
        darkest = float(response(np.asarray(DARKEST_CD_M2, dtype=np.float32)))
        scale = 1.0 / (max(mean, darkest) * contrast_shrinkage(max(adapted, DARKEST_CD_M2)))
        # The difference is transformed rather than the test, so that equal images give zero.
        images = np.empty((2, *self._border.padded_shape), dtype=np.float32)
        images[0] = self._border.pad(response_reference - np.float32(mean))
        images[1] = self._border.pad(response_test - response_reference)
        return self.cortex.spectra(images), scale

    @staticmethod
    def _retinal_velocities(
        velocity: Float32Array | None, is_judged: BoolArray, pursuit: Pursuit
    ) -> list[Float32Array]:
        if velocity is None:
            return []
        planes = np.where(is_judged, np.moveaxis(velocity, -1, 0), np.float32(0.0))
        return [retinal_velocity(planes, eye) for eye in pursuit.hypotheses]

    def _channel_noise(
        self, test: Float32Array, reference: Float32Array, variance: Float32Array
    ) -> ChannelNoise:
        if self._noise_filters is None:
            self._noise_filters = NoiseFilters(self.cortex)
        mean = np.float32(0.5) * (test + reference)
        return ChannelNoise(self._noise_filters, self._border.pad(response_noise(mean, variance)))

    def _channel_squared(
        self,
        pair: _Pair,
        ring: Complex64Array,
        band: Band,
        orientation: int | None,
        sensitivity: ChannelSensitivity,
    ) -> Float32Array:
        """Squared JND of one channel, a map at the band's reduced size."""
        shape = halved_shape(self._shape, band.reduction)
        channel = self.cortex.fan(ring, band, orientation)
        reference, difference = self._border.crop(channel, band.reduction, shape)
        # Mutual masking: the smaller contrast of the two images masks.
        masker = reference + difference
        np.abs(masker, out=masker)
        np.minimum(masker, np.abs(reference, out=reference), out=masker)
        uniform = pair.uniform_part(difference, band.reduction) if band.is_base else 0.0
        difference -= np.float32(uniform)
        np.abs(difference, out=difference)
        if pair.noise is not None:
            deviation = pair.noise.deviation(band, orientation)
            deviation = self._border.crop(deviation, band.reduction, shape)
            difference -= np.float32(NOISE_SIGMAS) * deviation
            np.maximum(difference, np.float32(0.0), out=difference)
        # To units of the channel's threshold.
        weight = sensitivity.map(band) * np.float32(pair.contrast_scale)
        masker *= weight
        difference *= weight
        if uniform:
            still = self._table.row(band)[0] * np.float32(pair.contrast_scale)
            difference += still * np.float32(abs(uniform))
        return masked_difference_squared(difference, masker, self.mask_slope)
