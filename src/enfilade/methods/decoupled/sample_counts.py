"""Numbers of samples as functions of the quality: irradiance, specular lobes."""

from __future__ import annotations

import math

from enfilade.settings import DecoupledSettings

ACCUMULATED = 4  # keyframes to each side whose irradiance images are averaged with that of one
REACH = 3  # distinct frames to each side over which specular AOVs are accumulated
# At quality 1; divided by the square root of the quality.
IRRADIANCE_PATHS = 95.0  # of a pixel, in all images together that are averaged
SPECULAR_RAYS = 34.0  # of a pixel with specular lobes
MIN_IRRADIANCE_SPP = 4  # of one image
MOST_SPECULAR = 3.0  # times the specular rays, where fewer frames are accumulated


def irradiance_spp(settings: DecoupledSettings, keyframes: float) -> int:
    """Paths a pixel of an irradiance image.

    Parameters
    ----------
    settings
    keyframes
        Of the shot.
    """
    # Accumulation weighs distant images less: their mean has the noise of half as many of equal weight.
    averaged = max(min(keyframes, 2 * ACCUMULATED + 1) / 2.0, 1.0)
    spp = IRRADIANCE_PATHS / math.sqrt(settings.quality) / averaged
    return settings.irradiance_spp or max(round(spp), MIN_IRRADIANCE_SPP)


def specular_spp(settings: DecoupledSettings, frames: float) -> int:
    """Rays of a pixel with specular lobes: more of them where few frames are accumulated.

    Parameters
    ----------
    settings
    frames
        Distinct ones of the shot.
    """
    window = 2 * REACH + 1
    more = min(window / min(frames, window), MOST_SPECULAR)
    return settings.specular_spp or round(more * SPECULAR_RAYS / math.sqrt(settings.quality))
