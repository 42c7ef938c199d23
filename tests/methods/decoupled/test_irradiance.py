"""Irradiance images: numbers of paths, and disocclusions."""

from dataclasses import replace

import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.kernels.tone import luminance
from enfilade.methods.decoupled import Decoupled, irradiance
from enfilade.methods.decoupled.light_camera import irradiance_camera
from enfilade.methods.decoupled.surface_edges import narrow_surfaces, surface_edges
from support.in_memory import run_passes, walk_of
from support.mitsuba_scene import DIFFUSE, opened, placed, write

SIZE = 64, 48
PATH = CameraPath((Camera(look_at((0.3, 0.3, 4), (0, 0, 0)), 40, *SIZE),), (1,), 24.0)

pytestmark = pytest.mark.slow


def test_narrow_surfaces_have_more_paths(tmp_path, monkeypatch):
    slats = [placed("cube", f"slat{i}", (0.5 * i - 0.8, 0.3, 0.3), DIFFUSE, 0.04) for i in range(4)]
    wall = placed("rectangle", "wall", (0, 0, -1), DIFFUSE, 4)
    renderer = opened(write(tmp_path, *slats, wall))
    walk = walk_of(PATH, renderer, decoupled={"denoiser": "none", "irradiance_spp": 8})

    def run():
        results = run_passes(Decoupled(), walk)
        return results.record("irradiance", 0), results.metadata("irradiance", 0)["rays"]["irradiance"]

    found, rays = run()
    monkeypatch.setattr(irradiance, "NARROW_PATHS", 1)
    plain, plain_rays = run()

    # Narrow surfaces have four times as many paths, which have less noise; all others stay as they are.
    camera = irradiance_camera(PATH.cameras[0])
    geometry = walk_of(replace(PATH, cameras=(camera,)), renderer).view(0).geometry
    narrow = narrow_surfaces(surface_edges(geometry)[0], geometry.has_diffuse)
    assert 20 < narrow.sum() < 500
    assert rays - plain_rays == 3 * 8 * narrow.sum()
    np.testing.assert_array_equal(found.indirect.color[~narrow], plain.indirect.color[~narrow])
    noise, plain_noise = (image.indirect.variance[narrow].mean() for image in (found, plain))
    assert noise < 0.35 * plain_noise


def test_what_comes_into_view_between_two_keyframes_has_no_more_grain_than_keyframes(tmp_path):
    # Between two keyframes that look at the middle of a wall, a frame looks up.
    shapes = (
        placed("rectangle", "wall", (0, 0, -2), DIFFUSE, 6),
        placed("cube", "floor", (0, -8, 0), DIFFUSE, 6),
    )
    results = panned(tmp_path, shapes, 1.5, SIZE)
    strip, keyframe = results.record("disocclusion", 1), results.record("irradiance", 0)

    assert 0.1 < strip.is_known.mean() < 0.4
    assert grain(strip) < 1.5 * grain(keyframe)


def test_a_narrow_strip_that_comes_into_view_has_an_image(tmp_path):
    # Two rows of 480: what the hash grid has in its place shows its entries.
    wall = placed("rectangle", "wall", (0, 0, -2), DIFFUSE, 60)
    strip = panned(tmp_path, [wall], 0.015, (64, 240)).record("disocclusion", 1)
    assert 1e-3 < strip.is_known.mean() < 5e-3


def panned(folder, shapes, up, size):
    """Passes of a shot that looks at a wall, `up` beside its middle in the frame between two keyframes."""
    cameras = tuple(Camera(look_at((0, 0, 4), (0, y, -2)), 40, *size) for y in (0.0, up, 0.0))
    path = CameraPath(cameras, (1, 2, 3), 24.0)
    settings = {"decoupled": {"irradiance_spp": 8}, "keyframes": {"placement": "uniform", "spacing": 2}}
    return run_passes(Decoupled(), walk_of(path, opened(write(folder, *shapes)), **settings))


def grain(image):
    """Mean difference of neighbours in a row, relative to their indirect light."""
    light = luminance(image.indirect.color)
    both = image.is_known[:, 1:] & image.is_known[:, :-1]
    return np.abs(np.diff(light, axis=1))[both].mean() / light[image.is_known].mean()
