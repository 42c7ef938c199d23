"""Temporal accumulation: specular AOVs along the motion of virtual images, and refined pixels.

Refined pixels show several surfaces, often one a hundred times brighter than another: an average of radiance
would be that of the brightest. They are averaged as they are displayed, where all that is white has the same
value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Float, image, lanes, opaque, to_float, to_half, vector3
from enfilade.cache import LruCache
from enfilade.camera.path import CameraPath
from enfilade.kernels.rays import points_at
from enfilade.kernels.tone import REC709_LUMINANCE, luminance
from enfilade.methods.base import Output
from enfilade.methods.decoupled.edges import dilated
from enfilade.methods.decoupled.records import ShadedFrame, SpecularAov
from enfilade.methods.decoupled.sample_counts import REACH
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.surface_image import MIN_FOUND_WEIGHT, UploadedImage, lookup, upload_layers
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE
from enfilade.records import F32, U32, Frame, Geometry, Mask, Provenance, SurfaceClass

MAX_DIFFERENCE = 3.0  # standard deviations, at which the weight of another frame falls to 1/e
# Times the variance of a value, above which that of another frame lowers its weight: a dark pixel
# beside a window is certain, and values of its edge in other frames are within their own large noise.
MORE_NOISE = 50.0
# Variance that is added to both, where exposed values are 0..1: what is clipped at white has none of its own.
CERTAIN = 1e-5
TINY = 1e-8  # deviation, likewise
# Of the samples' deviation, which overestimates noise: rays are stratified, and the contrast of textures
# counts as noise. The whole of it blurs pictures on a wall; half of it keeps nine tenths of the gain at metal
# edges.
DISPLAYED_NOISE_SHARE = 0.5


class TemporalAccumulation:
    """Accumulates the specular AOVs of frames, and their refined pixels, over time.

    Keeps those of the frames that it spans on the device.
    """

    def __init__(self) -> None:
        self._virtual: LruCache[int, list[Geometry]] = LruCache(1)
        # One frame fewer than a window: its first one is not needed again.
        self._uploaded: LruCache[int, list[UploadedImage]] = LruCache(2 * REACH)
        self._displayed: LruCache[int, UploadedImage] = LruCache(2 * REACH)
        self._last: LruCache[int, Frame] = LruCache(1)

    def deliver(self, shot: ShotContext, frame: int) -> Output:
        """Deliver a frame; the frames of its window are shaded. Repeated poses are copies."""
        static = shot.walk.path.static_frame(frame)
        made = self._last.get(static, lambda: self._accumulated(shot, static))
        if frame != static:
            made = Frame(made.color, np.full_like(made.provenance, Provenance.REUSED))
        return Output({frame: made})

    def _accumulated(self, shot: ShotContext, frame: int) -> Frame:
        """A frame whose specular AOVs are averaged over its window, with weights that fall linearly."""
        path, shaded = shot.walk.path, self._record(shot, frame)
        geometry, color = shot.walk.view(frame).geometry, to_float(shaded.diffuse)
        unit, white = (of / shot.stored_unit for of in (shot.unit, shot.white))
        frames = window(path, path.shots()[shot.number], frame)
        weights = {f: 1.0 - abs(path.distance(f) - path.distance(frame)) / (REACH + 1) for f in frames}
        if np.any(shaded.provenance == Provenance.SPECULAR):
            aovs = {f: self._aovs(shot, f) for f in frames}
            for k, here in enumerate(aovs.pop(frame)):
                neighbours = [(of[k], weights[f]) for f, of in aovs.items() if k < len(of)]
                color = color + accumulate_temporally(geometry, here, neighbours, unit=unit)

        # Average refined pixels; those below zero are filled before.
        color = without_negative(color, geometry.shape_index)
        if shaded.deviation.any():
            displayed = {f: self._displayed_image(shot, f) for f in frames}
            shown, where = displayed.pop(frame), shaded.deviation > 0
            deviation = to_float(shaded.deviation)
            here = redisplayed(shown, color, deviation, where, white=white)
            neighbours = [(other, weights[f]) for f, other in displayed.items()]
            color = accumulate_refined(geometry, color, here, neighbours, white=white, unit=unit / white)

        return Frame(np.float32(shot.stored_unit) * color, shaded.provenance)

    def _displayed_image(self, shot: ShotContext, frame: int) -> UploadedImage:
        """A shaded frame as it is displayed, on the device."""

        def make() -> UploadedImage:
            shaded, virtual = self._record(shot, frame), self._virtual_geometry(shot, frame)
            color = without_negative(shaded.color, shot.walk.view(frame).geometry.shape_index)
            deviation = to_float(shaded.deviation)
            return upload_displayed(virtual, color, deviation, white=shot.white / shot.stored_unit)

        return self._displayed.get(frame, make)

    def _aovs(self, shot: ShotContext, frame: int) -> list[UploadedImage]:
        """Specular AOVs of a shaded frame, on the device."""

        def make() -> list[UploadedImage]:
            shaded = self._record(shot, frame)
            where = dilated(shaded.provenance == Provenance.SPECULAR)
            aovs = zip(self._virtual_geometry(shot, frame), shaded.specular, strict=False)
            return [upload_aov(geometry, aov, where) for geometry, aov in aovs]

        return self._uploaded.get(frame, make)

    @staticmethod
    def _record(shot: ShotContext, frame: int) -> ShadedFrame:
        record: ShadedFrame = shot.inputs.record("shading", frame)
        return record

    def _virtual_geometry(self, shot: ShotContext, frame: int) -> list[Geometry]:
        """G-buffers of a frame with the virtual images of its AOVs."""
        return self._virtual.get(frame, lambda: shot.virtual_images.find(shot.walk.view(frame).geometry))


def without_negative(color: F32, shape_index: U32) -> F32:
    """An image without light below zero, which is noise of specular lobes that are a difference.

    Pixels whose luminance is below zero would be black dots: they take the mean of the pixels of the same
    shape around, if that is above zero.

    Parameters
    ----------
    color : (H, W, 3) float32
    shape_index : (H, W) uint32
    """
    light: F32 = np.maximum(color, np.float32(0))
    row, column = (index[:, None] for index in np.nonzero(luminance(color) < 0.0))
    down, across = (np.delete(step.ravel(), 4) for step in np.mgrid[-1:2, -1:2])
    height, width = shape_index.shape
    beside = np.clip(row + down, 0, height - 1), np.clip(column + across, 0, width - 1)
    is_same = (beside[0] == row + down) & (beside[1] == column + across)
    is_same &= shape_index[beside] == shape_index[row, column]
    total = np.sum(color[beside], axis=1, where=is_same[..., None])
    count = np.maximum(is_same.sum(axis=1, keepdims=True), 1)
    light[row[:, 0], column[:, 0]] = np.maximum(total / count, np.float32(0))
    return light


def window(path: CameraPath, shot: range, frame: int) -> list[int]:
    """Distinct frames of a shot over which the AOVs of a frame are accumulated, itself among them."""
    first, here, last = (path.distance(f) for f in (shot.start, frame, shot.stop - 1))
    return list(path.distinct_frames[max(here - REACH, first) : min(here + REACH, last) + 1])


def upload_aov(geometry: Geometry, aov: SpecularAov, where: Mask) -> UploadedImage:
    """Upload a filtered AOV.

    Parameters
    ----------
    geometry
        G-buffer of the frame with the AOV's virtual images.
    aov
    where : (H, W) bool
        Pixels that were sampled.
    """
    layers = [(lanes(aov.color), lanes(np.square(to_float(aov.deviation))))]
    return upload_layers(geometry, lanes(where), layers, has_normals=False)


def accumulate_temporally(
    geometry: Geometry, here: UploadedImage, others: Sequence[tuple[UploadedImage, float]], *, unit: float
) -> F32:
    """Average an AOV with that of neighbouring frames, reprojected along its own motion.

    Virtual images are reprojected at their apparent positions. Values that differ from the frame's own by
    more than their noise weigh less, so that highlights and rough reflections, which move otherwise, remain.

    Parameters
    ----------
    geometry
        G-buffer of the frame, for its camera and normals.
    here
        The AOV of the frame.
    others
        The same AOV of other frames, with weights relative to the frame's own.
    unit
        Value that is 1 after exposure.

    Returns
    -------
    (H, W, 3) float32
        0 where the frame was not sampled.
    """
    color, variance = Array3f(here.values[0]), here.variances[0]
    certain, tiny = opaque(CERTAIN * unit**2), opaque(TINY * unit)

    # Compute the apparent positions; virtual images face the eye.
    position = points_at(geometry.camera, here.depths)
    is_real = here.shape_indices < IN_VIRTUAL_IMAGE
    normal = dr.select(is_real, lanes(geometry.normal), vector3(geometry.camera.eye) - position)
    total, weight = Array3f(color), dr.ones(Float, dr.width(color))
    own = dr.dot(color, Array3f(*REC709_LUMINANCE))
    dr.eval(position, normal, total, weight, own)
    for other, given in others:
        # Reproject.
        found = lookup(position, normal, here.shape_indices, other)
        scale = dr.rcp(dr.maximum(found.weight, 1e-6))
        value, noise = found.totals[0] * scale, found.variances[0] * scale

        # Weight by the difference, in units of the noise; far noisier values weigh less.
        difference = dr.abs(dr.dot(value, Array3f(*REC709_LUMINANCE)) - own)
        frame_weight = dr.exp(-difference * dr.rcp(MAX_DIFFERENCE * dr.sqrt(noise + variance) + tiny))
        frame_weight *= dr.minimum(MORE_NOISE * (variance + certain) * dr.rcp(noise + certain), 1.0)
        frame_weight = dr.select(found.weight > MIN_FOUND_WEIGHT, opaque(given) * frame_weight, 0.0)

        # Accumulate.
        total += frame_weight * value
        weight += frame_weight
        dr.eval(total, weight)  # so that one kernel serves any number of frames
    return image(total / weight, *geometry.shape_index.shape)


def upload_displayed(
    virtual: Sequence[Geometry], color: F32, deviation: F32, *, white: float
) -> UploadedImage:
    """Upload a frame as it is displayed, at the virtual images that its mirrors and panes show.

    Parameters
    ----------
    virtual
        G-buffers of the frame with the virtual images of reflection, and of transmission.
    color : (H, W, 3) float32
        Linear radiance, in the unit of shaded frames.
    deviation : (H, W) float32
        Standard deviation of the luminance.
    white
        What the tone curve shows as white, in that unit.
    """
    reflected, transmitted = virtual
    is_pane = reflected.surface == SurfaceClass.TRANSPARENT
    shown = replace(
        reflected,
        depth=np.where(is_pane, transmitted.depth, reflected.depth),
        shape_index=np.where(is_pane, transmitted.shape_index, reflected.shape_index),
    )
    displayed = _displayed(color, deviation, white)
    return upload_aov(shown, displayed, np.ones(deviation.shape, np.bool_))


def redisplayed(
    whole: UploadedImage, color: F32, deviation: F32, where: Mask, *, white: float
) -> UploadedImage:
    """An image of :func:`upload_displayed` with other colours, in some pixels only, (H, W)."""
    shown = _displayed(color, deviation, white)
    depths = dr.select(lanes(where), whole.depths, 0.0)
    value, variance = lanes(shown.color), lanes(np.square(to_float(shown.deviation)))
    dr.eval(depths, value, variance)
    return replace(whole, depths=depths, values=(value,), variances=(variance,))


def _displayed(color: F32, deviation: F32, white: float) -> SpecularAov:
    """Colours after exposure, 0..1, and their deviation.

    Above white there is no noise: bright pixels beside a dark line are not averaged with it.
    """
    scale = np.float32(1.0 / white)
    mean, error = luminance(color) * scale, deviation * scale
    low, high = (np.clip(value, 0.0, 1.0) for value in (mean - error, mean + error))
    noise = np.float32(0.5 * DISPLAYED_NOISE_SHARE) * (high - low)
    return SpecularAov(to_half(np.clip(color * scale, 0.0, 1.0)), to_half(noise))


def accumulate_refined(
    geometry: Geometry,
    color: F32,
    here: UploadedImage,
    others: Sequence[tuple[UploadedImage, float]],
    *,
    white: float,
    unit: float = 1.0,
) -> F32:
    """Average the refined pixels of a frame with neighbouring frames.

    Radiance above white stays: the sum of the frames' light is kept.

    Parameters
    ----------
    geometry
        G-buffer of the frame.
    color : (H, W, 3) float32
        Linear radiance of the frame, in the unit of shaded frames.
    here, others
        Of :func:`upload_displayed`: the refined pixels of the frame, and whole frames with weights relative
        to its own.
    white
        What the tone curve shows as white, in that unit.
    unit
        Share of it that is 1 after exposure.

    Returns
    -------
    (H, W, 3) float32
        Linear radiance; pixels that are not refined stay.
    """
    shown = image(here.values[0], *color.shape[:2])
    change: F32 = accumulate_temporally(geometry, here, others, unit=unit) - shown
    return color + change * np.float32(white)
