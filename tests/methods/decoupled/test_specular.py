"""What lobes scatter: told apart in layers, smoothed along what is seen, averaged along its motion."""

import numpy as np
import pytest

from balls import MATERIALS, front_camera, opened_scene, pane, scattered
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry, positions
from enfilade.methods.decoupled import VirtualImages, open_scattered, over_time, smoothed
from enfilade.methods.decoupled.virtual import BEHIND
from enfilade.records import Shading
from keyframes_analytic import geometry_of
from scenes_analytic import wall


def test_light_in_a_thin_band_is_not_smoothed_away():
    geometry = geometry_of(wall(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45, 32, 24))
    size = geometry.shape_index.shape
    where = np.zeros(size, bool)
    where[11:13] = True
    light = np.random.default_rng(5).gamma(1.0, 1.0, (*size, 1)).astype(np.float32).repeat(3, axis=2)
    band = Shading(light * where[..., None], np.where(where, 1.0, 0.0).astype(np.float32))
    (found,) = smoothed([geometry], [band], where)
    assert found.color[where].std() < 0.5 * light[where].std()
    assert found.color[where].mean() == pytest.approx(light[where].mean(), rel=0.15)


@pytest.mark.parametrize(
    ("panes", "has_reflected", "has_transmitted"),
    [
        ([("front", 0.0, 1.0)], False, True),
        ([("front", 1.0, 0.0)], True, False),
        ([("front", 0.0, 1.0), ("second", 1.0, 0.0)], True, False),
        ([("front", 0.0, 1.0), ("second", 0.0, 1.0)], False, True),
    ],
)
def test_what_panes_let_through_and_what_they_reflect_is_kept_apart(
    tmp_path, panes, has_reflected, has_transmitted
):
    balls = {f"ball {k}": pane(name, 1.0 - 0.01 * k, *shares) for k, (name, *shares) in enumerate(panes)}
    renderer, camera = opened_scene(tmp_path, balls), front_camera()
    seen = find_geometry(renderer, camera)
    is_between = positions(seen)[..., 1] < 0.3  # there the floor between the panes may be seen
    where = ((seen.shape_index == renderer.describe().shapes.index("front") + 1) & ~is_between).ravel()
    reflected, transmitted = (layer.color[where] for layer in scattered(renderer, camera))
    assert (reflected.any(), transmitted.any()) == (has_reflected, has_transmitted)


def test_only_clear_surfaces_let_through(tmp_path):
    renderer, camera = opened_scene(tmp_path, MATERIALS), front_camera()
    seen, (_, transmitted) = find_geometry(renderer, camera), scattered(renderer, camera)
    names = renderer.describe().shapes
    clear = {names[k - 1] for k in np.unique(seen.shape_index.ravel()[transmitted.color.any(axis=1)])}
    assert clear == {"dielectric", "thindielectric", "glowing air"}


def test_total_reflection_inside_glass_belongs_to_what_comes_through(tmp_path):
    cube = (
        '<transform name="to_world"><rotate y="1" angle="45"/><translate y="1.5" z="2"/></transform>'
        '<bsdf type="dielectric"><rgb name="specular_reflectance" value="1"/></bsdf>'
    )
    ball = f'{MATERIALS["diffuse"]}</shape><shape type="cube" id="block">{cube}'
    renderer, camera = opened_scene(tmp_path, {"ball": ball}), front_camera()
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = seen.shape_index == renderer.describe().shapes.index("block") + 1
    reflected, transmitted = (layer.spread(where | True) for layer in scattered(renderer, camera, 64))
    assert where.mean() > 0.1
    # Seen through two faces at a right angle much is reflected by one of them, whole: 4 to 8 % is the rest.
    shares = (layer.color[where].mean() for layer in (reflected, transmitted))
    assert next(shares) < 0.25 * next(shares)
    assert (images.transmitted(seen).shape_index[where] >= BEHIND).all()


@pytest.mark.parametrize("spp", [2, 4, 12])
def test_reflections_that_few_rays_meet_keep_their_light(tmp_path, spp):
    renderer = opened_scene(tmp_path, {"ball": pane("front", 1.0)})
    camera = front_camera(96, 72)
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = np.ones(seen.shape_index.shape, bool)
    layers = [layer.spread(where) for layer in scattered(renderer, camera, spp)]
    found = smoothed([images.reflected(seen), images.transmitted(seen)], layers, where)
    front = seen.shape_index == renderer.describe().shapes.index("front") + 1
    kept, all_of_it = (layer.color[front].mean() for layer in (found[0], layers[0]))
    assert kept == pytest.approx(all_of_it, rel=0.02)


def test_the_sky_in_a_pane_is_smoothed(tmp_path):
    renderer, camera = opened_scene(tmp_path, {"ball": pane("front", 1.0)}), front_camera(96, 72)
    seen, images = find_geometry(renderer, camera), VirtualImages(renderer)
    where = np.ones(seen.shape_index.shape, bool)
    layers = [layer.spread(where) for layer in scattered(renderer, camera, 4)]
    mirrored = images.reflected(seen)
    reflected, _ = smoothed([mirrored, images.transmitted(seen)], layers, where)
    sky = (seen.shape_index == renderer.describe().shapes.index("front") + 1) & (
        mirrored.shape_index == BEHIND
    )
    assert sky.sum() > 200
    assert reflected.color[sky].std() < 0.5 * layers[0].color[sky].std()


def test_what_moves_along_is_averaged(diffuse):
    renderer, _ = diffuse
    rng = np.random.default_rng(4)
    frames = []
    for x in (0.0, 0.05, -0.05):
        geometry = find_geometry(renderer, front_camera(x=x))
        size = geometry.shape_index.shape
        color = rng.normal(1.0, 0.1, (*size, 3)).astype(np.float32)
        frames.append((geometry, Shading(color, np.full(size, 0.01, np.float32)), geometry.is_hit))
    pages = [open_scattered(*frame) for frame in frames]
    averaged = over_time(frames[0][0], pages[0], [(page, 1.0) for page in pages[1:]])
    where = frames[0][2]
    assert averaged[where].std() < 0.75 * frames[0][1].color[where].std()
    assert abs(averaged[where].mean() - 1.0) < 0.01
    assert not averaged[~where].any()
    # What is far from the frame's own value is no noise.
    brighter = [open_scattered(g, Shading(s.color + 5.0, s.variance), w) for g, s, w in frames[1:]]
    kept = over_time(frames[0][0], pages[0], [(page, 1.0) for page in brighter])
    np.testing.assert_allclose(kept[where], frames[0][1].color[where], atol=1e-2)
