"""Numbers of samples by quality, and their part in forecasts."""

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.light_camera import hash_grid_camera, irradiance_camera
from enfilade.methods.decoupled.sample_counts import irradiance_spp, specular_spp
from enfilade.settings import DecoupledSettings, Settings


SMALL = 320 * 180  # pixels


@pytest.mark.parametrize(
    ("quality", "keyframes", "spp"),
    [
        (1.0, 2, 380),
        (4.0, 2, 192),
        (4.0, 4, 96),  # of four images that are averaged, half are counted
        (1.0, 20, 84),  # of nine
        (100.0, 20, 8),
        (0.5, 1, 512),  # the most
    ],
)
def test_irradiance_spp_follows_the_quality_and_the_averaged_images(quality, keyframes, spp):
    assert irradiance_spp(DecoupledSettings(quality=quality), keyframes, SMALL) == spp


def test_specular_rays_follow_the_quality_or_the_settings():
    of = [DecoupledSettings(quality=float(q)) for q in (1, 4, 16, 64)]
    assert [specular_spp(s) for s in of] == [34, 17, 8, 4]
    assert specular_spp(DecoupledSettings(specular_spp=3)) == 3


def test_tasks_of_long_shots_cost_less_than_those_of_an_excerpt():
    excerpt, whole = {"irradiance": 2}, {"irradiance": 60}
    ratios = Decoupled().cost_ratios(Settings(), SMALL, excerpt, whole, shots=2)
    settings = DecoupledSettings()
    expected = irradiance_spp(settings, 30, SMALL) / irradiance_spp(settings, 2, SMALL)
    same = dict.fromkeys(("prepass", "hash_grid"), 1.0)
    assert expected < 0.3
    assert ratios == pytest.approx(same | {"irradiance": expected, "disocclusion": expected})
    fixed = Settings().replace(DecoupledSettings, irradiance_spp=16)
    assert set(Decoupled().cost_ratios(fixed, SMALL, excerpt, whole, shots=2).values()) == {1.0}


def test_light_of_large_frames_has_fewer_pixels():
    def size(reduced, width, height):
        camera = reduced(Camera(np.eye(4), 60.0, width, height))
        return camera.width, camera.height

    assert size(hash_grid_camera, 320, 180) == size(irradiance_camera, 320, 180) == (320, 180)
    assert {size(hash_grid_camera, 16 * k, 9 * k) for k in (80, 120, 240)} == {(640, 360)}
    assert size(irradiance_camera, 1280, 720) == size(irradiance_camera, 3840, 2160) == (1280, 720)
    assert size(irradiance_camera, 1920, 1080) == (960, 540)
    assert size(hash_grid_camera, 2, 1_000_000) == (1, 333_333)  # never without pixels


def test_irradiance_of_large_frames_has_as_many_paths_in_all():
    settings, pixels = DecoupledSettings(quality=1.0), 1280 * 720
    assert irradiance_spp(settings, 2, pixels) == 96  # 380 in small images
    assert irradiance_spp(DecoupledSettings(quality=100.0), 20, pixels) == 4  # the fewest
    excerpt = {"irradiance": 2}
    ratios = Decoupled().cost_ratios(Settings(), 3840 * 2160, excerpt, excerpt, shots=1)
    assert ratios == pytest.approx(dict.fromkeys(ratios, 1.0 / 36.0), rel=0.1)
