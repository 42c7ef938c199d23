"""Numbers of samples as functions of the quality: irradiance, specular lobes."""

from __future__ import annotations

import math

from enfilade.methods.decoupled.light_camera import hash_grid_reduction, irradiance_reduction
from enfilade.methods.decoupled.shot import ACCUMULATED
from enfilade.settings import DecoupledSettings

# At quality 1; divided by the square root of the quality.
IRRADIANCE_PATHS = 380.0  # of a pixel of the hash grid's resolution, in all images together that are averaged
SPECULAR_RAYS = 34.0  # of a pixel with specular lobes
IRRADIANCE_SPP = 4, 512  # of one image: fewest and most


def irradiance_spp(settings: DecoupledSettings, keyframes: float, pixels: int) -> int:
    """Paths a pixel of an irradiance image.

    Parameters
    ----------
    settings
    keyframes
        Of the shot.
    pixels
        Of a frame: larger irradiance images have fewer paths a pixel, and as many in all.
    """
    share = (irradiance_reduction(pixels) / hash_grid_reduction(pixels)) ** 2
    spp = share * IRRADIANCE_PATHS / math.sqrt(settings.quality) / averaged_images(keyframes)
    least, most = IRRADIANCE_SPP
    return settings.irradiance_spp or min(max(4 * round(spp / 4), least), most)


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
    return settings.specular_spp or round(SPECULAR_RAYS / math.sqrt(settings.quality))
