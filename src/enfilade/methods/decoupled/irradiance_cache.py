"""The irradiance cache: images of keyframes, filtered, accumulated, and looked up anywhere in the scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Bool, Float, image, lanes, matrix3, opaque, vector3
from enfilade.kernels.estimate import GAUSSIAN_RADIUS_PX
from enfilade.kernels.guiding import PathGuide
from enfilade.kernels.rays import points_at
from enfilade.methods.decoupled.hash_grid import HashGrid
from enfilade.methods.decoupled.path_depth import UNWEIGHTED, DepthWeights
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.methods.decoupled.surface_image import (
    MIN_FOUND_WEIGHT,
    Layer,
    UploadedImage,
    footprint,
    lookup,
    upload_layers,
)
from enfilade.methods.decoupled.wavelet import guide_of, redistribute_fireflies, smooth_along
from enfilade.records import Geometry, Mask

MIN_COVERAGE = 0.02  # bilinear weight of the pixels around a point, above which an image shows it
FIREFLY_LEVELS = 5  # of the wavelet that distributes their energy


@dataclass(frozen=True)
class IrradianceCache:
    """Irradiance images, and a hash grid for surfaces that none of them shows. By default it is empty.

    Attributes
    ----------
    view : UploadedImage or None
        The mean of the images in the view of the camera, which is looked up first: most paths meet surfaces
        that the camera sees, too.
    images : tuple of UploadedImage
    weights : tuple of Float
        One an image, for surfaces that several of them show.
    hash_grid : HashGrid or None
    soft_only : bool
        Whether the images are without next-event estimates of emitters that cast sharp shadows, and the hash
        grid is looked up without their light.
    path_guide : PathGuide or None
        Of paths that estimate irradiance.
    min_coverage : Float
        Bilinear weight of the pixels around a point that show its surface, above which the image does. With
        a literal, the prepass and all else would have kernels of their own.
    depth_weights : DepthWeights
        Of cached irradiance after bounces off specular lobes.
    """

    view: UploadedImage | None = None
    images: tuple[UploadedImage, ...] = ()
    weights: tuple[Any, ...] = ()
    hash_grid: HashGrid | None = None
    soft_only: bool = False
    path_guide: PathGuide | None = None
    min_coverage: Any = field(default_factory=lambda: opaque(MIN_COVERAGE))
    depth_weights: DepthWeights = UNWEIGHTED

    def lookup_in_view(self, position: Any, normal: Any, shape_index: Any) -> tuple[Any, Any]:
        """The same as :meth:`lookup`, from the image in the view of the camera."""
        if self.view is None:
            return Array3f(0), Bool(False)
        return _mean([(self.view, Float(1))], position, normal, shape_index, self.min_coverage)

    def lookup(self, position: Any, normal: Any, shape_index: Any) -> tuple[Any, Any]:
        """Irradiance over pi at points, from the images.

        Parameters
        ----------
        position, normal : Array3f
        shape_index : UInt

        Returns
        -------
        irradiance : Array3f
            0 where none is found.
        is_found : Bool
        """
        return _mean(
            zip(self.images, self.weights, strict=True), position, normal, shape_index, self.min_coverage
        )


def _mean(
    images: Iterable[tuple[UploadedImage, Any]],
    position: Any,
    normal: Any,
    shape_index: Any,
    min_coverage: Any,
) -> tuple[Any, Any]:
    """Weighted mean of images at points (Array3f), and whether any shows them (Bool)."""
    total, weight = Array3f(0), Float(0)
    for one, own in images:
        found = lookup(position, normal, shape_index, one, margin=GAUSSIAN_RADIUS_PX)
        its_weight = dr.select(found.coverage > min_coverage, own, 0.0)
        total += its_weight * sum(found.totals, Array3f(0))
        weight += its_weight * found.weight
    is_found = weight > 0.0
    return dr.select(is_found, total / weight, 0.0), is_found


def upload(geometry: Geometry, irradiance: IrradianceImage) -> UploadedImage:
    """Upload an irradiance image in two layers, direct and indirect.

    Fireflies of indirect light are redistributed. A denoised image, whose variance is 0, has none: a single
    lane stands for its variances.

    Parameters
    ----------
    geometry
        G-buffer of the image.
    irradiance
    """
    direct, indirect = (
        (lanes(of.color), lanes(of.variance) if of.variance.any() else Float(0))
        for of in (irradiance.direct, irradiance.indirect)
    )
    if irradiance.indirect.variance.any():
        guide = guide_of(geometry, irradiance.is_known)
        indirect = redistribute_fireflies(*indirect, guide, levels=FIREFLY_LEVELS)
    return upload_layers(geometry, lanes(irradiance.is_known), [direct, indirect])


def accumulate(geometry: Geometry, is_known: Mask, images: Sequence[UploadedImage]) -> UploadedImage:
    """Average an irradiance image with others, and smooth it along its surfaces.

    Irradiance does not depend on the view: all images that show a point estimate it. Images of coarser
    resolution weigh less. Direct light, which has sharp edges, and indirect light, which has more noise, are
    smoothed separately.

    Parameters
    ----------
    geometry
        G-buffer of the image.
    is_known : (H, W) bool
        Its pixels with irradiance.
    images
        Irradiance images, itself among them. Denoised ones are not smoothed again: their variance is 0.

    Returns
    -------
    UploadedImage
        One layer, direct plus indirect, without variance: lookups do not read it.
    """
    layers, _ = _averaged(geometry, images, [1.0] * len(images))
    smoothed = [
        smooth_along(geometry, is_known, *layer) if np.array(layer[1]).any() else layer for layer in layers
    ]
    irradiance = sum((value for value, _ in smoothed), Array3f(0))
    return upload_layers(geometry, lanes(is_known), [(irradiance, Float(0))])


def reproject_to(
    geometry: Geometry, images: Sequence[UploadedImage], weights: Sequence[float]
) -> UploadedImage:
    """Reproject irradiance images to a view: an image for the lookups of its camera rays."""
    layers, is_known = _averaged(geometry, images, weights)
    return upload_layers(geometry, is_known, [(value, Float(0)) for value, _ in layers])


def is_covered(geometry: Geometry, images: Sequence[UploadedImage]) -> Mask:
    """Pixels of a view whose surfaces at least one image shows, (H, W)."""
    position, normal, shape_index = _surface_points(geometry)
    weight = Float(0)
    for one in images:
        weight += lookup(position, normal, shape_index, one).weight
        dr.eval(weight)  # so that one kernel serves any number of images
    return image(weight > MIN_FOUND_WEIGHT, *geometry.shape_index.shape)


def _surface_points(geometry: Geometry) -> tuple[Any, Any, Any]:
    """Points (Array3f), normals (Array3f) and shape indices (UInt) of the surfaces of a view."""
    position = points_at(geometry.camera, lanes(geometry.depth))
    dr.eval(position)
    return position, lanes(geometry.normal), lanes(geometry.shape_index)


def _averaged(
    geometry: Geometry, images: Sequence[UploadedImage], weights: Sequence[float]
) -> tuple[list[Layer], Any]:
    """Layers of several images at the surfaces of a view, averaged; and whether any shows them, Bool."""
    # Compute the points, and their footprints in this view.
    camera = geometry.camera
    position, normal, shape_index = _surface_points(geometry)
    own = footprint(position, normal, vector3(camera.eye), matrix3(camera.direction_from_pixel))
    layers = range(len(images[0].values))
    totals, variances = [Array3f(0) for _ in layers], [Float(0) for _ in layers]
    weight, valid = Float(0), Float(0)
    dr.eval(own)
    for one, given in zip(images, weights, strict=True):
        # Look up the image; coarser ones weigh less, as do all at their borders.
        found = lookup(position, normal, shape_index, one)
        its = footprint(position, normal, one.eye, one.direction_from_pixel)
        image_weight = opaque(float(given)) * found.taper * dr.minimum(own / its, 1.0)

        # Accumulate its layers.
        for layer in layers:
            totals[layer] += image_weight * found.totals[layer]
            variances[layer] += image_weight * image_weight * found.variances[layer] * found.weight
        weight += image_weight * found.weight
        valid += found.weight
        dr.eval(totals, variances, weight, valid)  # so that one kernel serves any number of images

    # Normalize.
    is_known = valid > MIN_FOUND_WEIGHT
    values = [dr.select(is_known, total / weight, 0.0) for total in totals]
    variance = [dr.select(is_known, v / (weight * weight), 0.0) for v in variances]
    dr.eval(values, is_known)
    return list(zip(values, variance, strict=True)), is_known
