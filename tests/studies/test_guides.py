"""Guides of the denoiser: noise-free, box filtered, of the first surface or behind mirrors."""

import numpy as np
import pytest

from enfilade.arrays import lanes, rows
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.kernels.random import one_sequence
from enfilade.kernels.rays import camera_rays, pixel_centres
from enfilade.renderer import Branch
from enfilade.scene.opener import Scene
from enfilade.settings import Settings
from studies.bench.guides import Guides
from support.analytic import AnalyticRenderer
from support.example_scenes import room, room_walk

PATHS_IN_FLIGHT = 1 << 20
MIRROR = """<scene version="3.0.0">
<shape type="rectangle" id="mirror">
  <transform name="to_world"><scale value="2"/></transform>
  <bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf>
</shape>
<shape type="rectangle" id="wall">
  <transform name="to_world"><scale value="9"/><rotate x="1" angle="180"/><translate z="6"/></transform>
  <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.2, 0.1"/></bsdf></bsdf>
</shape>
<emitter type="constant"/>
</scene>"""


def test_inside_of_surfaces_they_are_those_of_the_g_buffer():
    renderer, camera = AnalyticRenderer(room()), room_walk(1).cameras[0]
    albedo, normal = Guides(renderer).images(camera, seed=0, frame=1, paths_in_flight=PATHS_IN_FLIGHT)
    seen = find_geometry(renderer, camera)
    inner = np.zeros(seen.shape_index.shape, bool)
    same = seen.shape_index[1:-1, 1:-1]
    shifts = ((1, 0), (-1, 0), (0, 1), (0, -1))
    around = [np.roll(seen.shape_index, shift, (0, 1))[1:-1, 1:-1] for shift in shifts]
    inner[1:-1, 1:-1] = np.all([same == other for other in around], axis=0)
    is_flat = inner & (seen.shape_index != 6)  # the ball's normal changes within a pixel
    assert np.abs(normal - seen.normal)[is_flat].max() < 1e-4
    assert np.median(np.abs(albedo - seen.albedo)[inner]) < 0.01
    # Neither batches nor anything but the seed change them.
    again = Guides(renderer).images(camera, seed=0, frame=1, paths_in_flight=5000)
    np.testing.assert_array_equal(albedo, again[0])
    np.testing.assert_array_equal(normal, again[1])


@pytest.mark.parametrize(
    ("is_followed", "reflectance", "facing"), [(True, [0.7, 0.2, 0.1], -1.0), (False, [0.0, 0.0, 0.0], 1.0)]
)
@pytest.mark.parametrize("frame", [1, 2])
def test_a_mirror_shows_the_reflected_surface_to_rays_that_continue(
    tmp_path, frame, is_followed, reflectance, facing
):
    file = tmp_path / "mirror.xml"
    file.write_text(MIRROR)
    renderer = Scene(file).open(Settings())
    camera = Camera(look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)), 30.0, 32, 24)
    albedo, normal = Guides(renderer).images(
        camera, seed=0, frame=frame, paths_in_flight=PATHS_IN_FLIGHT, is_followed=is_followed
    )
    for pick in (np.min, np.max):
        assert pick(albedo.reshape(-1, 3), axis=0) == pytest.approx(reflectance, abs=1e-3)
    assert np.abs(normal[..., 2] - facing).max() < 1e-4  # the wall's, which faces the mirror, or the mirror's


def test_along_single_rays_guides_follow_one_branch_of_glass(tmp_path):
    """Without noise: by chance some rays would be reflected, into the sky."""
    file = tmp_path / "pane.xml"
    glass = '<bsdf type="thindielectric"/>'
    conductor = '<bsdf type="conductor"><string name="material" value="none"/></bsdf>'
    behind = MIRROR.replace('<rotate x="1" angle="180"/><translate z="6"/>', '<translate z="-6"/>')
    file.write_text(behind.replace(f'<bsdf type="twosided">{conductor}</bsdf>', glass))
    renderer = Scene(file).open(Settings())
    camera = Camera(look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)), 30.0, 32, 24)
    pixels = np.arange(32 * 24, dtype=np.uint32)
    rays = camera_rays(camera, pixel_centres(camera, lanes(pixels)))
    found = {}
    for branch in (Branch.TRANSMITTED, None):
        guides = Guides(renderer, branch).along(rays, one_sequence(len(pixels)), is_followed=True)
        found[branch] = [rows(of)[: len(pixels)] for of in guides]
    albedo, normal = found[Branch.TRANSMITTED]
    assert np.ptp(albedo, axis=0).max() < 0.01
    assert 0.5 < albedo[:, 0].min() < 0.7
    np.testing.assert_allclose(normal, [[0.0, 0.0, 1.0]] * len(pixels), atol=1e-5)
    assert np.ptp(found[None][0], axis=0).max() > 0.3
