"""The animation quality metric: from two images to a map of visible differences (§3.4, Fig. 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError
from enfilade.metric.adaptation import DARKEST_CD_M2, AdaptingLight, adapting_luminance
from enfilade.metric.amplitude import contrast_shrinkage, response
from enfilade.metric.borders import MirrorBorder, fill_undefined
from enfilade.metric.comparison import Comparison, Pool, PoolingRule
from enfilade.metric.cortex import (
    ORIENTATIONS_DEG,
    Band,
    Complex64Array,
    CortexTransform,
    Partition,
    bands,
)
from enfilade.metric.eye import Pursuit, retinal_velocity
from enfilade.metric.inputs import check_luminance, check_map, check_valid
from enfilade.metric.masking import MASK_SLOPE
from enfilade.metric.noise import NOISE_SIGMAS, ChannelNoise, NoiseFilters, response_noise
from enfilade.metric.observer import Observer
from enfilade.metric.options import MetricOptions
from enfilade.metric.pyramid import halved_shape
from enfilade.metric.sensitivity import ChannelSensitivity, SensitivityTable
from enfilade.viewing import Viewing

__all__ = ["Aqm"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Pair:
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
    options : MetricOptions, optional
        Departures from the paper; by default there are none.
    pursuit : Pursuit
        What the eye does while the image moves; `compare` may override it.
    mask_slope : float
        Slope of visual masking by threshold elevation, 0 to 1 (`metric.masking`).
    workers : int
        Threads of the FFT, 1 or more.

    Raises
    ------
    InputError
        `mask_slope` or `workers` is out of range.

    Notes
    -----
    What it does not see: colour, and the fall of acuity away from the gaze. A frame is judged
    alone, unless `change` says what flickers (`SequenceAqm`). In the paper's mode contrasts are
    over the mean of the whole image, so errors in dark corners of a bright image count less than
    they look. Images of any size from 1x1 up are continued by mirroring; the number of radial
    levels depends on the pixels per degree only.

    Cost: see `benchmarks/metric.py`.
    """

    def __init__(
        self,
        viewing: Viewing,
        *,
        options: MetricOptions | None = None,
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
        self.options = MetricOptions.paper() if options is None else options
        self.pursuit = pursuit
        self.mask_slope = mask_slope
        self._shape = (viewing.height_px, viewing.width_px)
        self._observer = Observer(viewing, self.options, mask_slope)
        density = viewing.pixels_per_degree
        base = bands(density)[-1]
        self._border = MirrorBorder(
            *self._shape,
            margin_px=2 ** (base.level - 1),  # one period of the lowest ring's centre
            multiple_px=2 * base.reduction,
        )
        self.cortex = CortexTransform(
            *self._border.padded_shape,
            density,
            partition=Partition.POWER,
            tilt=self._observer.tilt if self.options.csf_within_bands else None,
            workers=workers,
        )
        self._table = SensitivityTable(
            self._observer.csf, self.cortex.bands, density, by_luminance=self._observer.knows_luminance
        )
        self._rule = PoolingRule(
            self._observer.channel_exponent,
            self._observer.spatial_exponent if self.options.spatial_pooling else None,
            density,
        )
        self._noise_filters: NoiseFilters | None = None

    def compare(
        self,
        test: Float32Array,
        reference: Float32Array,
        *,
        velocity: Float32Array | None = None,
        valid: BoolArray | None = None,
        noise_variance: Float32Array | None = None,
        change: Float32Array | None = None,
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
        change : (H, W) float32, optional
            How much test - reference has changed since the last frame, at the same point of the
            same surface, cd/m2 (`metric.transient`); 0 where not valid. None: it has not.
        pursuit : Pursuit, optional
            Instead of the one given to the constructor.

        Returns
        -------
        Comparison
            Maps and figures; exactly zero when the images are equal and so is the change.

        Raises
        ------
        InputError
            An array has the wrong type or shape, or judged pixels that are NaN, infinite or
            negative; the message names the array and the first such pixel.
        """
        self.check(test, reference, velocity=velocity, valid=valid)
        if noise_variance is not None:
            check_map("noise_variance", noise_variance, self._shape, valid, is_signed=False)
        if change is not None:
            check_map("change", change, self._shape, None, is_signed=True)
        is_judged = np.ones(self._shape, dtype=np.bool_) if valid is None else valid
        test, reference = fill_undefined(test, reference, valid)
        pair = self._pair(test, reference, is_judged, noise_variance, change)
        velocities = self._retinal_velocities(velocity, is_judged, pursuit or self.pursuit)
        pool = Pool(self.cortex.bands, is_judged, self._rule)
        rings = [self.cortex.ring(pair.spectra[:2], band) for band in self.cortex.bands]
        for orientation in (*range(len(ORIENTATIONS_DEG)), None):
            sensitivity = ChannelSensitivity(self._table, velocities, orientation, pair.light)
            for band, ring in zip(self.cortex.bands, rings, strict=True):
                if orientation in self.cortex.orientations(band):
                    pool.add(band, self._channel_power(pair, ring, band, orientation, sensitivity))
        if change is not None:
            for band in self.cortex.bands:
                pool.add(band, self._flicker_power(pair, band), is_transient=True)
        return pool.comparison()

    def check(
        self,
        test: Float32Array,
        reference: Float32Array,
        *,
        velocity: Float32Array | None = None,
        valid: BoolArray | None = None,
    ) -> None:
        """Refuse what `compare` would.

        Raises
        ------
        InputError
            As `compare`.
        """
        if valid is not None:
            check_valid(valid, self._shape)
        check_luminance("test", test, self._shape, valid)
        check_luminance("reference", reference, self._shape, valid)
        if velocity is not None:
            check_map("velocity", velocity, (*self._shape, 2), valid, is_signed=True)

    def _pair(
        self,
        test: Float32Array,
        reference: Float32Array,
        is_judged: BoolArray,
        noise_variance: Float32Array | None,
        change: Float32Array | None,
    ) -> _Pair:
        mean_cd_m2 = max(_mean(reference, is_judged), DARKEST_CD_M2)
        is_local = self.options.luminance_adaptive
        respond = _as_it_is if is_local else response
        response_test, response_reference = respond(test), respond(reference)
        mean = np.float32(_mean(response_reference, is_judged))
        # The difference is transformed rather than the test, so that equal images give zero.
        planes = [response_reference - mean, response_test - response_reference]
        planes += [] if change is None else [change]
        images = np.empty((len(planes), *self._border.padded_shape), dtype=np.float32)
        for image, plane in zip(images, planes, strict=True):
            image[...] = self._border.pad(plane)
        if is_local:
            light = AdaptingLight(adapting_luminance(reference, self.viewing.pixels_per_degree))
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
        return _Pair(self.cortex.spectra(images), light, contrast, noise, is_judged)

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
        if not self.options.luminance_adaptive:
            variance = response_noise(np.float32(0.5) * (test + reference), variance)
        return ChannelNoise(self._noise_filters, self._border.pad(variance))

    def _channel_power(
        self,
        pair: _Pair,
        ring: Complex64Array,
        band: Band,
        orientation: int | None,
        sensitivity: ChannelSensitivity,
    ) -> Float32Array:
        """What one channel adds to the pool, a map at the band's reduced size."""
        shape = halved_shape(self._shape, band.reduction)
        channel = self.cortex.fan(ring, band, orientation)
        reference, difference = self._border.crop(channel, band.reduction, shape)
        masker = self._observer.masker(reference, difference)
        uniform = pair.uniform_part(difference, band.reduction) if band.is_base else 0.0
        difference -= np.float32(uniform)
        if pair.noise is not None:
            deviation = pair.noise.deviation(band, orientation)
            explained = np.float32(NOISE_SIGMAS) * self._border.crop(deviation, band.reduction, shape)
            difference -= np.clip(difference, -explained, explained)
        # To units of the channel's threshold.
        contrast = pair.contrast.at(band.reduction)
        weight = sensitivity.map(band) * contrast
        masker *= weight
        difference *= weight
        if uniform:
            still = sensitivity.still(band) * contrast * np.float32(abs(uniform))
            difference += np.copysign(still, difference)
        return self._observer.power(masker, difference)

    def _flicker_power(self, pair: _Pair, band: Band) -> Float32Array:
        """What the change of the error adds in one band, all orientations together."""
        shape = halved_shape(self._shape, band.reduction)
        ring = self.cortex.ring(pair.spectra[2:], band)
        (change,) = self._border.crop(self.cortex.fan(ring, band, None), band.reduction, shape)
        weight = self._observer.flicker_weight(band, pair.light)
        return self._observer.power(np.zeros_like(change), change * weight)


def _mean(image: Float32Array, is_judged: BoolArray) -> float:
    weight = max(int(np.count_nonzero(is_judged)), 1)
    return float(image.sum(dtype=np.float64, where=is_judged)) / weight


def _as_it_is(luminance_cd_m2: Float32Array) -> Float32Array:
    return luminance_cd_m2
