"""Open Image Denoise on light alone, without texture: irradiance images and specular AOVs."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import numpy.typing as npt
import scipy.ndimage

from enfilade.arrays import Array3f, Array4f, image, lanes
from enfilade.kernels.tone import REC709_LUMINANCE, luminance
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.methods.decoupled.wavelet import Guide, firefly_weights, guide_of, smooth
from enfilade.methods.denoise import denoise
from enfilade.records import F32, Geometry, Mask, Shading

MARGIN = 8  # pixels around those with light, which are denoised with them
BLOCK = 32  # pixels: regions with a whole empty block of a grid between them are denoised apart
NOISE_SHARE = 0.25  # of the variance of irradiance: low-discrepancy samples have less noise than it tells
OUTLIER = 64.0  # times the denoised irradiance: brighter estimates are limited where the mean is kept
NEGLIGIBLE = 1e-2  # of the light of a block: where less is below zero, the correction accounts for it
CORRECTION_LEVELS = 5  # of the wavelet that smooths the correction: 32 pixels to each side


def denoise_irradiance(
    geometry: Geometry,
    image: IrradianceImage,
    quality: str,
    *,
    outlier: float = OUTLIER,
    is_excess_kept: bool = False,
    narrow: Mask | None = None,
) -> IrradianceImage:
    """An irradiance image whose layers are denoised apart; its variance is 0.

    Parameters
    ----------
    geometry
        G-buffer of the image.
    image
    quality
        Of the denoiser.
    outlier, is_excess_kept
        As of :func:`denoise_light`.
    narrow
        Pixels, (H, W), whose indirect light is clamped for the denoiser.
    """
    direct, indirect = (
        Shading(
            denoise_light(
                geometry,
                layer,
                image.is_known,
                quality=quality,
                outlier=outlier,
                is_excess_kept=is_excess_kept,
                clamped=clamped,
            ),
            np.zeros_like(layer.variance),
            layer.dropped,
        )
        for layer, clamped in ((image.direct, None), (image.indirect, narrow))
    )
    return IrradianceImage(direct, indirect, image.is_known)


def denoise_light(
    geometry: Geometry,
    light: Shading,
    where: Mask,
    *,
    quality: str,
    outlier: float,
    is_excess_kept: bool = False,
    is_mirrored: bool = True,
    clamped: Mask | None = None,
) -> F32:
    """Denoise light with normals as guides, and keep its mean along surfaces.

    The denoiser loses some percent of the light where samples are skewed, and brightens regions two pixels
    wide by about a third. The difference from its input, smoothed along surfaces, is added to its result, as
    far as it exceeds its own standard error, in proportion to the denoised luminance: what is lost of a
    highlight does not brighten the dark surface around it. A highlight of a few pixels thus keeps some of its
    noise.
    Outliers are limited, so that no single path tints a surface. The denoiser takes no negative light, which
    is denoised apart where it is more than a hundredth of the light around: specular lobes that are a
    difference have it, and so has indirect light behind cut-outs and thin glass, where the expectation of
    what paths find by chance is subtracted.

    Parameters
    ----------
    geometry
        G-buffer: of the surfaces themselves, or of those seen in them.
    light
        Estimates of shape (H, W) without albedo, with the variance of their mean luminance.
    where : (H, W) bool
        Pixels that were sampled.
    quality
        Of the denoiser.
    outlier
        Limit of the input of the correction, in units of the denoised value.
    is_excess_kept
        Whether light beyond that limit is distributed: along surfaces as far as many outliers tell how much
        of it each surface has, and over the whole image, in proportion to the light there.
    is_mirrored
        Whether the light is that at pixels' centres: where no pixels were sampled, the denoiser sees it
        mirrored. Averages over pixels, which have less light at a boundary, are copied.
    clamped
        Pixels, (H, W), whose fireflies are clamped for the denoiser, which would keep them on narrow
        surfaces; but not those with fewer than two neighbours that have light. The correction adds their
        light, up to `outlier`.

    Returns
    -------
    (H, W, 3) float32
        0 where no pixels were sampled.
    """
    # Denoise, light below zero apart.
    most = np.float32(outlier)
    positive = np.maximum(light.color, np.float32(0))
    seen = positive if clamped is None else _without_fireflies(positive, clamped)
    above = denoise_regions(seen, geometry, where, quality, is_mirrored=is_mirrored)
    negative = positive - light.color
    is_counted = _in_blocks(negative.sum(axis=2)) > NEGLIGIBLE * _in_blocks(positive.sum(axis=2))
    negative[~_of_pixels(is_counted, where.shape)] = 0.0
    below = denoise_regions(negative, geometry, where, quality, is_mirrored=is_mirrored)

    # Correct it by the difference from the input.
    guide, clean, magnitude = guide_of(geometry, where), above - below, above + below
    limited = np.clip(light.color, -most * magnitude, most * above)
    corrected = clean + _correction(Shading(limited - clean, light.variance), magnitude, guide)
    bounded: F32 = np.maximum(np.where(where[..., None], corrected, np.float32(0)), -most * below)
    if is_excess_kept:
        excess = np.where(where[..., None], light.color - limited, np.float32(0))
        if excess.any():
            bounded = _with_excess(bounded, excess, magnitude * where[..., None], guide)
    return bounded


def correct_light(
    geometry: Geometry, clean: F32, light: Shading, where: Mask, *, levels: int = CORRECTION_LEVELS
) -> F32:
    """Correct light by noisier estimates without bias, along surfaces, as far as these are certain.

    Parameters
    ----------
    geometry
        G-buffer.
    clean : (H, W, 3) float32
        With little noise, and perhaps a bias.
    light
        Estimates of shape (H, W), with the variance of their mean luminance. None is limited: their mean
        would have a bias of its own.
    where : (H, W) bool
        Pixels that were sampled.
    levels
        Of the wavelet that smooths the correction, over 2 ** levels pixels to each side.

    Returns
    -------
    (H, W, 3) float32
        Not below zero where `clean` is not; 0 where no pixels were sampled.
    """
    difference = Shading(light.color - clean, light.variance)
    corrected = clean + _correction(difference, np.abs(clean), guide_of(geometry, where), levels)
    bounded = np.where(clean < 0.0, corrected, np.maximum(corrected, np.float32(0)))
    return np.where(where[..., None], bounded, np.float32(0))


def _correction(difference: Shading, magnitude: F32, guide: Guide, levels: int = CORRECTION_LEVELS) -> F32:
    """A difference, smoothed along surfaces, as far as it is significant, in proportion to the luminance.

    Parameters
    ----------
    difference
        Of shape (H, W), with the variance of its mean luminance.
    magnitude : (H, W, 3) float32
        Of the light to which it is added, 0 or more.
    guide, levels
        Of the wavelet filter.

    Returns
    -------
    (H, W, 3) float32
    """
    own = lanes(luminance(magnitude))
    smoothed, variance = smooth(
        Array4f(*lanes(difference.color), own),
        lanes(difference.variance),
        guide,
        levels=levels,
        deviations=None,
    )
    squared = dr.square(dr.dot(smoothed.xyz, Array3f(*REC709_LUMINANCE)))
    share = own / dr.maximum(smoothed.w, 1e-20)
    correction = smoothed.xyz * share * squared / dr.maximum(squared + variance, 1e-20)
    return image(correction, *difference.variance.shape)


def _with_excess(color: F32, excess: F32, weight: F32, guide: Guide) -> F32:
    """Light with that of its outliers: on their surfaces where it is certain, else over the whole image.

    The null hypothesis is that outliers are distributed in proportion to the light. The difference from it is
    smoothed along surfaces. By the part of its square that exceeds its variance, as in the positive-part
    James-Stein estimator, surfaces have what was found on them; the rest is distributed in proportion to the
    light. The variance of a sum of outliers is the sum of their squares; that of the hypothesis is added,
    since a surface may have no outliers by chance.

    Parameters
    ----------
    color : (H, W, 3) float32
        Without the outliers' light; what is below zero stays.
    excess : (H, W, 3) float32
        Light of outliers, in their pixels.
    weight : (H, W, 3) float32
        Magnitude of the light, 0 or more.
    guide
        Of the wavelet filter.

    Returns
    -------
    (H, W, 3) float32
    """

    def total(of: F32) -> Any:
        return of.sum(axis=(0, 1), dtype=np.float64)

    def proportional(amount: Any, weight: F32) -> F32:
        """An amount of light (3,), distributed in proportion to the weights."""
        scale = np.where(total(weight) > 0.0, amount / np.maximum(total(weight), 1e-20), 0.0)
        return weight * scale.astype(np.float32)

    # Smooth the difference from the hypothesis along surfaces.
    even, own, squared = proportional(total(excess), weight), luminance(weight), np.square(luminance(excess))
    squared += np.square(own) * np.float32(squared.sum() / max(np.square(own).sum(), 1e-20))
    smoothed, variance = smooth(
        Array4f(*lanes(excess - even), lanes(own)),
        lanes(squared),
        guide,
        levels=CORRECTION_LEVELS,
        deviations=None,
    )
    uneven = smoothed.xyz * (lanes(own) / dr.maximum(smoothed.w, 1e-20))
    difference = dr.square(dr.dot(smoothed.xyz, Array3f(*REC709_LUMINANCE)))
    known = image(dr.select(difference > variance, 1.0 - variance / difference, 0.0), *own.shape)[..., None]

    # Surfaces have what is certain; what is left goes where nothing is.
    certain = known * (even + image(uneven, *own.shape))
    left = total(excess) - total(certain)
    added = certain + proportional(np.where(left * total(excess) > 0.0, left, 0.0), (1 - known) * weight)
    with_added: F32 = color + np.maximum(added, -np.maximum(color, np.float32(0)))
    return with_added


def _without_fireflies(color: F32, where: Mask) -> F32:
    """Light whose fireflies are clamped, but for pixels with fewer than two neighbours that have light."""
    height, width = where.shape
    weights = image(firefly_weights(lanes(color), width=width, height=height, rank=2), height, width)
    clamped: F32 = color * np.where(where & (weights > 0.0), weights, np.float32(1))[..., None]
    return clamped


def denoise_regions(
    color: F32,
    geometry: Geometry,
    where: Mask,
    quality: str,
    *,
    is_mirrored: bool,
    within: Mask | None = None,
) -> F32:
    """Denoise the regions of an image that have light; the guides are an albedo of one, and the normals.

    Where no pixels were sampled, light and guides are continued: a denoiser darkens surfaces beside black
    pixels, and beside an edge of its guides.

    Parameters
    ----------
    color : (H, W, 3) float32
        0 or more.
    geometry, where, quality, is_mirrored
        As of :func:`denoise_light`.
    within : (H, W) bool
        Pixels whose regions are denoised; None: those that have light.

    Returns
    -------
    (H, W, 3) float32
        0 outside of the regions.
    """
    clean = np.zeros_like(color)
    for part, own in _regions(where & np.any(color, axis=2) if within is None else within):
        source = _continued(where[part], is_mirrored=is_mirrored)
        light, normal = color[part][source], geometry.normal[part][source]
        denoised = denoise(light, np.ones_like(light), normal, quality=quality)
        clean[part] = np.where(own[..., None], denoised, clean[part])
    return clean


def _continued(where: Mask, *, is_mirrored: bool) -> tuple[Any, ...]:
    """Rows and columns of the sampled pixels from which all pixels take their values.

    Sampled pixels are their own source. That of others is at the boundary, or as far beyond it if mirrored,
    with a jitter of up to that distance: copies of single pixels would be streaks, and the noise of a narrow
    region, mirrored in both of its boundaries, would have a period.
    """
    source, missing = np.indices(where.shape, np.int32), ~where
    distance, nearest = scipy.ndimage.distance_transform_edt(missing, return_indices=True)
    here, boundary, reach = source[:, missing], nearest[:, missing], distance[missing]
    jitter = np.rint(reach * np.random.default_rng(0).uniform(-1.0, 1.0, here.shape)).astype(np.int32)
    beyond = (2 * boundary - here if is_mirrored else here) + jitter
    source[:, missing] = nearest[:, *np.clip(beyond, 0, np.reshape(where.shape, (2, 1)) - 1)]
    return tuple(source)


def _regions(mask: Mask) -> list[tuple[tuple[slice, slice], Mask]]:
    """Regions of a mask that are far apart: the rectangle around each, and the pixels of it that are its own.

    It is one rectangle around all of them if theirs have more pixels in total.
    """
    blocks, _ = scipy.ndimage.label(_in_blocks(mask) > 0, np.ones((3, 3)))
    labels = np.where(mask, _of_pixels(blocks, mask.shape), 0)
    parts, whole = _rectangles(labels), _rectangles(mask.astype(np.int32))
    if sum(labels[part].size for part in parts) > sum(labels[part].size for part in whole):
        return [(part, np.ones_like(mask[part])) for part in whole]
    nearest = scipy.ndimage.maximum_filter(labels, 2 * MARGIN + 1)
    return [(part, np.isin(nearest[part], (0, number))) for number, part in enumerate(parts, 1)]


def _in_blocks(image: npt.NDArray[Any]) -> Any:
    """Sums of an image, (H, W), over the blocks of a grid."""
    rows, columns = (np.arange(0, size, BLOCK) for size in image.shape)
    return np.add.reduceat(np.add.reduceat(image, rows, axis=0, dtype=np.float64), columns, axis=1)


def _of_pixels(blocks: npt.NDArray[Any], shape: tuple[int, ...]) -> Any:
    """Values of blocks at their pixels, (H, W)."""
    return blocks.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)[: shape[0], : shape[1]]


def _rectangles(labels: npt.NDArray[np.int32]) -> list[tuple[slice, slice]]:
    """The smallest rectangles around numbered regions, and their margins."""
    return [
        (
            slice(max(rows.start - MARGIN, 0), rows.stop + MARGIN),
            slice(max(columns.start - MARGIN, 0), columns.stop + MARGIN),
        )
        for rows, columns in scipy.ndimage.find_objects(labels)
    ]
