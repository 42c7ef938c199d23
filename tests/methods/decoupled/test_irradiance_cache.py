"""Irradiance images: what is denoised stays as it is, and hidden points beside visible ones are not shown."""

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, UInt, image, opaque
from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled.irradiance_cache import accumulate, reproject_to, upload
from enfilade.methods.decoupled.records import IrradianceImage
from enfilade.records import Geometry, Shading
from support.integrated import cache_of_uploaded

H, W = 16, 24
SPOT = 8, 12  # row, column of a bright pixel


def wall_with_a_bright_pixel(deviation):
    camera = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, W, H)
    normal = np.broadcast_to(np.float32((0, 0, 1)), (H, W, 3)).copy()
    ones = np.ones((H, W))
    geometry = Geometry(
        camera, ones.astype(np.float32), normal, normal, ones.astype(np.uint32), np.zeros((H, W), np.uint8)
    )
    color = np.ones((H, W, 3), np.float32)
    color[SPOT] = 20.0
    dark = Shading(np.zeros((H, W, 3), np.float32), np.zeros((H, W), np.float32))
    light = Shading(color, np.full((H, W), deviation, np.float32))
    return geometry, IrradianceImage(dark, light, ones.astype(bool))


@pytest.mark.parametrize(("deviation", "is_kept"), [(0.0, True), (1.0, False)])
def test_a_bright_pixel_of_a_denoised_image_is_no_firefly(deviation, is_kept):
    geometry, irradiance = wall_with_a_bright_pixel(deviation)
    uploaded = upload(geometry, irradiance)
    found = image(accumulate(geometry, irradiance.is_known, [uploaded]).values[0], H, W)
    assert (found[SPOT][0] == pytest.approx(20.0, rel=0.01)) == is_kept


@pytest.mark.parametrize("deviation", [0.0, 1.0])
def test_only_variances_that_are_read_are_stored(deviation):
    geometry, irradiance = wall_with_a_bright_pixel(deviation)
    uploaded = upload(geometry, irradiance)
    averaged = accumulate(geometry, irradiance.is_known, [uploaded])
    reprojected = reproject_to(geometry, [averaged], [1.0])
    lanes = [[dr.width(v) for v in of.variances] for of in (uploaded, averaged, reprojected)]
    assert lanes == [[1, H * W if deviation else 1], [1], [1]]
    np.testing.assert_allclose(np.array(reprojected.values[0]), np.array(averaged.values[0]), rtol=0.1)


@pytest.mark.parametrize(("min_coverage", "reach"), [(0.02, 0.97), (0.5, 0.5), (0.9, 0.1)])
def test_points_beyond_the_visible_part_of_a_surface_are_found_up_to_the_least_weight(min_coverage, reach):
    # The right half of the wall is hidden; `reach` is in pixels from the centre of the last visible one.
    geometry, irradiance = wall_with_a_bright_pixel(0.0)
    irradiance.is_known[:, W // 2 :] = False
    uploaded = upload(geometry, irradiance)
    blank = upload(geometry, replace(irradiance, is_known=np.zeros((H, W), bool)))
    last = W // 2 - 0.5
    x = last + np.array([-3.0, -0.2, reach - 0.05, reach + 0.05, 2.0])
    pixels = np.stack([x, np.full(5, 3.5), np.ones(5)])
    points = geometry.camera.eye[:, None] + geometry.camera.direction_from_pixel @ pixels
    at = Array3f(points.astype(np.float32)), Array3f(0, 0, 1), UInt(1)
    cache = cache_of_uploaded([uploaded, blank], view=uploaded, min_coverage=opaque(min_coverage))
    for found, is_found in (cache.lookup(*at), cache.lookup_in_view(*at)):
        assert np.array(is_found).tolist() == [True, True, True, False, False]
        np.testing.assert_allclose(np.array(found)[0], [1, 1, 1, 0, 0], rtol=1e-5)
