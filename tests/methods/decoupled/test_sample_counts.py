"""Numbers of samples by quality, and their part in forecasts."""

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.light_camera import irradiance_camera, light_camera, virtual_camera
from enfilade.methods.decoupled.sample_counts import irradiance_spp, specular_spp
from enfilade.settings import DecoupledSettings, Settings


@pytest.mark.parametrize(
    ("quality", "keyframes", "spp"),
    [
        (1.0, 2, 95),
        (4.0, 2, 48),
        (4.0, 4, 24),  # of four images that are averaged, half are counted
        (1.0, 20, 21),  # of nine
        (100.0, 20, 4),  # the fewest
    ],
)
def test_irradiance_spp_follows_the_quality_and_the_averaged_images(quality, keyframes, spp):
    assert irradiance_spp(DecoupledSettings(quality=quality), keyframes) == spp


def test_specular_rays_follow_the_quality_or_the_settings():
    of = [DecoupledSettings(quality=float(q)) for q in (1, 4, 16, 64)]
    assert [specular_spp(s, 7) for s in of] == [34, 17, 8, 4]
    assert specular_spp(DecoupledSettings(specular_spp=3), 1) == 3


def test_short_shots_have_more_specular_rays():
    settings = DecoupledSettings(quality=4.0)
    assert [specular_spp(settings, frames) for frames in (1, 2, 3, 4, 7, 100)] == [51, 51, 40, 30, 17, 17]


def test_tasks_of_long_shots_cost_less_than_those_of_an_excerpt():
    excerpt, whole = {"irradiance": 2, "shading": 4}, {"irradiance": 60, "shading": 480}
    ratios = Decoupled().cost_ratios(Settings(), 320 * 180, excerpt, whole, shots=2)
    settings = DecoupledSettings()
    expected = irradiance_spp(settings, 30) / irradiance_spp(settings, 2)
    same = dict.fromkeys(("prepass", "hash_grid", "virtual_images"), 1.0)
    same["shading"] = 0.5 + 0.5 * specular_spp(settings, 240) / specular_spp(settings, 4)
    assert expected < 0.3
    assert ratios == pytest.approx(same | {"irradiance": expected, "disocclusion": expected})
    fixed = Settings().replace(DecoupledSettings, irradiance_spp=16, specular_spp=8)
    assert set(Decoupled().cost_ratios(fixed, 320 * 180, excerpt, whole, shots=2).values()) == {1.0}


def test_light_of_large_frames_has_fewer_pixels():
    def size(width, height, camera_of=light_camera):
        camera = camera_of(Camera(np.eye(4), 60.0, width, height))
        return camera.width, camera.height

    assert size(320, 180) == (320, 180)
    assert size(1280, 720) == size(1920, 1080) == size(3840, 2160) == (640, 360)
    assert size(4096, 2160) == size(2048, 1080) == (683, 360)  # the outermost columns are in view
    assert size(2, 1_000_000) == (1, 333_333)  # never without pixels
    assert size(320, 180, irradiance_camera) == (640, 360)
    assert size(320, 180, virtual_camera) == (320, 180)
    assert size(1280, 720, virtual_camera) == size(3840, 2160, virtual_camera) == (1280, 720)
    assert size(1280, 720, irradiance_camera) == size(3840, 2160, irradiance_camera) == (1280, 720)
    excerpt = {"irradiance": 2, "shading": 4}
    ratios = dict(Decoupled().cost_ratios(Settings(), 3840 * 2160, excerpt, excerpt, shots=1))
    assert ratios.pop("shading") == 1.0
    assert set(ratios.values()) == {1.0 / 36.0}
