"""Irradiance images by final gathering: of keyframes, and of disocclusions between them."""

from __future__ import annotations

from enfilade.camera.path import Segment
from enfilade.kernels.estimate import RayCount
from enfilade.methods.base import Output
from enfilade.methods.decoupled.denoising import NOISE_SHARE, denoise_irradiance
from enfilade.methods.decoupled.irradiance_cache import upload
from enfilade.methods.decoupled.light_camera import irradiance_camera
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.methods.decoupled.sample_counts import irradiance_spp
from enfilade.methods.decoupled.shot import ShotContext, either_side
from enfilade.methods.decoupled.surface_edges import narrow_surfaces, surface_edges
from enfilade.methods.decoupled.surface_image import UploadedImage
from enfilade.records import Mask
from enfilade.renderer import Purpose

NARROW_PATHS = 4  # times the paths of a pixel, on narrow surfaces: a denoiser leaves their noise
MIN_DISOCCLUSION = 1e-3  # of a frame's pixels: fewer have no image, and are estimated in each frame


def _gather(shot: ShotContext, frame: int, where: Mask) -> tuple[IrradianceImage, RayCount]:
    """Gather the irradiance of some pixels of an irradiance image, at their centres, and denoise it.

    Narrow surfaces, such as bevels, have more paths.

    Parameters
    ----------
    shot
    frame
    where : (H, W) bool

    Returns
    -------
    image : IrradianceImage
        Without a denoiser, its variance is that of its paths, times :data:`NOISE_SHARE`.
    count : RayCount
    """
    geometry = shot.images.irradiance_geometry(frame)
    walk, cache = shot.walk, shot.final_gather_cache(frame)
    estimate = shot.estimate(
        irradiance_camera(walk.path.cameras[frame]),
        where,
        lambda rays, sampler: shot.integrator.final_gather(cache, shot.spawn(frame, rays, sampler)),
        walk.random(frame, Purpose.IRRADIANCE),
    )
    spp = irradiance_spp(shot.settings, len(shot.keyframes))
    is_edge, _ = surface_edges(geometry)
    estimate.add(spp)
    narrow = narrow_surfaces(is_edge, where)
    estimate.add((NARROW_PATHS - 1) * spp, narrow[where])
    direct, indirect = (shading.to_image(where) for shading in estimate.shadings)
    image = IrradianceImage(direct, indirect, where).with_noise(NOISE_SHARE)
    if shot.settings.denoiser != "none":
        image = denoise_irradiance(geometry, image, shot.settings.denoiser, narrow=narrow)
    return image, estimate.count


def gather_keyframe(shot: ShotContext, frame: int) -> Output:
    """The irradiance image of a keyframe."""
    image, count = _gather(shot, frame, shot.images.irradiance_geometry(frame).has_diffuse)
    return Output({frame: image}, {"rays": {"irradiance": count.rays}, "dropped": count.dropped})


def fill_disocclusions(shot: ShotContext, segment: Segment) -> Output:
    """Disocclusion images: irradiance of surfaces between two keyframes that no keyframe shows.

    The segment is halved until no further surface comes into view. An image contains all surfaces of its
    frame that the keyframes do not show, so that other frames find them in the images before and after.
    """
    images: dict[int, IrradianceImage] = {}
    uploaded: dict[int, UploadedImage] = {}
    count = RayCount()
    pending = [(segment.first, segment.last)]
    while pending:
        first, last = pending.pop()
        middle = shot.walk.path.middle(Segment(first, last))
        if middle is None:
            continue

        # Stop where the keyframes and the nearest images show nearly all surfaces.
        neighbours = {f: uploaded[f] for f in either_side(sorted(uploaded), middle)}
        if shot.uncovered(middle, neighbours).mean() < MIN_DISOCCLUSION:
            continue

        # Gather the surfaces that no keyframe shows, and go on with both halves.
        image, own = _gather(shot, middle, shot.uncovered(middle, {}))
        images[middle], uploaded[middle] = image, upload(shot.images.irradiance_geometry(middle), image)
        count += own
        pending += [(middle, last), (first, middle)]
    numbers = [shot.walk.path.numbers[frame] for frame in sorted(images)]
    metadata = {"rays": {"irradiance": count.rays}, "dropped": count.dropped}
    return Output(images, metadata | {"images": numbers})
