"""Numbers of samples as functions of the quality: irradiance (by a pilot pass), specular lobes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from enfilade.methods.base import Output
from enfilade.methods.decoupled.irradiance import gather
from enfilade.methods.decoupled.irradiance_cache import accumulate, total_irradiance, upload
from enfilade.methods.decoupled.shot import ACCUMULATED, ShotContext
from enfilade.metric import Aqm
from enfilade.records import Mask
from enfilade.renderer import Purpose
from enfilade.settings import DecoupledSettings

PILOT_SPP = 4  # of each of the two images that the pilot compares
IRRADIANCE_SPP = 8, 256  # fewest and most
IRRADIANCE_SHARE = 0.5  # of the squared quality that the noise of irradiance may take
MIN_DIFFUSE = 0.5  # of the largest number of diffuse pixels of a keyframe: the pilot uses none with fewer
SPECULAR_SPP = 17.0, 2, 34  # of a pixel with specular lobes, by the root of the quality; fewest and most
FFT_THREADS = 2


def run_pilot(shot: ShotContext) -> Output:
    """Choose the paths a pixel of irradiance images by the visible difference of two rough ones."""
    settings = shot.settings
    frame = _pilot_frame(shot)
    where = shot.light_geometry(frame).has_diffuse
    jnd = _pilot_jnd(shot, frame, where) if where.any() else 0.0
    spp = irradiance_spp(jnd, settings.quality, len(shot.keyframes))
    rays = 2 * PILOT_SPP * int(where.sum())
    return Output(facts={"jnd": jnd, "spp": spp, "rays": {"prepass": rays}})


def irradiance_spp(jnd: float, quality: float, keyframes: int) -> int:
    """Paths a pixel of an irradiance image.

    Parameters
    ----------
    jnd
        Visible difference between two images of :data:`PILOT_SPP` paths.
    quality
        JND.
    keyframes
        Of the shot.
    """
    # Each image has half of the squared difference. Accumulation divides it by the number of images.
    spp = PILOT_SPP * (jnd / quality) ** 2 / (2.0 * averaged_images(keyframes) * IRRADIANCE_SHARE)
    return int(np.clip(4 * math.ceil(spp / 4), *IRRADIANCE_SPP))


def averaged_images(keyframes: float) -> float:
    """Number of irradiance images of equal weight whose mean has the noise of the accumulated ones.

    Accumulation weighs distant images less: half of them count.

    Parameters
    ----------
    keyframes
        Of the shot.
    """
    return max(min(keyframes, 2 * ACCUMULATED + 1) / 2.0, 1.0)


def specular_spp(settings: DecoupledSettings) -> int:
    """Rays of a pixel with specular lobes."""
    at_one, least, most = SPECULAR_SPP
    return settings.specular_spp or min(max(round(at_one / math.sqrt(settings.quality)), least), most)


def _pilot_frame(shot: ShotContext) -> int:
    """The middle keyframe, or the one with most diffuse pixels where the middle one has few."""
    counts = {k: shot.inputs.facts("prepass", k)["diffuse_pixels"] for k in shot.keyframes}
    middle = shot.keyframes[len(shot.keyframes) // 2]
    most = max(shot.keyframes, key=lambda k: counts[k])
    return most if counts[middle] < MIN_DIFFUSE * counts[most] else middle


def _pilot_jnd(shot: ShotContext, frame: int, where: Mask) -> float:
    """Visible difference between two irradiance images of a keyframe, as its surfaces show them.

    Their random numbers are not those of the keyframe's own irradiance image, whose error would then depend
    on the number of paths that they decide.
    """
    walk = shot.walk
    geometry = shot.light_geometry(frame)
    shown = []
    for purpose in (Purpose.PILOT, Purpose.SECOND_PILOT):
        image, _ = gather(shot, frame, where, PILOT_SPP, purpose)
        accumulated = accumulate(geometry, where, [upload(geometry, image)])
        irradiance = total_irradiance(accumulated, *where.shape)
        shown.append(walk.display_luminance(geometry.albedo * irradiance))
    height, width = where.shape
    viewing = replace(walk.viewing, width_px=width, height_px=height)
    metric = Aqm.modern(viewing, workers=FFT_THREADS)
    return metric.compare(shown[0], shown[1], valid=where).score
