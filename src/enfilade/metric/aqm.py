"""The animation quality metric: from two images to a map of visible differences (§3.4, Fig. 6)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from enfilade.errors import InputError
from enfilade.metric.borders import MirrorBorder, fill_undefined
from enfilade.metric.comparison import Comparison, Pool, PoolingRule
from enfilade.metric.cortex import Band, CortexTransform, Partition, bands
from enfilade.metric.decision import Channel, Decision, Masking, RawChannel
from enfilade.metric.eye import Pursuit, held_smear, retinal_velocity
from enfilade.metric.gathered import BandWeight, FixedWeight, Turning
from enfilade.metric.inputs import check_luminance, check_map, check_valid
from enfilade.metric.masking import MASK_SLOPE
from enfilade.metric.noise import NOISE_SIGMAS, Noise
from enfilade.metric.observer import Observer
from enfilade.metric.options import Fitted, MetricOptions
from enfilade.metric.pair import ImagePair, Retina
from enfilade.metric.pyramid import double, halved_shape
from enfilade.metric.sensitivity import FINEST_REDUCTION, ChannelSensitivity, SensitivityTable
from enfilade.metric.spatial import Aperture
from enfilade.viewing import Viewing

__all__ = ["Aqm"]

BoolArray: TypeAlias = npt.NDArray[np.bool_]
Float32Array: TypeAlias = npt.NDArray[np.float32]


FITTED = Fitted()


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
        Slope of visual masking by threshold elevation, 0 to 1 (`metric.masking`); a transducer has
        none.
    fitted : Fitted
        Numbers of the modern mode that were fitted; others than the default serve to test them.
    workers : int
        Threads of the FFT, 1 or more.
    has_kernels : bool
        Whether the modern mode's per-pixel part runs in Dr.Jit kernels (`metric.kernels`), on the
        device that `device.activate` chose, instead of in NumPy. Images with pixels that are not
        judged take NumPy.

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

    Cost: 0.2 to 0.3 s of CPU time for a pair of 640x480, about 2 s and 400 MiB for 1920x1080 (see
    `benchmarks/metric.py`). Velocity and adapting luminance are taken from every second pixel.
    """

    def __init__(
        self,
        viewing: Viewing,
        *,
        options: MetricOptions | None = None,
        pursuit: Pursuit = Pursuit.BOTH,
        mask_slope: float = MASK_SLOPE,
        fitted: Fitted = FITTED,
        workers: int = 1,
        has_kernels: bool = False,
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
        self._observer = Observer(viewing, self.options, fitted)
        density = viewing.pixels_per_degree
        oversampling = self._observer.oversampling
        base = bands(density, oversampling)[-1]
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
            oversampling=oversampling,
            workers=workers,
        )
        self._table = SensitivityTable(
            self._observer.csf, self.cortex.bands, density, by_luminance=self._observer.knows_luminance
        )
        self._retina = Retina(self._border, self.cortex, density, is_adaptive=self.options.luminance_adaptive)
        self._aperture = (
            Aperture(self._shape, density, fitted.aperture_sigma_deg)
            if self.options.spatial_pooling
            else None
        )
        exponent = self._observer.channel_exponent
        self._rule = PoolingRule(exponent, self._observer.spatial_exponent, self.options.transducer)
        self._has_kernels = has_kernels
        self._masking = Masking(self.options, fitted, mask_slope, exponent)

    def compare(
        self,
        test: Float32Array,
        reference: Float32Array,
        *,
        velocity: Float32Array | None = None,
        valid: BoolArray | None = None,
        noise_variance: Float32Array | None = None,
        noise_blur_px: Float32Array | None = None,
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
        noise_blur_px : (H, W) float32, optional
            Standard deviation of the Gaussian through which both images went after the variance was
            told, pixels. None: none.
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
        if noise_blur_px is not None:
            check_map("noise_blur_px", noise_blur_px, self._shape, None, is_signed=False)
        if change is not None:
            check_map("change", change, self._shape, None, is_signed=True)
        is_judged = np.ones(self._shape, dtype=np.bool_) if valid is None else valid.copy()
        test, reference = fill_undefined(test, reference, valid)
        noise = None if noise_variance is None else Noise(noise_variance, noise_blur_px)
        pair = self._retina.pair(test, reference, is_judged, noise, change)
        movements = (pursuit or self.pursuit).hypotheses
        plane = None if velocity is None else _every_second(velocity, is_judged)
        sensitivity = self._sensitivity(pair, plane, movements)
        turning = self._turning(pair, plane, movements)
        pool = Pool(self.cortex.bands, is_judged, self._rule, self._aperture)
        decision = Decision(pool, self._masking, self._aperture)
        for band in self.cortex.bands:
            weight = None if turning is None or band.is_base else turning.of(band)
            channels = self._raw_channels if self._is_raw(pair, band) else self._channels
            decision.add(band, channels(pair, band, sensitivity, weight), weight)
            if change is not None:
                decision.add(band, *self._flicker(pair, band), is_transient=True)
        decision.close()
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

    def _sensitivity(
        self, pair: ImagePair, plane: Float32Array | None, movements: Sequence[Pursuit]
    ) -> ChannelSensitivity:
        planes = [] if plane is None else [plane] * len(movements)
        velocities = [retinal_velocity(p, eye) for p, eye in zip(planes, movements, strict=False)]
        smears = [held_smear(p, eye, self._hold_s) for p, eye in zip(planes, movements, strict=False)]
        return ChannelSensitivity(self._table, velocities, pair.light, smears if self._hold_s else [])

    def _turning(
        self, pair: ImagePair, plane: Float32Array | None, movements: Sequence[Pursuit]
    ) -> Turning | None:
        """What corrects for directions within channels; None where nothing moves or is gathered."""
        if plane is None or self._aperture is None or not self._masking.weighs_gathered:
            return None
        if not self.options.csf_within_bands:
            return None
        return Turning(self._table, self._aperture, pair.light, plane, movements, self._hold_s)

    @property
    def _hold_s(self) -> float:
        """How long a frame is held; 0 where displays are taken to flash."""
        return self.viewing.persistence / self.viewing.fps if self.options.hold_blur else 0.0

    def _channels(
        self, pair: ImagePair, band: Band, sensitivity: ChannelSensitivity, turned: BandWeight | None
    ) -> Iterator[Channel]:
        """Reference, test and difference of each channel of a band, in units of its threshold."""
        shape = halved_shape(self._shape, band.reduction)
        contrast = pair.contrast.at(sensitivity.reduction(band))
        ring = self.cortex.ring(pair.spectra[:2], band)
        weight: Float32Array | None = None
        for orientation in self.cortex.orientations(band):
            channel = self.cortex.fan(ring, band, orientation)
            reference, difference = self._border.crop(channel, band.reduction, shape)
            uniform = pair.uniform_part(difference, band.reduction) if band.is_base else None
            test = None if self.options.transducer else reference + difference
            if uniform is not None:
                difference -= uniform
            if pair.noise is not None:
                deviation = pair.noise.deviation(band, orientation)
                explained = np.float32(NOISE_SIGMAS) * self._border.crop(deviation, band.reduction, shape)
                difference -= np.clip(difference, -explained, explained)
            if turned is not None:
                turned.look(difference)
            if weight is None or not sensitivity.is_still:
                weight = _at_size(sensitivity.map(band, orientation) * contrast, band, shape)
            if test is not None:
                test *= weight
            reference *= weight
            difference *= weight
            if uniform is not None:
                difference += uniform * _at_size(sensitivity.still(band) * contrast, band, shape)
            yield reference, test, difference

    def _is_raw(self, pair: ImagePair, band: Band) -> bool:
        """Whether a band's channels go to the kernel as they are."""
        return (
            self._has_kernels
            and self._masking.weighs_gathered
            and not band.is_base
            and bool(pair.is_judged.all())
        )

    def _raw_channels(
        self, pair: ImagePair, band: Band, sensitivity: ChannelSensitivity, turned: BandWeight | None
    ) -> Iterator[RawChannel]:
        """What `_channels` gives, with the weights beside the responses."""
        shape = halved_shape(self._shape, band.reduction)
        contrast = pair.contrast.at(sensitivity.reduction(band))
        ring = self.cortex.ring(pair.spectra[:2], band)
        for orientation in self.cortex.orientations(band):
            channel = self.cortex.fan(ring, band, orientation)
            _, difference = self._border.crop(channel, band.reduction, shape)
            if pair.noise is not None:
                deviation = pair.noise.deviation(band, orientation)
                explained = np.float32(NOISE_SIGMAS) * self._border.crop(deviation, band.reduction, shape)
                difference -= np.clip(difference, -explained, explained)
            if turned is not None:
                turned.look(difference)
            yield RawChannel(
                channel[0],
                channel[1],
                weight=np.asarray(sensitivity.map(band, orientation) * contrast),
                weight_step=sensitivity.reduction(band) // band.reduction,
                start=self._border.margin_px // band.reduction,
                shape=shape,
            )

    def _flicker(self, pair: ImagePair, band: Band) -> tuple[list[Channel], BandWeight | None]:
        """The change of the error in a band, all orientations together; nothing masks it."""
        shape = halved_shape(self._shape, band.reduction)
        ring = self.cortex.ring(pair.spectra[2:], band)
        (change,) = self._border.crop(self.cortex.fan(ring, band, None), band.reduction, shape)
        if self._aperture is not None and self._masking.weighs_gathered:
            light = pair.light.at(self._aperture.reduction)
            fixed = FixedWeight(self._observer.flicker_weight(band, light))
            return [(np.zeros_like(change), None, change)], fixed
        light = pair.light.at(ChannelSensitivity.reduction(band))
        change *= _at_size(self._observer.flicker_weight(band, light), band, shape)
        return [(np.zeros_like(change), None, change)], None


def _every_second(velocity: Float32Array, is_judged: BoolArray) -> Float32Array:
    """Velocity at every second pixel, as `ChannelSensitivity` asks, (2, h, w); 0 where not judged."""
    rows, columns = (
        np.minimum(FINEST_REDUCTION * np.arange(samples), pixels - 1)
        for samples, pixels in zip(
            halved_shape(is_judged.shape, FINEST_REDUCTION), is_judged.shape, strict=True
        )
    )
    here = np.ix_(rows, columns)
    return np.where(is_judged[here], np.moveaxis(velocity[here], -1, 0), np.float32(0.0))


def _at_size(weight: Float32Array, band: Band, shape: tuple[int, int]) -> Float32Array:
    """Weights of a band at its own size; in the finest bands they come at half of it."""
    is_halved = weight.ndim and ChannelSensitivity.reduction(band) > band.reduction
    return double(weight, shape) if is_halved else weight
