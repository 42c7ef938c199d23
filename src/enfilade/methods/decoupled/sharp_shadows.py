"""Shadows of sharp emitters: their visibility is denoised where it varies, not their light.

Light is the product of what reaches a surface without occluders, which has little noise and the contrast of
bump maps, and of visibility, which alone has the noise of penumbrae (ratio estimator, Heitz et al. 2018).
"""

from __future__ import annotations

import numpy as np
import scipy.ndimage

from enfilade.kernels.tone import luminance
from enfilade.methods.decoupled.adaptive_sampling import AROUND
from enfilade.methods.decoupled.denoising import NOISE_SHARE, denoise_regions
from enfilade.methods.decoupled.reconstruction import smoothed
from enfilade.methods.decoupled.surface_edges import surface_edges
from enfilade.records import F32, Geometry, Shading

WINDOW = 5  # pixels: the window in which visibility is compared
CONTRAST = 0.02  # of visibility in the window, below which there is no penumbra


def smooth_shadows(
    geometry: Geometry, irradiance: Shading, unfiltered: F32, unoccluded: F32, *, quality: str
) -> F32:
    """What denoised visibility of sharp emitters adds to the radiance of a frame.

    It is 0 where all of the window is lit alike, at edges of surfaces, and where there is no diffuse lobe.
    Denoised visibility is limited to what was found in the window. Where the denoiser changes more than noise
    explains, as at sharp edges and narrow shadows, the change is reduced by the ratio of the two variances,
    as by a Wiener filter.

    Parameters
    ----------
    geometry
        G-buffer of the frame.
    irradiance
        By sharp emitters, over pi, as it is in the frame: reconstructed, of shape (H, W).
    unfiltered, unoccluded : (H, W, 3) float32
        Means over each pixel alone: of the same, and of that without occluders.
    quality
        Of the denoiser.

    Returns
    -------
    (H, W, 3) float32
    """
    # Find the visibility; in channels without light it is that of the others.
    whole = luminance(unoccluded)
    where = geometry.has_diffuse & ~surface_edges(geometry)[0] & (whole > 0.0)
    mean = luminance(unfiltered) / np.where(where, whole, np.float32(1))
    has_light = unoccluded > 0.0
    visibility = np.where(
        has_light, unfiltered / np.where(has_light, unoccluded, np.float32(1)), mean[..., None]
    )

    # Denoise it where it varies.
    low, high = (
        extreme(np.where(where[..., None], visibility, beyond), (WINDOW, WINDOW, 1))
        for extreme, beyond in (
            (scipy.ndimage.minimum_filter, np.float32(np.inf)),
            (scipy.ndimage.maximum_filter, np.float32(-np.inf)),
        )
    )
    within = where & np.any(high - low > CONTRAST, axis=2)
    change = np.zeros_like(irradiance.color)
    if not within.any():
        return change
    clean = denoise_regions(visibility, geometry, where, quality, is_mirrored=False, within=within)

    # Filter its product with the light as pixels are.
    light = unfiltered.copy()
    light[within] = np.clip(clean[within], low[within], high[within]) * unoccluded[within]
    change[within] = smoothed(light)[within] - irradiance.color[within]

    # Compare the change with the noise. Where both are zero, sums may be just below it.
    noise = scipy.ndimage.uniform_filter(np.float32(NOISE_SHARE) * irradiance.variance * within, AROUND)
    squared = scipy.ndimage.uniform_filter(np.square(luminance(change)), AROUND)
    noise = np.maximum(noise, np.float32(0))
    kept = np.divide(noise, squared, out=np.ones_like(squared), where=squared > noise)
    return geometry.albedo * change * kept[..., None]
