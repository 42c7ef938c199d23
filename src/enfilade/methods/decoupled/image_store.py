"""The irradiance images of a shot on the device: uploaded, and accumulated with the images around them."""

from __future__ import annotations

from enfilade.cache import LruCache
from enfilade.camera.path import CameraPath, Segment
from enfilade.camera.pinhole import Camera
from enfilade.gbuffer import find_geometry
from enfilade.methods.analysis import keyframes_of
from enfilade.methods.base import Inputs
from enfilade.methods.decoupled.irradiance_cache import accumulate, upload
from enfilade.methods.decoupled.light_camera import irradiance_camera, light_camera, virtual_camera
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.methods.decoupled.sample_counts import ACCUMULATED
from enfilade.methods.decoupled.surface_image import UploadedImage
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Geometry
from enfilade.settings import DecoupledSettings

PREPASS_IMAGES = 4  # nearest ones that are looked up
DISOCCLUSION_IMAGES = 2  # that are looked up: before and after a frame


class ImageStore:
    """The irradiance images of a shot: those of the prepass and of keyframes, and disocclusion images.

    Parameters
    ----------
    segments
        Of the shot, between its keyframes.
    inputs
        Results of earlier passes.
    walk
    """

    def __init__(self, segments: list[Segment], inputs: Inputs, walk: Walkthrough) -> None:
        self._segments = segments
        self._keyframes = keyframes_of(segments)
        self._inputs = inputs
        self._walk = walk
        # Sized so that each image is uploaded and accumulated once along the path.
        self._prepass: LruCache[int, UploadedImage] = LruCache(2 * ACCUMULATED + 1 + PREPASS_IMAGES)
        self._accumulated_prepass: LruCache[int, UploadedImage] = LruCache(PREPASS_IMAGES + 2)
        self._irradiance: LruCache[int, UploadedImage] = LruCache(2 * (2 * ACCUMULATED + 1))
        size = walk.settings[DecoupledSettings].lookup_keyframes + DISOCCLUSION_IMAGES + 1
        self._accumulated: LruCache[int, UploadedImage] = LruCache(size)
        self._resized: LruCache[tuple[int, int], Geometry] = LruCache(2)
        self._disocclusions: dict[int, list[int]] | None = None

    def accumulated_prepass(self, frame: int) -> UploadedImage:
        """The prepass image of a keyframe, averaged with the images around it."""

        def make() -> UploadedImage:
            around = sorted(nearest(self._walk.path, self._keyframes, frame, 2 * ACCUMULATED + 1))
            own: IrradianceImage = self._inputs.record("prepass", frame)
            images = [self._prepass_image(keyframe) for keyframe in around]
            return accumulate(self.light_geometry(frame), own.is_known, images)

        return self._accumulated_prepass.get(frame, make)

    def _prepass_image(self, frame: int) -> UploadedImage:
        return self._prepass.get(
            frame, lambda: upload(self.light_geometry(frame), self._inputs.record("prepass", frame))
        )

    def accumulated(self, frame: int) -> UploadedImage:
        """The image of :meth:`irradiance`, averaged with the images around it."""

        def make() -> UploadedImage:
            around = nearest(self._walk.path, self._keyframes, frame, 2 * ACCUMULATED + 1)
            disocclusions = sorted({f for frames in self.disocclusions().values() for f in frames})
            around += nearest(self._walk.path, disocclusions, frame, 2 * ACCUMULATED + 1)
            images = [self.irradiance(f) for f in sorted({*around, frame})]
            return accumulate(self.irradiance_geometry(frame), self._record(frame).is_known, images)

        return self._accumulated.get(frame, make)

    def irradiance(self, frame: int) -> UploadedImage:
        """The irradiance image of a keyframe, or a disocclusion image."""
        return self._irradiance.get(
            frame, lambda: upload(self.irradiance_geometry(frame), self._record(frame))
        )

    def _record(self, frame: int) -> IrradianceImage:
        pass_name = "irradiance" if frame in self._keyframes else "disocclusion"
        record: IrradianceImage = self._inputs.record(pass_name, frame)
        return record

    def disocclusions(self) -> dict[int, list[int]]:
        """Frames of the disocclusion images of each segment, by its first frame."""
        if self._disocclusions is None:
            places = {number: index for index, number in enumerate(self._walk.path.numbers)}
            self._disocclusions = {
                s.first: [places[n] for n in self._inputs.metadata("disocclusion", s.first)["images"]]
                for s in self._segments
            }
        return self._disocclusions

    def irradiance_geometry(self, frame: int) -> Geometry:
        """G-buffer of an irradiance image."""
        return self._geometry(frame, irradiance_camera(self._walk.path.cameras[frame]))

    def light_geometry(self, frame: int) -> Geometry:
        """G-buffer of the light camera."""
        return self._geometry(frame, light_camera(self._walk.path.cameras[frame]))

    def virtual_geometry(self, frame: int) -> Geometry:
        """G-buffer of the camera of virtual images."""
        return self._geometry(frame, virtual_camera(self._walk.path.cameras[frame]))

    def _geometry(self, frame: int, camera: Camera) -> Geometry:
        """G-buffer of a frame by a camera of another size."""
        if camera is self._walk.path.cameras[frame]:
            return self._walk.view(frame).geometry
        return self._resized.get((frame, camera.width), lambda: find_geometry(self._walk.renderer, camera))


def nearest(path: CameraPath, frames: list[int], frame: int, count: int) -> list[int]:
    """The frames of a list that are nearest on the path, nearest first; repeated poses do not count."""
    here = path.distance(frame)
    return sorted(frames, key=lambda k: (abs(path.distance(k) - here), k))[:count]
