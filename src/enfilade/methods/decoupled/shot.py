"""The context of the tasks of a shot: irradiance caches near a frame, weights of images, and estimates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from enfilade.arrays import opaque
from enfilade.cache import LruCache
from enfilade.camera.path import CameraPath, Segment
from enfilade.camera.pinhole import Camera
from enfilade.kernels.estimate import Confined, Estimate, Radiance
from enfilade.kernels.guiding import PathGuide
from enfilade.methods.analysis import keyframes_of
from enfilade.methods.base import Inputs, Task
from enfilade.methods.decoupled.guiding import Regions
from enfilade.methods.decoupled.hash_grid import HashGrid
from enfilade.methods.decoupled.hash_grid_entries import Entries
from enfilade.methods.decoupled.image_store import DISOCCLUSION_IMAGES, PREPASS_IMAGES, ImageStore, nearest
from enfilade.methods.decoupled.integrator import Integrator
from enfilade.methods.decoupled.irradiance_cache import IrradianceCache, is_covered, reproject_to
from enfilade.methods.decoupled.light_camera import virtual_camera
from enfilade.methods.decoupled.path_depth import KEYFRAMES, DepthWeights
from enfilade.methods.decoupled.path_kernels import ENTRY_PX
from enfilade.methods.decoupled.paths import Path, spawn
from enfilade.methods.decoupled.reconstruction import ReconstructedEstimate
from enfilade.methods.decoupled.surface_image import UploadedImage, blank_image
from enfilade.methods.decoupled.virtual_images import VirtualImages
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import F32, Mask
from enfilade.renderer import UNLIMITED, LobeRenderer, PixelFilter, RandomKey, Rays
from enfilade.settings import DecoupledSettings, LimitSettings, ViewingSettings

HASH_GRID_KEYFRAMES = 8  # nearest ones whose entries are looked up
FADE = 0.25  # of the distance of the next keyframe, over which entries fade
FADE_STEPS = 4  # of their weight: each uploads the hash grid again
STORED_UNIT = 16.0  # exposed radiance that shaded frames store as 1
MIN_WEIGHT = 1e-3  # of an image, which then counts only where no other shows the surface
# Bilinear weight of the pixels above which prepass images show a point: less would continue surfaces behind
# what hides them. Narrow surfaces are shown near the centres of pixels alone. (ATRIUM: 0.02, 0.5, 0.9, 0.97.)
PREPASS_COVERAGE = 0.9


class ShotContext:
    """The context of the tasks of a shot: its keyframes, and their irradiance.

    Parameters
    ----------
    number
        Of the shot.
    segments
        Between its keyframes.
    inputs
        Results of earlier passes.
    walk
    integrator, virtual_images
        Shared by all shots, as are their kernels.
    """

    def __init__(
        self,
        number: int,
        segments: list[Segment],
        inputs: Inputs,
        walk: Walkthrough,
        integrator: Integrator,
        virtual_images: VirtualImages,
    ) -> None:
        self.number = number
        self.segments = segments
        self.keyframes = keyframes_of(segments)
        self.inputs = inputs
        self.walk = walk
        self.integrator = integrator
        self.virtual_images = virtual_images
        self.settings = walk.settings[DecoupledSettings]
        self.images = ImageStore(segments, inputs, walk)
        self._entries: LruCache[tuple[str, int], Entries] = LruCache(2 * HASH_GRID_KEYFRAMES)
        self._hash_grid: tuple[dict[int, float], HashGrid | None] = ({}, None)
        self._path_guides: LruCache[int, PathGuide | None] = LruCache(2)
        self._blank: list[UploadedImage] = []

    def is_of(self, task: Task, inputs: Inputs, walk: Walkthrough) -> bool:
        """Whether its caches are valid for a task."""
        return self.number == task.shot and self.inputs is inputs and self.walk is walk

    @cached_property
    def renderer(self) -> LobeRenderer:
        """The renderer."""
        assert isinstance(self.walk.renderer, LobeRenderer)  # noqa: S101  (`Decoupled.needs_lobes`)
        return self.walk.renderer

    @property
    def frames(self) -> int:
        """Number of distinct frames."""
        return self._distance(self.keyframes[0], self.keyframes[-1]) + 1

    @property
    def unit(self) -> float:
        """Radiance that is 1 after exposure."""
        return float(2.0 ** -self.walk.settings[ViewingSettings].exposure_ev)

    @property
    def stored_unit(self) -> float:
        """Radiance that shaded frames store as 1: half floats then end at a million times white.

        A power of two, so that values are exact multiples.
        """
        return float(2.0 ** round(math.log2(STORED_UNIT * self.unit)))

    @property
    def white(self) -> float:
        """Radiance that the tone curve shows as white."""
        return self.unit * self.walk.settings[ViewingSettings].white

    def estimate(
        self,
        camera: Camera,
        where: Mask,
        radiance: Radiance,
        random: RandomKey,
        *,
        pixel_filter: PixelFilter = PixelFilter.CENTRE,
        layers: int = 2,
        confined: Confined | None = None,
    ) -> Estimate:
        """An estimate of pixels, without paths yet.

        Parameters
        ----------
        camera
        where : (H, W) bool
            Pixels.
        confined
            Of all pixels, as of :class:`Estimate`, with arrays of shape (H, W) and (H, W, 2).
        radiance, random, pixel_filter, layers
            As of :class:`Estimate`.
        """
        return Estimate(
            camera,
            np.flatnonzero(where).astype(np.uint32),
            radiance,
            paths_in_flight=self.walk.settings[LimitSettings].paths_in_flight,
            pixel_filter=pixel_filter,
            random=random,
            layers=layers,
            confined=None if confined is None else confined.of(where),
        )

    def reconstructed_estimate(
        self,
        camera: Camera,
        where: Mask,
        radiance: Radiance,
        random: RandomKey,
        *,
        layers: int,
        auxiliary: int = 0,
        reconstructed: int | None = None,
        background: Sequence[F32] | None = None,
    ) -> ReconstructedEstimate:
        """The same of pixels that are reconstructed; arguments as of :class:`ReconstructedEstimate`."""
        return ReconstructedEstimate(
            camera,
            np.flatnonzero(where).astype(np.uint32),
            radiance,
            paths_in_flight=self.walk.settings[LimitSettings].paths_in_flight,
            random=random,
            layers=layers,
            auxiliary=auxiliary,
            reconstructed=reconstructed,
            background=background,
        )

    def spawn(self, frame: int, rays: Rays, sampler: Any) -> Path:
        """Camera paths of a frame, which grow by the width of the hash grid's entries."""
        pixel_angle = virtual_camera(self.walk.path.cameras[frame]).pixel_angle
        return spawn(rays, sampler, ENTRY_PX * pixel_angle)

    def prepass_cache(self, frame: int) -> IrradianceCache:
        """The accumulated prepass images near a frame; a fixed number, so that one kernel serves all."""
        near = nearest(self.walk.path, self.keyframes, frame, PREPASS_IMAGES)
        images = [self.images.accumulated_prepass(keyframe) for keyframe in near]
        filled_up, weights = self._filled_up(images, [1.0] * len(images), PREPASS_IMAGES)
        return IrradianceCache(
            view=images[0],
            images=filled_up,
            weights=weights,
            path_guide=self._path_guide(near[0]),
            min_coverage=opaque(PREPASS_COVERAGE),
            depth_weights=self._prepass_weights,
        )

    def final_gather_cache(self, frame: int) -> IrradianceCache:
        """Prepass images and hash grid near a frame, for final gathering."""
        return replace(self.prepass_cache(frame), hash_grid=self.hash_grid(frame))

    def hash_grid(self, frame: int) -> HashGrid | None:
        """The hash grid near a frame."""
        weights = hash_grid_weights(self.walk.path, self.keyframes, frame)
        if self._hash_grid[0] != weights:
            self._hash_grid = weights, self._joined_entries(weights, ("hash_grid", "virtual_images")).upload()
        return self._hash_grid[1]

    def incomplete_hash_grid(self, frame: int, more: Entries) -> HashGrid | None:
        """The hash grid before virtual images are gathered, with some more entries."""
        weights = hash_grid_weights(self.walk.path, self.keyframes, frame)
        return Entries.joined([self._joined_entries(weights, ("hash_grid",)), more]).upload()

    def _joined_entries(self, weights: Mapping[int, float], passes: Sequence[str]) -> Entries:
        """Entries of keyframes from some passes, weighted."""
        return Entries.joined(
            [
                self._entries.get((name, k), partial(self.inputs.record, name, k)).weighted(weight)
                for k, weight in weights.items()
                for name in passes
            ]
        )

    def shading_cache(self, frame: int) -> IrradianceCache:
        """The irradiance images near a frame, reprojected to its view, and the hash grid.

        The weights change continuously along the path.
        """
        weights = self._keyframe_weights(frame) | self._disocclusion_weights(frame)
        images, own = [self.images.accumulated(f) for f in weights], list(weights.values())
        reprojected = reproject_to(self.walk.view(frame).geometry, images, own)
        count = self.settings.lookup_keyframes + DISOCCLUSION_IMAGES
        filled_up, opaque_weights = self._filled_up(images, own, count)
        return IrradianceCache(
            view=reprojected,
            images=filled_up,
            weights=opaque_weights,
            hash_grid=self.hash_grid(frame),
            soft_only=self.renderer.has_sharp_light(),
            path_guide=self._path_guide(*nearest(self.walk.path, self.keyframes, frame, 1)),
            depth_weights=self._depth_weights,
        )

    @property
    def depth_keyframes(self) -> list[int]:
        """Keyframes from which light by path depth is estimated; none where the scene does not limit it."""
        step = max(len(self.keyframes) // KEYFRAMES, 1)
        return self.keyframes[::step] if self.renderer.max_path_depth() < UNLIMITED else []

    @cached_property
    def _depth_weights(self) -> DepthWeights:
        return DepthWeights.of(
            [self.inputs.metadata("prepass", k)["light_by_depth"] for k in self.depth_keyframes]
        )

    @property
    def _prepass_weights(self) -> DepthWeights:
        """Prepass images are as all other irradiance."""
        return replace(self._depth_weights, images=self._depth_weights.others)

    def _path_guide(self, keyframe: int) -> PathGuide | None:
        def make() -> PathGuide | None:
            regions = Regions.from_json(self.inputs.metadata("prepass", keyframe)["regions"])
            return regions.upload() if regions else None

        return self._path_guides.get(keyframe, make)

    def _filled_up(
        self, images: list[UploadedImage], weights: list[float], count: int
    ) -> tuple[tuple[UploadedImage, ...], tuple[Any, ...]]:
        """Images and weights (Float) with blank ones up to a number, so that one kernel serves all frames."""
        missing = count - len(images)
        while len(self._blank) < missing:
            self._blank.append(blank_image())
        filled_up = *images, *self._blank[:missing]
        return filled_up, tuple(map(opaque, [*weights, *[0.0] * missing]))

    def uncovered(self, frame: int, others: Mapping[int, UploadedImage]) -> Mask:
        """Diffuse pixels of a frame that neither the nearest keyframes nor other images show.

        Of shape (H, W), at the resolution of irradiance images.
        """
        geometry = self.images.irradiance_geometry(frame)
        near = nearest(self.walk.path, self.keyframes, frame, self.settings.lookup_keyframes)
        return geometry.has_diffuse & ~is_covered(
            geometry, [*map(self.images.irradiance, near), *others.values()]
        )

    def _keyframe_weights(self, frame: int) -> dict[int, float]:
        """Weights of the nearest keyframes, which fall to zero where the next one replaces them."""
        count = self.settings.lookup_keyframes
        *near, beyond = nearest(self.walk.path, self.keyframes, frame, count + 1)
        reach = float(self._distance(frame, beyond))
        if len(near) < count:
            near, reach = [*near, beyond], 2.0 * max(reach, 1.0)
        return {f: max(1.0 - self._distance(frame, f) / reach, MIN_WEIGHT) for f in near}

    def _disocclusion_weights(self, frame: int) -> dict[int, float]:
        """Weights of the disocclusion images before and after a frame, which are blended linearly.

        The outermost ones of a segment fall to zero at its ends, where the next segment has its own.
        """
        segment = self._segment(frame)
        pair = either_side(self.images.disocclusions()[segment.first], frame)
        weights = {}
        for one in pair:
            ends = [f for f in (*pair, segment.first, segment.last) if (f - one) * (frame - one) > 0]
            reach = min((self._distance(one, end) for end in ends), default=0)
            weights[one] = max(1.0 - self._distance(frame, one) / reach, MIN_WEIGHT) if reach else 1.0
        return weights

    def _distance(self, one: int, other: int) -> int:
        return abs(self.walk.path.distance(one) - self.walk.path.distance(other))

    def _segment(self, frame: int) -> Segment:
        """The segment of a frame, whose disocclusion images it uses."""
        # The last segment ends where the camera stops: all frames after it repeat its pose.
        return next((s for s in self.segments if frame <= s.last), self.segments[-1])


def hash_grid_weights(path: CameraPath, keyframes: list[int], frame: int) -> dict[int, float]:
    """Weights of the keyframes whose entries of the hash grid are looked up from a frame, in order.

    They fall to zero where the next keyframe replaces them.
    """
    near = nearest(path, keyframes, frame, HASH_GRID_KEYFRAMES + 1)
    distances = {k: abs(path.distance(k) - path.distance(frame)) for k in near}
    reach = distances[near[-1]] if len(near) > HASH_GRID_KEYFRAMES else math.inf
    steps = {
        k: min(round((1.0 - distances[k] / reach) / FADE * FADE_STEPS), FADE_STEPS) for k in sorted(near)
    }
    return {k: step / FADE_STEPS for k, step in steps.items() if step}


def either_side(frames: list[int], frame: int) -> list[int]:
    """The last frame of a list up to a frame, and the first one from it on."""
    before, after = [f for f in frames if f <= frame], [f for f in frames if f >= frame]
    return sorted({*before[-1:], *after[:1]})
