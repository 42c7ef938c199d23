"""References of the windows of a bench: two independent halves, kept in a folder that benches share.

A reference is traced at :data:`SUBPIXELS` x :data:`SUBPIXELS` subpixels of a pixel. The mean over a pixel's
subpixels is the box filter's value; a weighted sum over those within the Gaussian filter's radius is the
Gaussian filter's. So the same paths serve both filters. The Gaussian's weights are constant over a subpixel,
which changes the response to an edge by 0.7 % of its contrast at most.

Measures of visible differences compare with denoised references. Their subpixels are denoised before they are
filtered: neighbouring pixels of the Gaussian filter share subpixels, and their noise, which is correlated,
would pass the denoiser.

::

    STORE/SCENE-DIGEST/             scene, renderer and depth of paths
        CAMERA-DIGEST.npz           one frame: windows, means of both halves, motion; `spp` grows
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from enfilade.arrays import image, lanes, to_float, to_half
from enfilade.camera.pinhole import CENTRE, Camera
from enfilade.errors import InputError
from enfilade.files import write_json
from enfilade.kernels.estimate import GAUSSIAN_RADIUS_PX, GAUSSIAN_SIGMA_PX
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.methods.denoise import denoise, denoiser_name
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, Flow
from enfilade.renderer import Branch, PixelFilter, Purpose, RandomKey
from enfilade.runs.job import Job
from enfilade.settings import SampleFilter, TraceSettings
from studies.bench.guides import Guides
from studies.bench.windows import Window

SUBPIXELS = 4  # along each axis
BATCH = 256  # paths a pixel of a half that are traced together, with random numbers of their own
LARGE_WINDOW_PX, LARGE_BATCH = 128, 64  # windows with a longer side have smaller batches
SEED = 0x9E3779B9  # of the first batch; the next ones follow
REACH = int(GAUSSIAN_RADIUS_PX * SUBPIXELS) - SUBPIXELS // 2  # subpixels of the filter beyond the pixel
FILTERS = (SampleFilter.BOX, SampleFilter.GAUSSIAN)


@dataclass(frozen=True, eq=False)
class ReferenceFrame:
    """The reference of one frame.

    Attributes
    ----------
    spp : int
        Paths a pixel of both halves together.
    halves : mapping of SampleFilter to (2, K, S, S, 3) float32
        Linear radiance of each half in K windows of S x S pixels.
    denoised : mapping of SampleFilter to (3, K, S, S, 3) float32
        The same of both halves and of their mean, denoised.
    flows : list of Flow
        Motion vectors of each window.
    """

    spp: int
    halves: dict[SampleFilter, F32]
    denoised: dict[SampleFilter, F32]
    flows: list[Flow]


class References:
    """The references of a walkthrough's frames in a store.

    Parameters
    ----------
    store
        Folder, shared by any number of benches.
    job
        Scene, path and settings; of these the depth of paths counts.
    windows
        Where to trace.
    seed
        Of the random numbers; configurations have the seed of the job.
    """

    def __init__(self, store: Path, job: Job, windows: Sequence[Window], *, seed: int = SEED) -> None:
        scene = {key: value for key, value in job.scene.identity().items() if key != "variant"}
        depth = job.settings[TraceSettings].max_depth
        self._batch = LARGE_BATCH if max(of.side for of in windows) > LARGE_WINDOW_PX else BATCH
        self._identity: dict[str, Any] = {
            "scene": scene,
            "max_depth": depth,
            "subpixels": SUBPIXELS,
            "batch": self._batch,
            "denoiser": denoiser_name(),
            "guides": "of what mirrors and clear glass show",
        }
        self._identity |= {} if seed == SEED else {"seed": seed}
        self._job, self._windows, self._seed = job, windows, seed
        digest = _digest(self._identity)
        held = sorted(store.glob(f"*-{digest}"))  # of a copy of the scene in another folder
        self.folder = held[0] if held else store / f"{job.scene.file.resolve().parent.name}-{digest}"

    def missing(self, spp: int) -> list[int]:
        """Frames whose references have fewer paths a pixel."""
        return [frame for frame in range(len(self._job.path)) if self.spp(frame) < spp]

    def spp(self, frame: int) -> int:
        """Paths a pixel of a frame, both halves together; 0 where it has no reference."""
        file = self._file(frame)
        if not file.is_file():
            return 0
        with _opened(file) as arrays:
            return int(arrays["spp"])

    def grow(self, spp: int, monitor: Monitor) -> None:
        """Trace until every frame has so many paths a pixel, in both halves together.

        Paths are added to those of earlier calls, in batches of :data:`BATCH` or :data:`LARGE_BATCH` a half.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        write_json(self.folder / "identity.json", self._identity)
        walk = Walkthrough(self._job.path, self._job.settings, self._job.open_renderer())
        missing, both = self.missing(spp), 2 * self._batch
        for done, frame in enumerate(missing):
            monitor.progress("references", done, len(missing))
            fine, before = self._fine(frame)
            batches = range(before // both, math.ceil(spp / both))
            for batch in batches:
                fresh = np.stack([self._traced(walk, frame, 2 * batch + half) for half in (0, 1)])
                fine = to_half(to_float(fine) + (fresh - to_float(fine)) / np.float32(batch + 1))
            if self.spp(frame) < both * batches.stop:  # another bench may have grown it further
                self._write(walk, frame, both * batches.stop, fine)
        monitor.progress("references", len(missing), len(missing))

    def read(self, frame: int) -> ReferenceFrame:
        """The reference of a frame.

        Raises
        ------
        InputError
            It is missing or damaged.
        """
        with _opened(self._file(frame)) as arrays:
            has = bool(arrays["has_backward"]), bool(arrays["has_forward"])
            pairs = zip(arrays["backward"], arrays["forward"], strict=True)
            return ReferenceFrame(
                spp=int(arrays["spp"]),
                halves={kind: arrays[kind.value] for kind in FILTERS},
                denoised={kind: arrays[f"denoised_{kind.value}"] for kind in FILTERS},
                flows=[Flow(backward, forward, *has) for backward, forward in pairs],
            )

    def _file(self, frame: int) -> Path:
        path = self._job.path
        cameras = [path.cameras[frame], *path.neighbours(frame)]
        key = {
            "cameras": [_facts(camera) for camera in cameras],
            "windows": [asdict(w) for w in self._windows],
        }
        return self.folder / f"{_digest(key)}.npz"

    def _fine(self, frame: int) -> tuple[npt.NDArray[np.float16], int]:
        """Means of the subpixels of both halves, (2, K, F, F, 3), and the paths a pixel so far."""
        file = self._file(frame)
        if file.is_file():
            with _opened(file) as arrays:
                return arrays["fine"], int(arrays["spp"])
        side = self._windows[0].side * SUBPIXELS + 2 * REACH
        return np.zeros((2, len(self._windows), side, side, 3), np.float16), 0

    def _subpixels(self, camera: Camera) -> tuple[Camera, npt.NDArray[np.uint32]]:
        """A camera of subpixels, and those of the windows with the filter's reach around, (K, F, F)."""
        fine = replace(camera, width=camera.width * SUBPIXELS, height=camera.height * SUBPIXELS)
        within = np.arange(self._windows[0].side * SUBPIXELS + 2 * REACH) - REACH
        rows = np.array([w.top * SUBPIXELS for w in self._windows])[:, None] + within
        columns = np.array([w.left * SUBPIXELS for w in self._windows])[:, None] + within
        return fine, (rows[:, :, None] * fine.width + columns[:, None, :]).astype(np.uint32)

    def _traced(self, walk: Walkthrough, frame: int, batch: int) -> F32:
        """One batch of the subpixels of a frame's windows, (K, F, F, 3)."""
        camera, pixels = self._subpixels(walk.path.cameras[frame])
        key = RandomKey((self._seed + batch) % 2**32, walk.path.numbers[frame], Purpose.REFERENCE)
        spp = self._batch // SUBPIXELS**2
        traced = walk.renderer.trace(camera, pixels.ravel(), key, spp=spp, pixel_filter=PixelFilter.BOX)
        return traced.color.reshape(*pixels.shape, 3)

    def _denoised(self, walk: Walkthrough, frame: int, fine: F32) -> F32:
        """The subpixels of both halves and of their mean, denoised, (3, K, F, F, 3)."""
        camera, pixels = self._subpixels(walk.path.cameras[frame])
        guides = Guides(walk.renderer, Branch.TRANSMITTED)
        found = np.empty((3, *fine.shape[1:]), np.float32)
        for index, window in enumerate(pixels):
            rays = camera_rays(camera, pixel_centres(camera, lanes(window.ravel())))
            found_guides = guides.along(rays, one_sequence(window.size), is_followed=True)
            albedo, normal = (image(of, *window.shape) for of in found_guides)
            for half, noisy in enumerate((*fine[:, index], fine[:, index].mean(axis=0))):
                found[half, index] = denoise(noisy, albedo, normal)
        return found

    def _write(self, walk: Walkthrough, frame: int, spp: int, fine: npt.NDArray[np.float16]) -> None:
        flow, halves = walk.view(frame).flow, to_float(fine)
        denoised = self._denoised(walk, frame, halves)
        arrays: dict[str, Any] = {
            "spp": np.int64(spp),
            "has_backward": np.bool_(flow.has_backward),
            "has_forward": np.bool_(flow.has_forward),
            "backward": np.stack([w.crop(flow.backward) for w in self._windows]),
            "forward": np.stack([w.crop(flow.forward) for w in self._windows]),
            "fine": fine,
            **{kind.value: self._filtered(kind, halves) for kind in FILTERS},
            **{f"denoised_{kind.value}": self._filtered(kind, denoised) for kind in FILTERS},
        }
        file = self._file(frame)
        beside = file.with_suffix(f".{os.getpid()}.partial")
        with beside.open("wb") as stream:
            np.savez(stream, **arrays)
        beside.replace(file)

    def _filtered(self, kind: SampleFilter, fine: F32) -> F32:
        """Pixels from subpixels, (N, K, S, S, 3)."""
        weights = _weights(kind, self._windows[0].side)
        found = np.einsum("ia,nkabc,jb->nkijc", weights, fine, weights, optimize=True)
        return np.asarray(found, np.float32)


def _weights(kind: SampleFilter, side: int) -> npt.NDArray[np.float64]:
    """Weights (side, side * SUBPIXELS + 2 * REACH) of subpixels along one axis, for each pixel."""
    edges = (np.arange(SUBPIXELS + 2 * REACH + 1) - REACH) / SUBPIXELS - 0.5  # from the pixel's centre
    if kind is SampleFilter.BOX:
        one = np.where((edges[:-1] > -0.5 - 1e-9) & (edges[1:] < 0.5 + 1e-9), 1.0, 0.0)
    else:
        integral = np.array([math.erf(edge / (GAUSSIAN_SIGMA_PX * math.sqrt(2.0))) for edge in edges])
        one = np.diff(integral)
    found = np.zeros((side, side * SUBPIXELS + 2 * REACH))
    for pixel in range(side):
        found[pixel, pixel * SUBPIXELS : pixel * SUBPIXELS + len(one)] = one / one.sum()
    return found


def _facts(camera: Camera | None) -> list[Any] | None:
    if camera is None:
        return None
    shift = [] if camera.principal_point == CENTRE else [camera.principal_point]
    return [camera.world_from_camera.ravel().tolist(), camera.fov_deg, camera.width, camera.height, *shift]


def _digest(key: Any) -> str:
    return hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:16]


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    try:
        with file.open("rb") as stream, np.load(stream) as arrays:
            yield arrays
    except (OSError, ValueError, BadZipFile) as error:
        raise InputError(
            f"the reference {file} is missing or damaged ({error}): delete it, and run again"
        ) from error
