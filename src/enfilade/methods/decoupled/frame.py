"""Frames: camera rays, specular rays, and the temporal accumulation of specular AOVs."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from enfilade.arrays import to_float, to_half
from enfilade.cache import LruCache
from enfilade.camera.path import CameraPath
from enfilade.kernels.estimate import Estimate
from enfilade.kernels.reconstruction import ReconstructedEstimate
from enfilade.kernels.tone import luminance
from enfilade.methods.base import Output
from enfilade.methods.decoupled.adaptive_sampling import AdaptiveSampling
from enfilade.methods.decoupled.edge_accumulation import accumulate_refined, redisplayed, upload_displayed
from enfilade.methods.decoupled.edges import dilated, is_outline, small_emitter_pixels
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache
from enfilade.methods.decoupled.light_camera import light_camera
from enfilade.methods.decoupled.records import ShadedFrame
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.methods.decoupled.specular import (
    accumulate_temporally,
    upload_aov,
)
from enfilade.methods.decoupled.specular_rays import shade_specular
from enfilade.methods.decoupled.surface_image import UploadedImage
from enfilade.records import U8, Frame, Geometry, Mask, Provenance
from enfilade.renderer import Purpose
from enfilade.settings import LimitSettings, ViewingSettings

REACH = 3  # distinct frames to each side over which specular AOVs are accumulated


class Frames:
    """Shades frames, and accumulates their specular AOVs over time.

    Keeps the AOVs of the frames that the accumulation spans on the device.
    """

    def __init__(self) -> None:
        self._virtual: LruCache[int, list[Geometry]] = LruCache(1)
        # One frame fewer than a window: its first one is not needed again.
        self._uploaded: LruCache[int, list[UploadedImage]] = LruCache(2 * REACH)
        self._displayed: LruCache[int, UploadedImage] = LruCache(2 * REACH)
        self._last: LruCache[int, Frame] = LruCache(1)

    def shade(self, shot: ShotContext, frame: int) -> Output:
        """Shade a frame, without the temporal accumulation."""
        geometry = shot.walk.view(frame).geometry

        # Trace camera rays, then specular rays where they meet specular lobes.
        cache = shot.shading_cache(frame)
        diffuse, refined = _shade_diffuse(shot, frame, cache)
        seen = diffuse.is_marked.reshape(geometry.shape_index.shape)
        where = dilated(seen)
        camera_rays = diffuse.shading.to_image(np.ones_like(where))
        is_marked, paths = diffuse.is_marked, diffuse.paths
        del diffuse  # its sums take 200 bytes a pixel
        color = camera_rays.color
        virtual = self._virtual_geometry(shot, frame) if where.any() else []
        specular = shade_specular(shot, frame, cache, seen, virtual, luminance(color))

        # Store the AOVs with the deviation of refined pixels, and count the rays.
        variance = camera_rays.variance + specular.variance
        variance = np.where(refined | specular.is_refined, variance, np.float32(0))
        is_keyframe = frame in shot.keyframes
        provenance = _provenance(geometry, cache, is_marked, is_keyframe=is_keyframe)
        reflection, *others = specular.aovs
        transmission = others[0] if others else None
        shaded = ShadedFrame(to_half(color), reflection, transmission, to_half(np.sqrt(variance)), provenance)
        rays = {"camera": paths, "specular": specular.paths}
        dropped = camera_rays.dropped + specular.dropped
        return Output({frame: shaded}, {"rays": rays, "dropped": dropped})

    def finish(self, shot: ShotContext, frame: int) -> Output:
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
        frames = window(path, path.shots()[shot.number], frame)
        weights = {f: 1.0 - abs(path.distance(f) - path.distance(frame)) / (REACH + 1) for f in frames}
        if np.any(shaded.provenance == Provenance.SPECULAR):
            aovs = {f: self._aovs(shot, f) for f in frames}
            for k, here in enumerate(aovs.pop(frame)):
                neighbours = [(of[k], weights[f]) for f, of in aovs.items() if k < len(of)]
                color = color + accumulate_temporally(geometry, here, neighbours)

        # Average refined pixels.
        if shaded.deviation.any():
            displayed = {f: self._displayed_image(shot, f) for f in frames}
            shown, where = displayed.pop(frame), shaded.deviation > 0
            deviation = to_float(shaded.deviation)
            here = redisplayed(shown, color, deviation, where, exposure_ev=_exposure_ev(shot))
            neighbours = [(image, weights[f]) for f, image in displayed.items()]
            color = accumulate_refined(geometry, color, here, neighbours, exposure_ev=_exposure_ev(shot))

        # Specular lobes that are a difference have negative samples: clip the sum.
        return Frame(np.maximum(color, 0.0), shaded.provenance)

    def _displayed_image(self, shot: ShotContext, frame: int) -> UploadedImage:
        """A shaded frame as it is displayed, on the device."""

        def make() -> UploadedImage:
            shaded, virtual = self._record(shot, frame), self._virtual_geometry(shot, frame)
            deviation = to_float(shaded.deviation)
            return upload_displayed(virtual, shaded.color, deviation, exposure_ev=_exposure_ev(shot))

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


def _exposure_ev(shot: ShotContext) -> float:
    return shot.walk.settings[ViewingSettings].exposure_ev


def _shade_diffuse(shot: ShotContext, frame: int, cache: IrradianceCache) -> tuple[Estimate, Mask]:
    """Emission, diffuse reflection and highlights of sharp emitters; where it has more rays, (H, W)."""
    walk, settings = shot.walk, shot.settings
    camera = walk.path.cameras[frame]
    estimate = ReconstructedEstimate(
        camera,
        np.arange(camera.width * camera.height, dtype=np.uint32),
        lambda rays, sampler: shot.integrator.diffuse_radiance(
            cache, rays, sampler, pixel_angle=light_camera(camera).pixel_angle
        ),
        paths_in_flight=walk.settings[LimitSettings].paths_in_flight,
        random=walk.random(frame, Purpose.DIFFUSE),
    )
    estimate.add(settings.min_spp)

    # Add rays at edges.
    geometry, sampling = walk.view(frame).geometry, AdaptiveSampling.of(walk)
    everywhere = np.ones(geometry.shape_index.shape, np.bool_)
    emitters = small_emitter_pixels(shot.renderer.emitters, geometry)
    edges = is_outline(geometry) | dilated(sampling.uncertain(estimate, everywhere) | emitters)
    return estimate, sampling.refine(estimate, everywhere, edges, everywhere, settings.min_spp)


def _provenance(
    geometry: Geometry, cache: IrradianceCache, is_specular: npt.NDArray[np.bool_], *, is_keyframe: bool
) -> U8:
    """Provenance of the pixels of a shaded frame, (H, W)."""
    assert cache.view is not None  # noqa: S101  (`ShotContext.shading_cache`)
    is_known = np.array(cache.view.shape_indices) > 0
    base = Provenance.KEYFRAME if is_keyframe else Provenance.REUSED
    provenance = np.full(is_specular.shape, base, np.uint8)
    provenance[geometry.has_diffuse.ravel() & ~is_known] = Provenance.DISOCCLUDED
    provenance[is_specular] = Provenance.SPECULAR
    return provenance.reshape(geometry.shape_index.shape)


def window(path: CameraPath, shot: range, frame: int) -> list[int]:
    """Distinct frames of a shot over which the AOVs of a frame are accumulated, itself among them."""
    first, here, last = (path.distance(f) for f in (shot.start, frame, shot.stop - 1))
    return list(path.distinct_frames[max(here - REACH, first) : min(here + REACH, last) + 1])
