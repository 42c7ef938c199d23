"""References of the windows of a bench: two independent halves, kept in a folder that benches share.

A reference is traced at :data:`SUBPIXELS` x :data:`SUBPIXELS` subpixels of a pixel. The mean over a pixel's
subpixels is the box filter's value; a weighted sum over those within the Gaussian filter's radius is the
Gaussian filter's. So the same paths serve both filters. A Gaussian pixel shares subpixels with its
neighbours, and would have the noise of 3.1 times as many paths, which is smoother and so easier to see. With
three quarters of the paths ColorVideoVDP gives the noise of both filters the same score: on grey with
simulated noise 6.6 and 6.7 JOD, 2.5 and 2.5 where it is stronger; with as many paths as make the variances
equal, 5 of 16, the Gaussian's would have 5.1 and 0.9. The Gaussian's weights are constant over a subpixel,
which changes the response to an edge by 0.7 % of its contrast at most.

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

from enfilade.camera.pinhole import Camera
from enfilade.errors import InputError
from enfilade.files import write_json
from enfilade.kernels.estimate import GAUSSIAN_RADIUS_PX, GAUSSIAN_SIGMA_PX
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Monitor
from enfilade.records import F32, Flow
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.runs.job import Job
from enfilade.settings import SampleFilter, TraceSettings
from studies.bench.windows import Window

SUBPIXELS = 4  # along each axis
BATCH = 256  # paths a pixel of a half that are traced together, with random numbers of their own
SHARED_SPP = 12  # paths a subpixel in a batch, of 16, that the Gaussian filter uses
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
    flows : list of Flow
        Motion vectors of each window.
    """

    spp: int
    halves: dict[SampleFilter, F32]
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
        self._identity: dict[str, Any] = {
            "scene": scene,
            "max_depth": depth,
            "subpixels": SUBPIXELS,
            "batch": BATCH,
            "shared_spp": SHARED_SPP,
        }
        self._identity |= {} if seed == SEED else {"seed": seed}
        self._job, self._windows, self._seed = job, windows, seed
        self.folder = store / f"{job.scene.file.resolve().parent.name}-{_digest(self._identity)}"

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

        Paths are added to those of earlier calls, in batches of :data:`BATCH` a half.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        write_json(self.folder / "identity.json", self._identity)
        walk = Walkthrough(self._job.path, self._job.settings, self._job.open_renderer())
        missing = self.missing(spp)
        for done, frame in enumerate(missing):
            monitor.progress("references", done, len(missing))
            before = self.read(frame) if self._file(frame).is_file() else None
            batches = range((before.spp if before else 0) // (2 * BATCH), math.ceil(spp / (2 * BATCH)))
            halves = {kind: 0.0 if before is None else before.halves[kind] for kind in FILTERS}
            for batch in batches:
                fresh = [self._traced(walk, frame, 2 * batch + half) for half in (0, 1)]
                for kind in FILTERS:
                    more = np.stack([images[kind] for images in fresh])
                    mean = halves[kind] + (more - halves[kind]) / np.float32(batch + 1)
                    halves[kind] = mean.astype(np.float32)
            if self.spp(frame) < 2 * BATCH * batches.stop:  # another bench may have grown it further
                self._write(walk, frame, 2 * BATCH * batches.stop, halves)
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

    def _traced(self, walk: Walkthrough, frame: int, batch: int) -> dict[SampleFilter, F32]:
        """One batch of a frame's windows by both filters, (K, S, S, 3)."""
        camera = walk.path.cameras[frame]
        fine = replace(camera, width=camera.width * SUBPIXELS, height=camera.height * SUBPIXELS)
        side = self._windows[0].side * SUBPIXELS + 2 * REACH
        within = np.arange(side)
        pixels = np.concatenate(
            [
                (within[:, None] + w.top * SUBPIXELS - REACH) * fine.width
                + within
                + w.left * SUBPIXELS
                - REACH
                for w in self._windows
            ]
        )
        counts = SHARED_SPP, BATCH // SUBPIXELS**2 - SHARED_SPP
        shared, rest = (
            walk.renderer.trace(
                fine,
                pixels.ravel().astype(np.uint32),
                RandomKey(
                    (self._seed + 2 * batch + part) % 2**32, walk.path.numbers[frame], Purpose.REFERENCE
                ),
                spp=spp,
                pixel_filter=PixelFilter.BOX,
            ).color.reshape(len(self._windows), side, side, 3)
            for part, spp in enumerate(counts)
        )
        whole = (counts[0] * shared + counts[1] * rest) / np.float32(sum(counts))
        found = {}
        for kind, samples in ((SampleFilter.BOX, whole), (SampleFilter.GAUSSIAN, shared)):
            weights = _weights(kind, self._windows[0].side)
            image = np.einsum("ia,kabc,jb->kijc", weights, samples, weights, optimize=True)
            found[kind] = image.astype(np.float32)
        return found

    def _write(self, walk: Walkthrough, frame: int, spp: int, halves: dict[SampleFilter, Any]) -> None:
        flow = walk.view(frame).flow
        arrays = {
            "spp": np.int64(spp),
            "has_backward": np.bool_(flow.has_backward),
            "has_forward": np.bool_(flow.has_forward),
            "backward": np.stack([w.crop(flow.backward) for w in self._windows]),
            "forward": np.stack([w.crop(flow.forward) for w in self._windows]),
            **{kind.value: image for kind, image in halves.items()},
        }
        file = self._file(frame)
        beside = file.with_suffix(f".{os.getpid()}.partial")
        with beside.open("wb") as stream:
            np.savez(stream, **arrays)
        beside.replace(file)


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
    return [camera.world_from_camera.ravel().tolist(), camera.fov_deg, camera.width, camera.height]


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
