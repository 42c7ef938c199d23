"""Specular AOVs: reflection and transmission, the spatial filter, the temporal accumulation."""

import numpy as np
import pytest
from scipy.ndimage import minimum_filter

from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry, positions
from enfilade.methods.decoupled.records import SpecularAov
from enfilade.methods.decoupled.specular import accumulate_temporally, filter_spatially, upload_aov
from enfilade.methods.decoupled.virtual_images import IN_VIRTUAL_IMAGE, VirtualImages
from enfilade.records import Shading
from support.analytic_truth import geometry_of
from support.example_scenes import wall
from support.material_scene import MATERIALS, front_camera, opened_scene, pane, specular_aovs


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
    (found,) = filter_spatially([geometry], [band], where, is_denoised=denoiser != "none")
    assert found.color[where].std() < 0.5 * light[where].std()
    assert found.color[where].mean() == pytest.approx(light[where].mean(), rel=0.15)


@pytest.mark.parametrize(
    ("panes", "has_reflection", "has_transmission"),
    [
        ([("front", 0.0, 1.0), ("second", 1.0, 0.0)], True, False),
        ([("front", 0.0, 1.0), ("second", 0.0, 1.0)], False, True),
    ],
)
def test_reflection_and_transmission_of_panes_are_separate_aovs(
    tmp_path, panes, has_reflection, has_transmission
):
    balls = {f"ball {k}": pane(name, 1.0 - 0.01 * k, *shares) for k, (name, *shares) in enumerate(panes)}
    renderer, camera = opened_scene(tmp_path, balls), front_camera()
    seen = find_geometry(renderer, camera)
    is_between = positions(seen)[..., 1] < 0.3  # where the floor between the panes may be visible
    where = ((seen.shape_index == renderer.describe().shapes.index("front") + 1) & ~is_between).ravel()
    reflected, transmitted = (aov.color[where] for aov in specular_aovs(renderer, camera))
    assert (reflected.any(), transmitted.any()) == (has_reflection, has_transmission)


def test_total_internal_reflection_is_transmission(tmp_path):
    cube = (
        '<transform name="to_world"><rotate y="1" angle="45"/><translate y="1.5" z="2"/></transform>'
        '<bsdf type="dielectric"><rgb name="specular_reflectance" value="1"/></bsdf>'
    )
    ball = f'{MATERIALS["diffuse"]}</shape><shape type="cube" id="block">{cube}'
    renderer, camera = opened_scene(tmp_path, {"ball": ball}), front_camera()
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = seen.shape_index == renderer.describe().shapes.index("block") + 1
    reflected, transmitted = (aov.to_image(where | True) for aov in specular_aovs(renderer, camera, 64))
    assert where.mean() > 0.1
    # Much of the transmission is reflected totally by the second face. Fresnel reflection is 4 to 8 %.
    shares = (aov.color[where].mean() for aov in (reflected, transmitted))
    assert next(shares) < 0.25 * next(shares)
    assert (images.find(seen)[1].shape_index[where] >= IN_VIRTUAL_IMAGE).all()


@pytest.mark.parametrize("denoiser", ["none", "balanced"])
@pytest.mark.parametrize("spp", [2, 4, 12])
def test_reflections_in_a_pane_have_no_noise_and_keep_their_energy(pane_scene, spp, denoiser):
    renderer, camera, seen, virtual = pane_scene
    where = np.ones(seen.shape_index.shape, bool)
    aovs = [aov.to_image(where) for aov in specular_aovs(renderer, camera, spp)]
    reflection, _ = filter_spatially(virtual, aovs, where, is_denoised=denoiser != "none")
    front = seen.shape_index == renderer.describe().shapes.index("front") + 1
    filtered, unfiltered = (aov.color[front].mean(dtype=float) for aov in (reflection, aovs[0]))
    assert filtered == pytest.approx(unfiltered, rel=0.02)
    # The sky in the pane is one surface. Both branches of the pane are followed: nothing is left to chance.
    sky = front & (virtual[0].shape_index == IN_VIRTUAL_IMAGE)
    interior = minimum_filter(sky, 5)
    assert interior.sum() > 200
    color = aovs[0].color[interior]
    assert color.std(dtype=float) < 0.01 * color.mean(dtype=float)  # the Fresnel reflectance changes


def test_accumulation_averages_noise_and_keeps_differences(tmp_path):
    renderer = opened_scene(tmp_path, dict.fromkeys(("one", "two"), MATERIALS["diffuse"]))
    rng = np.random.default_rng(4)
    geometries = [find_geometry(renderer, front_camera(x=x)) for x in (0.0, 0.05, -0.05)]
    size = geometries[0].shape_index.shape
    colors = [rng.normal(1.0, 0.1, (*size, 3)).astype(np.float16) for _ in geometries]

    def accumulated(offset):
        aovs = [
            SpecularAov(color + np.float16(offset if k else 0.0), np.full(size, 0.1, np.float16))
            for k, color in enumerate(colors)
        ]
        here, *others = (upload_aov(g, aov, g.is_hit) for g, aov in zip(geometries, aovs, strict=True))
        return accumulate_temporally(geometries[0], here, [(other, 1.0) for other in others])

    where = geometries[0].is_hit
    averaged = accumulated(0.0)
    assert averaged[where].std() < 0.75 * colors[0][where].std(dtype=float)
    assert abs(averaged[where].mean() - 1.0) < 0.01
    assert not averaged[~where].any()
    # Differences of many standard deviations are not noise.
    np.testing.assert_allclose(accumulated(5.0)[where], colors[0][where], atol=1e-2)
