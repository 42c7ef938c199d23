"""The spatial filter of specular AOVs: less noise, the same energy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import minimum_filter

from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.methods.decoupled.specular_filter import DENOISED_SHARE, filter_spatially
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE, VirtualImages
from enfilade.records import Shading, SurfaceClass
from support.analytic_truth import geometry_of
from support.example_scenes import wall
from support.material_scene import front_camera, opened_scene, pane, specular_aovs


@pytest.fixture(scope="module")
def pane_scene(tmp_path_factory):
    """A pane: renderer, camera, G-buffer, and the G-buffers with virtual images of both AOVs."""
    renderer = opened_scene(tmp_path_factory.mktemp("pane"), {"ball": pane("front", 1.0)})
    camera = front_camera(96, 72)
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    return renderer, camera, seen, images.find(seen)


@pytest.mark.parametrize("denoiser", ["none", "balanced"])
def test_thin_regions_are_smoothed_and_keep_their_energy(denoiser):
    geometry = geometry_of(wall(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45, 32, 24))
    size = geometry.shape_index.shape
    where = np.zeros(size, bool)
    where[11:13] = True
    light = np.random.default_rng(5).gamma(1.0, 1.0, (*size, 1)).astype(np.float32).repeat(3, axis=2)
    band = Shading(light * where[..., None], np.where(where, 1.0, 0.0).astype(np.float32))
    (found,) = filter_spatially([geometry], [band], where, is_denoised=denoiser != "none", unit=1.0)
    assert found.color[where].std() < 0.5 * light[where].std()
    assert found.color[where].mean() == pytest.approx(light[where].mean(), rel=0.15)


@pytest.mark.parametrize("beside", [SurfaceClass.DIFFUSE, SurfaceClass.GLOSSY])
def test_panes_do_not_lose_light_to_the_pixels_beside_them(beside):
    """Those next to a pane are sampled, too. The last row of the pane lost a third of its light to them."""
    geometry = geometry_of(wall(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45, 160, 60))
    is_pane = (np.arange(60)[:, None] < 30).repeat(160, axis=1)
    surface = np.where(is_pane, SurfaceClass.TRANSPARENT, beside).astype(np.uint8)
    within = np.where(is_pane, IN_VIRTUAL_IMAGE + 1, geometry.shape_index).astype(np.uint32)
    virtual = [replace(geometry, surface=surface, shape_index=within)] * 2
    where = np.ones(is_pane.shape, bool)
    if beside == SurfaceClass.DIFFUSE:
        where[31:] = False
    noise = np.random.default_rng(5).gamma(1.0, 1.0, is_pane.shape).astype(np.float32) * is_pane
    aov = Shading(noise[..., None].repeat(3, axis=2), is_pane.astype(np.float32))
    transmission = filter_spatially(virtual, [aov, aov], where, is_denoised=True, unit=1.0)[1]
    rows = transmission.color.mean(axis=(1, 2), dtype=float)
    np.testing.assert_allclose(rows[20:30], noise[20:30].mean(), rtol=0.15)
    assert not rows[30:].any()
    np.testing.assert_allclose(transmission.deviation[:30], DENOISED_SHARE, rtol=2e-3)


def test_deviations_are_the_same_at_the_border_of_the_sampled_pixels():
    geometry = geometry_of(wall(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45, 32, 24))
    where = np.zeros(geometry.shape_index.shape, bool)
    where[6:18, 4:20] = True
    grey = np.where(where[..., None], np.float32([0.5, 0.5, 0.5]), np.float32(0))
    aov = Shading(grey, np.where(where, np.float32(0.04), np.float32(0)))
    (found,) = filter_spatially([geometry], [aov], where, is_denoised=True, unit=1.0)
    np.testing.assert_allclose(found.deviation[where], DENOISED_SHARE * 0.2, rtol=2e-3)


@pytest.mark.parametrize("denoiser", ["none", "balanced"])
@pytest.mark.parametrize("spp", [2, 4, 12])
def test_reflections_in_a_pane_have_no_noise_and_keep_their_energy(pane_scene, spp, denoiser):
    renderer, camera, seen, virtual = pane_scene
    where = np.ones(seen.shape_index.shape, bool)
    aovs = [aov.to_image(where) for aov in specular_aovs(renderer, camera, spp)]
    reflection, _ = filter_spatially(virtual, aovs, where, is_denoised=denoiser != "none", unit=1.0)
    front = seen.shape_index == renderer.describe().shapes.index("front") + 1
    filtered, unfiltered = (aov.color[front].mean(dtype=float) for aov in (reflection, aovs[0]))
    assert filtered == pytest.approx(unfiltered, rel=0.02)
    # The sky in the pane is one surface. Both branches of the pane are followed: nothing is left to chance.
    sky = front & (virtual[0].shape_index == IN_VIRTUAL_IMAGE)
    interior = minimum_filter(sky, 5)
    assert interior.sum() > 200
    color = aovs[0].color[interior]
    assert color.std(dtype=float) < 0.01 * color.mean(dtype=float)  # the Fresnel reflectance changes
