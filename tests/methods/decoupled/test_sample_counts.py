"""Numbers of samples: the pilot pass, the quality, and pixels of small emitters."""

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.light_camera import light_camera
from enfilade.methods.decoupled.sample_counts import (
    displayed_deviation,
    displayed_tolerance,
    irradiance_spp,
    is_outline,
    small_emitter_pixels,
    specular_spp,
)
from enfilade.records import Geometry, Shading
from enfilade.renderer import Emitters
from enfilade.settings import DecoupledSettings, Settings

H, W = 20, 30
CAMERA = Camera(look_at((0, 0, 1), (0, 0, 0)), 50.0, W, H)


def geometry_of(shape_index):
    """A G-buffer of shapes at depth 1."""
    zeros = np.zeros((H, W, 3), np.float32)
    depth = (shape_index > 0).astype(np.float32)
    return Geometry(CAMERA, depth, zeros, zeros, shape_index.astype(np.uint32), np.zeros((H, W), np.uint8))


def emitters(pixels, depth, shape_index):
    """Points at the centres of pixels (x, y)."""
    across = np.array([(x + 0.5, y + 0.5, 1.0) for x, y in pixels]).reshape(-1, 3)
    position = CAMERA.eye + depth * (across @ CAMERA.direction_from_pixel.T)
    return Emitters(position.astype(np.float32), np.full(len(pixels), shape_index, np.uint32))


@pytest.mark.parametrize(
    ("jnd", "quality", "keyframes", "spp"),
    [
        (5.0, 1.0, 2, 100),  # 4 (5 / 1)^2
        (10.0, 1.0, 20, 88),  # over 9 accumulated images, of which half are counted: 88.9, to the next 4
        (10.0, 5.0, 2, 16),
        (0.0, 1.0, 2, 8),  # the fewest
        (100.0, 1.0, 2, 256),  # the most
    ],
)
def test_irradiance_spp_falls_with_the_square_of_the_quality(jnd, quality, keyframes, spp):
    assert irradiance_spp(jnd, quality, keyframes) == pytest.approx(spp, abs=4)


def test_specular_rays_and_the_tolerance_of_edges_follow_the_quality_or_the_settings():
    of = [DecoupledSettings(quality=float(q)) for q in (1, 4, 16, 64)]
    assert [specular_spp(s) for s in of] == [17, 8, 4, 2]
    assert specular_spp(DecoupledSettings(specular_spp=3)) == 3
    tolerances = [displayed_tolerance(s.quality) for s in of]
    np.testing.assert_allclose(tolerances, [0.006, 0.012, 0.024, 0.048])


def test_small_emitters_are_found_between_camera_rays():
    geometry = geometry_of(np.ones((H, W)))
    mask = small_emitter_pixels(emitters([(4, 7), (4, 7), (29, 19)], 0.9, shape_index=5), geometry)
    assert sorted(np.argwhere(mask).tolist()) == [[7, 4], [19, 29]]
    sky = geometry_of(np.zeros((H, W)))
    assert small_emitter_pixels(emitters([(4, 7)], 50.0, shape_index=5), sky).sum() == 1
    assert not small_emitter_pixels(emitters([], 50.0, shape_index=5), sky).any()


def test_occluded_emitters_and_the_interior_of_large_ones_are_left_out():
    shape_index = np.ones((H, W))
    shape_index[5:15, 3:13] = 2
    geometry = geometry_of(shape_index)
    for pixels, depth in (([(4, 7)], 1.2), ([(4, 7)], -0.9), ([(-1, 7), (4, 20), (30, 7)], 0.9)):
        assert not small_emitter_pixels(emitters(pixels, depth, shape_index=5), geometry).any()
    large = [(x, y) for x in range(3, 13) for y in range(5, 15)]
    outline = np.zeros((H, W), bool)
    outline[5:15, 3:13] = True
    outline[6:14, 4:12] = False
    found = small_emitter_pixels(emitters(large, 1.0, shape_index=2), geometry)
    np.testing.assert_array_equal(found, outline)


def test_tasks_of_long_shots_cost_less_than_those_of_an_excerpt():
    excerpt, whole = {"irradiance": 2, "pilot": 1}, {"irradiance": 60, "pilot": 2}
    ratios = Decoupled().cost_ratios(Settings(), 320 * 180, excerpt, whole)
    expected = irradiance_spp(56.0, 10.0, 30) / irradiance_spp(56.0, 10.0, 2)
    same = dict.fromkeys(("prepass", "hash_grid", "pilot"), 1.0)
    assert ratios == pytest.approx(same | {"irradiance": expected, "disocclusion": expected}, rel=0.05)
    fixed = Settings().replace(DecoupledSettings, irradiance_spp=16)
    assert set(Decoupled().cost_ratios(fixed, 320 * 180, excerpt, whole).values()) == {1.0}


def test_light_of_large_frames_has_fewer_pixels():
    def size(width, height):
        camera = light_camera(Camera(np.eye(4), 60.0, width, height))
        return camera.width, camera.height

    assert size(320, 180) == (320, 180)
    assert size(1280, 720) == size(1920, 1080) == size(3840, 2160) == (640, 360)
    assert size(2, 1_000_000) == (1, 333_333)  # never without pixels
    excerpt = {"irradiance": 2, "pilot": 1}
    ratios = Decoupled().cost_ratios(Settings(), 3840 * 2160, excerpt, excerpt)
    assert set(ratios.values()) == {1.0 / 36.0}


def test_outlines_are_pixels_beside_another_shape():
    index = np.ones((H, W), np.uint32)
    index[5, 7] = 2
    rows, columns = np.nonzero(is_outline(geometry_of(index)))
    assert set(zip(rows, columns, strict=True)) == {(5, 7), (4, 7), (6, 7), (5, 6), (5, 8)}


def test_what_is_clipped_at_white_is_not_uncertain():
    grey = np.repeat(np.array([[0.2], [0.2], [50.0], [1.1], [1.1]], np.float32), 3, axis=1)
    deviation = np.array([0.0, 0.02, 5.0, 0.05, 0.5], np.float32)
    found = displayed_deviation(Shading(grey, deviation**2), 0.0)
    assert found[[0, 2, 3]].tolist() == [0.0, 0.0, 0.0]
    # sRGB of 0.22 and of 0.18; of 0.6 and of white
    np.testing.assert_allclose(found[[1, 4]], [(0.5064 - 0.4614) / 2.0, (1.0 - 0.7977) / 2.0], atol=1e-3)
    darker = displayed_deviation(Shading(grey, deviation**2), -1.0)
    assert darker[3] > 0.01
