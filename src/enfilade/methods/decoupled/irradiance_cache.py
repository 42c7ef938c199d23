"""The irradiance cache: images of keyframes, filtered, accumulated, and looked up anywhere in the scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from enfilade.arrays import Array3f, Bool, Float, Int, UInt, image, lanes, matrix3, opaque, vector3
from enfilade.kernels.estimate import GAUSSIAN_RADIUS_PX
from enfilade.kernels.guiding import PathGuide
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.methods.decoupled.hash_grid import HashGrid
from enfilade.methods.decoupled.lookup import UploadedImage, footprint, lookup, packed
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.methods.decoupled.wavelet import Guide, redistribute_fireflies, smooth
from enfilade.records import U32, Geometry, Mask

PLANE_TOLERANCE = 0.01  # of the depth
MIN_WEIGHT = 0.02  # of all taps together, above which a surface counts as found
FIREFLY = 2.0  # times the second brightest neighbour: brighter pixels are fireflies
FIREFLY_LEVELS = 5  # of the wavelet that distributes their energy
SMOOTHING_LEVELS = 4
SMOOTHING_DEVIATIONS = 3.0  # of the luminance, across which it smooths
NORMAL_EXPONENT = 64  # of the cosine: normals 12 degrees apart have a weight of a quarter

Layer = tuple[Any, Any]  # Array3f: values, Float: variance of its luminance


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
    is_soft : bool
        Whether the images are without next-event estimates of emitters that cast sharp shadows.
    path_guide : PathGuide or None
        Of paths that estimate irradiance.
    """

    view: UploadedImage | None = None
    images: tuple[UploadedImage, ...] = ()
    weights: tuple[Any, ...] = ()
    hash_grid: HashGrid | None = None
    is_soft: bool = False
    path_guide: PathGuide | None = None

    @staticmethod
    def of(
        images: Sequence[UploadedImage],
        weights: Sequence[float],
        hash_grid: HashGrid | None = None,
        *,
        view: UploadedImage | None = None,
        is_soft: bool = False,
        path_guide: PathGuide | None = None,
    ) -> IrradianceCache:
        """A cache of some images with their weights."""
        own = tuple(opaque(float(weight)) for weight in weights)
        return IrradianceCache(view, tuple(images), own, hash_grid, is_soft, path_guide)

    def lookup_in_view(self, position: Any, normal: Any, shape_index: Any) -> tuple[Any, Any]:
        """The same as :meth:`lookup`, from the image in the view of the camera."""
        if self.view is None:
            return Array3f(0), Bool(False)
        return _mean([(self.view, Float(1))], position, normal, shape_index)

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
        return _mean(zip(self.images, self.weights, strict=True), position, normal, shape_index)


def _mean(
    images: Iterable[tuple[UploadedImage, Any]], position: Any, normal: Any, shape_index: Any
) -> tuple[Any, Any]:
    """Weighted mean of images at points (Array3f), and whether any shows them (Bool)."""
    total, weight = Array3f(0), Float(0)
    valid = Float(0)
    for one, own in images:
        found = lookup(
            position, normal, shape_index, one, plane_tolerance=PLANE_TOLERANCE, margin=GAUSSIAN_RADIUS_PX
        )
        total += own * sum(found.totals, Array3f(0))
        weight += own * found.weight
        valid += dr.select(own > 0.0, found.weight, 0.0)
    is_found = valid > MIN_WEIGHT
    return dr.select(is_found, total / weight, 0.0), is_found


def upload(geometry: Geometry, irradiance: IrradianceImage) -> UploadedImage:
    """Upload an irradiance image in two layers, direct and indirect.

    Fireflies of indirect light are redistributed. A denoised image, whose variance is 0, has none.

    Parameters
    ----------
    geometry
        G-buffer of the image.
    irradiance
    """
    indirect = lanes(irradiance.indirect.color), lanes(irradiance.indirect.variance)
    if irradiance.indirect.variance.any():
        guide = guide_of(geometry, np.where(irradiance.is_known, geometry.shape_index, np.uint32(0)))
        indirect = redistribute_fireflies(*indirect, guide, times=FIREFLY, levels=FIREFLY_LEVELS)
    direct = lanes(irradiance.direct.color), lanes(irradiance.direct.variance)
    return upload_layers(geometry, lanes(irradiance.is_known), [direct, indirect])


def upload_layers(
    geometry: Geometry, is_known: Any, layers: Sequence[Layer], *, has_normals: bool = True
) -> UploadedImage:
    """Upload layers of an image into memory that is not shared with NumPy.

    Memory shared with NumPy can't be freed while a kernel is recorded.

    Parameters
    ----------
    geometry
    is_known : Bool
        Pixels that have values, width * height lanes.
    layers
        Values (Array3f) and variances of their luminance (Float), the same.
    has_normals
        Whether normals are compared in lookups.
    """
    camera = geometry.camera
    uploaded = UploadedImage(
        depths=dr.select(is_known, lanes(geometry.depth), 0.0),
        shape_indices=dr.select(is_known, lanes(geometry.shape_index), 0),
        normals=packed(lanes(geometry.normal)) if has_normals else None,
        values=tuple(dr.select(is_known, value, 0.0) for value, _ in layers),
        variances=tuple(dr.select(is_known, variance, 0.0) for _, variance in layers),
        eye=vector3(camera.eye),
        direction_from_pixel=matrix3(camera.direction_from_pixel),
        pixel_from_direction=matrix3(camera.pixel_from_direction),
        width=opaque(camera.width, Int),
        height=opaque(camera.height, Int),
    )
    dr.eval(uploaded.depths, uploaded.shape_indices, uploaded.normals, uploaded.values, uploaded.variances)
    return uploaded


