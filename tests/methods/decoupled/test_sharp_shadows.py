"""Shadows of sharp emitters: penumbrae lose their noise, all other light stays as it is."""

import numpy as np
import pytest

from enfilade.camera.path import CameraPath
from enfilade.camera.pinhole import Camera, look_at
from enfilade.kernels.tone import luminance
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.reconstruction import smoothed
from enfilade.methods.decoupled.sharp_shadows import smooth_shadows
from enfilade.records import Shading
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from support.analytic_truth import geometry_of
from support.example_scenes import wall
from support.in_memory import run_passes, walk_of
from support.mitsuba_scene import write

SPP = 4
FILTERED = np.float32(0.32)  # of the variance, by the filter of pixels
HEIGHT, WIDTH = 90, 160
GEOMETRY = geometry_of(wall(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45, WIDTH, HEIGHT))
GRAIN = np.random.default_rng(7).uniform(0.5, 1.5, (HEIGHT, WIDTH, 1)).astype(np.float32)  # as of a bump map
COLUMN = np.arange(WIDTH, dtype=np.float32)
INNER = np.s_[3:-3, 3:-3]


def shadow(width):
    """Visibility, from 0 to 1 over some pixels, of each row, (H, W, 1)."""
    return np.tile(np.clip((COLUMN - 79.5) / width + 0.5, 0.0, 1.0)[:, None], (HEIGHT, 1, 1))


def found(visibility, light):
    """Change of the radiance, divided by the albedo, and what it is added to."""
    # Stratified samples of the emitters.
    rng = np.random.default_rng(3)
    share = np.floor(SPP * visibility + rng.uniform(0.0, 1.0, visibility.shape)) / SPP
    share = np.minimum(share, 1.0).astype(np.float32)
    unfiltered = share * light
    irradiance = smoothed(unfiltered)
    variance = FILTERED * np.square(luminance(light)) * (share * (1.0 - share))[..., 0] / (SPP - 1)
    change = smooth_shadows(GEOMETRY, Shading(irradiance, variance), unfiltered, light, quality="balanced")
    return change / GEOMETRY.albedo, irradiance


@pytest.mark.parametrize("grain", [0.0, 1.0])
def test_penumbrae_lose_their_noise_but_not_the_contrast_of_bump_maps(grain):
    visibility = shadow(60.0)
    light = (1.0 + grain * (GRAIN - 1.0)) * np.float32([2.0, 1.0, 0.5])
    change, before = found(visibility, light)
    truth = smoothed((visibility * light).astype(np.float32))
    within = np.s_[3:-3, 55:105]
    noise, left = ((of - truth)[within].std() for of in (before, before + change))
    assert left < 0.3 * noise
    assert (before + change)[within].mean() == pytest.approx(truth[within].mean(), rel=0.02)


@pytest.mark.parametrize("visibility", [0.0, 1.0])
def test_light_without_shadows_stays(visibility):
    change, _ = found(np.full((HEIGHT, WIDTH, 1), visibility), GRAIN * np.float32([2.0, 1.0, 0.5]))
    assert not change.any()


def test_sharp_edges_of_shadows_stay():
    visibility = shadow(1e-3)
    light = np.ones((HEIGHT, WIDTH, 3), np.float32)
    change, before = found(visibility, light)
    truth = smoothed((visibility * light).astype(np.float32))
    assert np.abs(before + change - truth)[INNER].max() < 0.1
    assert not change[:, np.abs(COLUMN - 79.5) > 3].any()


def test_a_channel_without_light_stays_dark():
    change, before = found(
        shadow(60.0), np.ones((HEIGHT, WIDTH, 1), np.float32) * np.float32([1.0, 0.5, 0.0])
    )
    assert np.isfinite(change).all()
    assert change[..., :2].any()
    assert not (before + change)[..., 2].any()


LAMP = """<shape type="sphere"><float name="radius" value="{0}"/><point name="center" x="0" y="0" z="4"/>
<emitter type="area"><rgb name="radiance" value="{1}"/></emitter></shape>"""
SCREEN = """<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><translate x="0.5" z="2"/>
</transform></shape>"""
FLOOR = """<shape type="rectangle"><transform name="to_world"><scale value="4"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>"""


@pytest.mark.parametrize(("radius", "most"), [(0.15, 0.6), (0.01, 1.1)])
def test_penumbrae_have_less_noise_and_sharp_shadows_are_not_blurred(tmp_path, radius, most):
    lamp = LAMP.format(radius, 2.25 / radius**2)
    renderer = MitsubaRenderer(write(tmp_path, lamp, SCREEN, FLOOR, sky=""))
    views = (look_at((x, -2.5, 1.5), (x, 0.0, 0.0), up=(0, 0, 1)) for x in (0.0, 0.02))
    path = CameraPath(tuple(Camera(view, 50.0, 240, 160) for view in views), (1, 2), 24.0)
    pixels, key = np.arange(240 * 160, dtype=np.uint32), RandomKey(5, 0, Purpose.REFERENCE)
    reference = renderer.trace(path.cameras[0], pixels, key, spp=512, pixel_filter=PixelFilter.GAUSSIAN)
    truth = reference.color.reshape(160, 240, 3)
    errors = {}
    for denoiser in ("none", "balanced"):
        tables = {"decoupled": {"denoiser": denoiser, "quality": 60.0}, "viewing": {"exposure_ev": 2.0}}
        frame = run_passes(Decoupled(), walk_of(path, renderer, **tables)).colors[0]
        errors[denoiser] = (frame - truth)[INNER].std()
    assert errors["balanced"] < most * errors["none"]