def blank_image(layers: int) -> UploadedImage:
    """An image that shows nothing, in place of a missing one, so that one kernel serves any number of images.

    Its arrays are its own: Dr.Jit merges arrays that appear twice, which would make another kernel.

    Parameters
    ----------
    layers
        Number of layers of the other images.
    """

    def zeros(kind: Any) -> Any:
        found = dr.zeros(kind, 2)  # gathering from a single lane would be another kernel
        dr.make_opaque(found)
        return found

    nowhere = np.zeros((3, 3))
    return UploadedImage(
        depths=zeros(Float),
        shape_indices=zeros(UInt),
        normals=zeros(UInt),
        values=tuple(zeros(Array3f) for _ in range(layers)),
        variances=tuple(zeros(Float) for _ in range(layers)),
        eye=vector3(np.zeros(3)),
        direction_from_pixel=matrix3(nowhere),
        pixel_from_direction=matrix3(nowhere),  # all points are behind its camera
        width=opaque(2, Int),
        height=opaque(1, Int),
    )


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
        One layer, direct plus indirect.
    """
    layers, _ = _averaged(geometry, images, [1.0] * len(images))
    groups = np.where(is_known, geometry.shape_index, np.uint32(0))
    smoothed = [
        smooth_along(geometry, groups, *layer) if np.array(layer[1]).any() else layer for layer in layers
    ]
    irradiance = sum((value for value, _ in smoothed), Array3f(0))
    variance = sum((variance for _, variance in smoothed), Float(0))
    return upload_layers(geometry, lanes(is_known), [(irradiance, variance)])


def reproject_to(
    geometry: Geometry, images: Sequence[UploadedImage], weights: Sequence[float]
) -> UploadedImage:
    """Reproject irradiance images to a view: an image for the lookups of its camera rays."""
    layers, is_known = _averaged(geometry, images, weights)
    return upload_layers(geometry, is_known, layers)


def is_covered(geometry: Geometry, images: Sequence[UploadedImage]) -> Mask:
    """Pixels of a view whose surfaces at least one image shows, (H, W)."""
    _, is_known = _averaged(geometry, images, [1.0] * len(images))
    return image(is_known, *geometry.shape_index.shape)


def smooth_along(geometry: Geometry, groups: U32, color: Any, variance: Any) -> Layer:
    """Smooth an image along its surfaces by the wavelet filter.

    Parameters
    ----------
    geometry
    groups : (H, W) uint32
        Only pixels of the same group mix.
    color : Array3f
        Image, width * height lanes.
    variance : Float
        Of its luminance.

    Returns
    -------
    color : Array3f
    variance : Float
        Of the result.
    """
    guide = guide_of(geometry, groups)
    return smooth(color, variance, guide, levels=SMOOTHING_LEVELS, deviations=SMOOTHING_DEVIATIONS)


def guide_of(geometry: Geometry, groups: U32) -> Guide:
    """Guide of the wavelet filter; pixels of different groups, (H, W) uint32, never mix."""
    return Guide(
        depths=lanes(geometry.depth),
        normals=lanes(geometry.normal),
        shape_indices=lanes(groups),
        direction_from_pixel=matrix3(geometry.camera.direction_from_pixel),
        width=geometry.camera.width,
        height=geometry.camera.height,
        plane_tolerance=PLANE_TOLERANCE,
        normal_exponent=NORMAL_EXPONENT,
    )


def points_of(geometry: Geometry, depths: Any) -> Any:
    """Points at given depths along the rays through the pixels' centres, world space; Array3f."""
    rays = camera_rays(geometry.camera, pixel_centres(geometry.camera))
    return rays.origin + depths * rays.direction


def _averaged(
    geometry: Geometry, images: Sequence[UploadedImage], weights: Sequence[float]
) -> tuple[list[Layer], Any]:
    """Layers of several images at the surfaces of a view, averaged; and whether any shows them, Bool."""
    # Compute the points, and their footprints in this view.
    camera = geometry.camera
    normal, shape_index = lanes(geometry.normal), lanes(geometry.shape_index)
    position = points_of(geometry, lanes(geometry.depth))
    own = footprint(position, normal, vector3(camera.eye), matrix3(camera.direction_from_pixel))
    layers = range(len(images[0].values))
    totals, variances = [Array3f(0) for _ in layers], [Float(0) for _ in layers]
    weight, valid = Float(0), Float(0)
    dr.eval(position, own)
    for one, given in zip(images, weights, strict=True):
        # Look up the image; coarser ones weigh less, as do all at their borders.
        found = lookup(position, normal, shape_index, one, plane_tolerance=PLANE_TOLERANCE)
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
    is_known = valid > MIN_WEIGHT
    values = [dr.select(is_known, total / weight, 0.0) for total in totals]
    variance = [dr.select(is_known, v / (weight * weight), 0.0) for v in variances]
    dr.eval(values, variance, is_known)
    return list(zip(values, variance, strict=True)), is_known
