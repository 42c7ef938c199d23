from __future__ import annotations

import math

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f, image, matrix3, pixel_grid, vector3
from enfilade.camera.pinhole import Camera, look_at
from enfilade.errors import SceneError
from enfilade.kernels.rays import pinhole_directions
from enfilade.records import SurfaceClass
from enfilade.renderer import PixelFilter, Purpose, RandomKey, Rays
from enfilade.scene.analytic import AnalyticRenderer, load
from enfilade.scene.analytic_scene import (
    AnalyticScene,
    Checker,
    Material,
    Plane,
    Quad,
    Sphere,
    read_scene,
    scene_text,
)
from scenes_analytic import ball, room, room_walk, slide, wall

# A ray's direction, its products and quotients are each rounded to 24 bits: a handful of 6e-8.
ROUNDING = 1e-6


def rays(camera):
    _, column, row = pixel_grid(camera.height, camera.width)
    direction = pinhole_directions(
        column + 0.5, row + 0.5, direction_from_pixel=matrix3(camera.direction_from_pixel)
    )
    return Rays(vector3(camera.eye), direction)


def directions(camera):
    """World directions of unit depth through pixel centres, (H, W, 3) float64."""
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    return np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.direction_from_pixel.T


def one_ray(scene, origin, direction):
    return AnalyticRenderer(scene).surfaces(
        Rays(Array3f(*map(float, origin)), Array3f(*map(float, direction)))
    )


def traced(
    scene,
    camera,
    pixels=None,
    *,
    chunk=1 << 20,
    spp=4,
    seed=7,
    frame=3,
    purpose=Purpose.FILL,
    at=PixelFilter.CENTRE,
):
    if pixels is None:
        pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    return AnalyticRenderer(scene, chunk=chunk).trace(
        camera, pixels, RandomKey(seed, frame, purpose), spp=spp, pixel_filter=at
    )


def test_a_plane_across_the_view_has_one_depth():
    camera = slide(1).cameras[0]
    found = AnalyticRenderer(wall()).surfaces(rays(camera))
    depth = image(found.distance, camera.height, camera.width)
    np.testing.assert_allclose(depth, 4.0, rtol=ROUNDING)
    np.testing.assert_array_equal(
        image(found.normal, camera.height, camera.width), np.full((48, 64, 3), (0, 0, 1))
    )
    assert np.array(found.shape_index).tolist() == [1] * (64 * 48)


def test_a_tilted_plane_has_its_closed_form():
    camera = Camera(look_at((1, 2, 3), (0, 0.2, 0), (0, 1, 0)), 60.0, 40, 30)
    normal = np.array([0.2, 1.0, -0.1])
    found = AnalyticRenderer(AnalyticScene((Plane((0, 0, 0), tuple(normal)),))).surfaces(rays(camera))
    expected = -(camera.eye @ normal) / (directions(camera) @ normal)
    is_hit = image(found.is_hit, 30, 40)
    np.testing.assert_array_equal(is_hit, expected > 0)
    depth = image(found.distance, 30, 40)
    # towards the horizon a quotient of small numbers: the error grows with the distance
    assert (np.abs(depth / expected - 1)[is_hit] < ROUNDING * np.maximum(expected, 1)[is_hit]).all()


def test_a_sphere_has_its_closed_form():
    camera = Camera(look_at((1.5, 1.0, 3.0), (0.1, 0, 0)), 50.0, 60, 44)
    found = AnalyticRenderer(ball()).surfaces(rays(camera))
    d = directions(camera)
    a, b, c = (d * d).sum(-1), d @ camera.eye, camera.eye @ camera.eye - 1.0
    discriminant = b * b - a * c
    inner = discriminant > 1e-3  # at the silhouette the root magnifies every rounding
    np.testing.assert_array_equal(
        image(found.is_hit, 44, 60)[np.abs(discriminant) > 1e-5],
        (discriminant > 0)[np.abs(discriminant) > 1e-5],
    )
    expected = (-b - np.sqrt(np.maximum(discriminant, 0))) / a
    depth = image(found.distance, 44, 60)
    np.testing.assert_allclose(depth[inner], expected[inner], rtol=2e-5)  # 1e-6 / sqrt(1e-3)
    normal = image(found.normal, 44, 60)
    np.testing.assert_allclose(normal[inner], (camera.eye + expected[..., None] * d)[inner], atol=1e-4)


def test_distance_counts_in_lengths_of_the_direction():
    found = one_ray(ball(), (0, 0, 5), (0, 0, -2))
    assert found.distance[0] == pytest.approx(2.0, rel=ROUNDING)


@pytest.mark.parametrize(
    ("origin", "direction", "distance", "normal"),
    [
        ((0, 0, 5), (0, 0, -1), 4.0, (0, 0, 1)),
        ((0, 0, 0), (0, 0, -1), 1.0, (0, 0, 1)),  # from inside, the normal points inwards
        ((0, 0.5, 0), (0, 1, 0), 0.5, (0, -1, 0)),
    ],
)
def test_normals_are_on_the_side_of_the_ray(origin, direction, distance, normal):
    found = one_ray(ball(), origin, direction)
    assert found.distance[0] == pytest.approx(distance, rel=ROUNDING)
    np.testing.assert_allclose(np.array(found.normal).ravel(), normal, atol=ROUNDING)


@pytest.mark.parametrize(
    ("origin", "direction"), [((0, 0, 5), (0, 0, 1)), ((0, 2, 5), (0, 0, -1)), ((3, 0, 1), (1, 0, 0))]
)
def test_what_is_behind_or_beside_is_missed(origin, direction):
    assert not one_ray(ball(), origin, direction).is_hit[0]
    assert not one_ray(AnalyticScene((Plane((0, -9, 0), (0, 1, 0)),)), origin, (1, 0, 0)).is_hit[0]


def test_a_parallelogram_ends_at_its_edges():
    scene = AnalyticScene((Quad((0, 0, 0), (2, 0, 0), (1, 1, 0)),))
    for x, y, is_hit in [
        (0.1, 0.05, True),
        (2.9, 0.95, True),
        (0.5, 0.9, False),
        (2.5, 0.1, False),
        (1, -0.1, False),
    ]:
        assert one_ray(scene, (x, y, 3), (0, 0, -1)).is_hit[0] == is_hit


def test_the_nearest_shape_is_seen_with_its_class_and_albedo():
    shiny = Material((0.1, 0.2, 0.3), SurfaceClass.GLOSSY)
    chrome = Material((0.9, 0.9, 0.9), SurfaceClass.MIRROR)
    scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), shiny), Sphere((0, 0, 1), 0.5, chrome)))
    floor, mirror = one_ray(scene, (2, 0, 5), (0, 0, -1)), one_ray(scene, (0, 0, 5), (0, 0, -1))
    assert (floor.shape_index[0], floor.surface[0]) == (1, SurfaceClass.GLOSSY)
    assert (mirror.shape_index[0], mirror.surface[0]) == (2, SurfaceClass.MIRROR)
    np.testing.assert_allclose(np.array(floor.albedo).ravel(), (0.1, 0.2, 0.3), rtol=ROUNDING)
    assert not np.array(mirror.albedo).any()


def test_a_checkerboard_alternates():
    scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), Material(Checker((1, 1, 1), (0, 0, 0), period=2.0))),))
    seen = [one_ray(scene, (x, 0.0, 1), (0, 0, -1)).albedo[0][0] for x in (0.1, 1.1, 2.1, -0.9)]
    assert seen[0] == seen[2] != seen[1] == seen[3]


def test_diffuse_light_is_the_closed_form():
    scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), Material((0.5, 0.25, 1.0))),), to_light=(3, 0, 4))
    shading = traced(scene, slide(1).cameras[0], np.arange(3, dtype=np.uint32))
    expected = np.array([0.5, 0.25, 1.0]) * (0.2 + 0.8 * 4 / 5)
    np.testing.assert_allclose(shading.color, np.tile(expected, (3, 1)), rtol=ROUNDING)
    np.testing.assert_allclose(shading.variance, 0.0, atol=1e-6)  # what float32 leaves of E[x^2] - E[x]^2


def test_the_sky_is_a_gradient_of_direction():
    camera = Camera(look_at((0, 50, 0), (0, 50.1, -1)), 50.0, 9, 9)
    unit = directions(camera) / np.linalg.norm(directions(camera), axis=-1, keepdims=True)
    shading = traced(ball(horizon=(0, 0, 0), zenith=(1, 1, 1)), camera)
    np.testing.assert_allclose(shading.color[:, 0], (0.5 + 0.5 * unit[..., 1]).ravel(), rtol=1e-5)


def test_a_mirror_shows_the_reflected_sky_and_glass_what_is_behind():
    up = {"horizon": (0.0, 0.0, 0.0), "zenith": (1.0, 1.0, 1.0)}
    camera = Camera(look_at((0, 3, 3), (0, 0, 0)), 1.0, 1, 1)  # looks down at 45 degrees
    pane = {
        s: AnalyticScene((Plane((0, 0, 0), (0, 1, 0), Material((0.5, 0.5, 0.5), s)),), **up)
        for s in SurfaceClass
    }
    mirrored = traced(pane[SurfaceClass.MIRROR], camera).color[0, 0]
    through = traced(pane[SurfaceClass.TRANSPARENT], camera).color[0, 0]
    assert mirrored == pytest.approx(0.5 * (0.5 + 0.5 * math.sqrt(0.5)), rel=1e-4)
    assert through == pytest.approx(0.5 * (0.5 - 0.5 * math.sqrt(0.5)), rel=1e-4)


def test_only_specular_surfaces_depend_on_the_view():
    def colors(material):
        scene = AnalyticScene((Plane((0, 0, 0), (0, 0, 1), material),), to_light=(0, 0, 1))
        views = [Camera(look_at(eye, (0, 0, 0)), 1.0, 1, 1) for eye in ((0, 0, 4), (3, 0, 3))]
        return [traced(scene, view).color[0, 0] for view in views]

    straight, aslant = colors(Material((0.5, 0.5, 0.5)))
    assert straight == pytest.approx(aslant, rel=ROUNDING)
    straight, aslant = colors(Material((0.5, 0.5, 0.5), SurfaceClass.GLOSSY))
    assert straight > aslant + 0.1


@pytest.mark.parametrize("at", list(PixelFilter))
def test_random_numbers_depend_on_the_pixel_alone(at):
    camera, scene = room_walk(1, size=(40, 30)).cameras[0], room(noise=0.5)
    pixels = np.random.default_rng(5).permutation(1200).astype(np.uint32)
    whole = traced(scene, camera, spp=70, at=at)  # two passes
    shuffled = traced(scene, camera, pixels, spp=70, at=at)
    chunked = traced(scene, camera, pixels[::2], chunk=1024, spp=70, at=at)
    np.testing.assert_array_equal(shuffled.color, whole.color[pixels])
    np.testing.assert_array_equal(chunked.color, whole.color[pixels[::2]])
    np.testing.assert_array_equal(chunked.variance, whole.variance[pixels[::2]])


def test_other_seeds_frames_and_purposes_are_other_numbers():
    camera, scene = slide(1, size=(16, 12)).cameras[0], wall(noise=0.5)
    first = traced(scene, camera).color
    for change in ({"seed": 8}, {"frame": 4}, {"purpose": Purpose.KEYFRAME}):
        other = traced(scene, camera, **change).color
        assert (other != first).any(axis=1).mean() > 0.99


def test_noise_has_the_promised_mean_spread_and_variance():
    camera, spp = slide(1).cameras[0], 16
    grey = AnalyticScene((Plane((0, 0, 0), (0, 0, 1)),), light=(0, 0, 0), ambient=(1, 1, 1), noise=0.8)
    shading = traced(grey, camera, spp=spp)
    mean, sigma, count = 0.5, 0.8 * 0.5 / math.sqrt(spp), 64 * 48
    # Five standard errors. Of a variance it is sqrt((kurtosis + 2) / n), kurtosis 6 / spp for the means.
    assert abs(shading.color[:, 0].mean() - mean) < 5 * sigma / math.sqrt(count)
    slack = 5 * math.sqrt((6 / spp + 2) / count)
    assert shading.color[:, 0].astype(float).var() == pytest.approx(sigma**2, rel=slack)
    # An estimate from 16 paths scatters by sqrt((8 + 2 / 15) / 16) around the truth, without bias.
    assert shading.variance.mean() == pytest.approx(sigma**2, rel=5 * math.sqrt(8.2 / 16 / count))


@pytest.mark.parametrize(
    ("at", "blur"), [(PixelFilter.CENTRE, None), (PixelFilter.BOX, 0.0), (PixelFilter.GAUSSIAN, 0.5)]
)
def test_paths_begin_where_the_pixel_filter_says(at, blur):
    # A white half plane x > edge, seen so that one unit is one pixel and the edge lies 0.3 into pixel 10.
    white = Material((0, 0, 0), SurfaceClass.EMISSIVE, emission=(1, 1, 1))
    scene = AnalyticScene((Quad((0.3, -50, 0), (50, 0, 0), (0, 100, 0), white),))
    camera = Camera(look_at((0, 0, 10), (0, 0, 0)), 2 * math.degrees(math.atan(1)), 20, 20)
    got = traced(scene, camera, spp=64, at=at).color[:, 0].reshape(20, 20).mean(axis=0)
    if at is PixelFilter.CENTRE:
        expected = (np.arange(20) + 0.5 > 10.3).astype(float)
    elif at is PixelFilter.BOX:
        expected = np.clip(np.arange(20) + 1 - 10.3, 0, 1)
    else:
        reach = np.clip(np.arange(20) + 0.5 - 10.3, -1.5, 1.5) / (blur * math.sqrt(2))
        expected = 0.5 + 0.5 * np.vectorize(math.erf)(reach) / math.erf(1.5 / (blur * math.sqrt(2)))
    # 1280 coin flips a column: five standard errors of at most 0.5
    np.testing.assert_allclose(got, expected, atol=5 * 0.5 / math.sqrt(1280))
    np.testing.assert_allclose(got[[0, 5, 15, 19]], [0, 0, 1, 1], atol=ROUNDING)


def test_nan_samples_are_dropped_and_counted():
    camera = slide(1).cameras[0]
    clean, dirty = traced(wall(), camera, spp=8), traced(wall(nan_share=0.25), camera, spp=8)
    paths = 64 * 48 * 8
    assert clean.dropped == 0
    assert dirty.dropped == pytest.approx(paths / 4, abs=5 * math.sqrt(paths * 3 / 16))
    is_seen = dirty.color.any(axis=1)
    assert is_seen.mean() > 0.999  # all eight are lost with probability 1.5e-5
    np.testing.assert_allclose(dirty.color[is_seen], clean.color[is_seen], rtol=ROUNDING)
    lost = traced(wall(nan_share=1.0), camera, spp=2)
    assert lost.dropped == 64 * 48 * 2
    assert not lost.color.any()
    assert not lost.variance.any()


def test_an_empty_list_of_pixels_is_traced():
    shading = traced(wall(), slide(1).cameras[0], np.array([], np.uint32))
    assert shading.color.shape == (0, 3)


def test_no_kernel_is_compiled_after_the_first_frame():
    renderer, path = AnalyticRenderer(room(specular=True, noise=0.3)), room_walk(4, size=(48, 36))
    pixels = np.arange(48 * 36, dtype=np.uint32)

    def render(index):
        camera = path.cameras[index]
        found = renderer.surfaces(rays(camera))
        dr.eval(found.distance, found.normal, found.albedo, found.shape_index, found.surface)
        renderer.trace(
            camera,
            pixels[index:],
            RandomKey(index, index, Purpose.FILL),
            spp=4,
            pixel_filter=PixelFilter.GAUSSIAN,
        )

    render(0)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for index in range(1, 4):
            render(index)
        history = dr.kernel_history([dr.KernelType.JIT])
    assert len(history) >= 6
    # from memory, not from disk, where another run may have left every variant of a literal
    assert all(kernel["cache_hit"] and not kernel["cache_disk"] for kernel in history)


def test_scenes_survive_their_file(tmp_path):
    scene = room(specular=True, noise=0.25, nan_share=0.125)
    file = tmp_path / "room.analytic.json"
    file.write_text(scene_text(scene))
    facts = load(file).describe()
    assert facts == AnalyticRenderer(scene).describe()
    assert facts.shapes[5] == "ball"
    assert facts.fingerprint != AnalyticRenderer(room()).describe().fingerprint


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("{", "not valid JSON"),
        ("[]", "the scene must be an object"),
        ("{}", "shapes of the scene is missing"),
        ('{"shapes": []}', "must be a list of shapes"),
        ('{"shapes": [{"kind": "cone"}]}', "shape 1 has kind 'cone'; choose one of plane, quad, sphere"),
        ('{"shapes": [{"kind": "sphere", "centre": [0, 0, 0]}]}', r"radius of shape 1 \(sphere\) is missing"),
        (
            '{"shapes": [{"kind": "sphere", "centre": [0, 0, 0], "radius": -1}]}',
            "radius of sphere must be above 0",
        ),
        ('{"shapes": [{"kind": "sphere", "centre": [0, 0], "radius": 1}]}', "centre .* list of 3 numbers"),
        ('{"shapes": [{"kind": "sphere", "centre": [0, NaN, 0], "radius": 1}]}', "finite numbers, not nan"),
        (
            '{"shapes": [{"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 0]}]}',
            "normal of plane is zero",
        ),
        (
            '{"shapes": [{"kind": "plane", "point": [0, 0, 0], "normal": [0, 1, 0], "colour": 1}]}',
            "unknown field 'colour'",
        ),
        (
            '{"shapes": [{"kind": "quad", "corner": [0, 0, 0], "edge_u": [0, 1, 0], "edge_v": [0, 2, 0]}]}',
            "parallel",
        ),
        (
            '{"shapes": [{"kind": "sphere", "centre": [0, 0, 0], "radius": 1, "material": {"surface":"x"}}]}',
            "'x'; choose one of diffuse, emissive",
        ),
        (
            '{"noise": 2, "shapes": [{"kind": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]}]}',
            "noise is 2.0; it must be 0 to 1",
        ),
    ],
)
def test_wrong_files_are_named(tmp_path, text, problem):
    file = tmp_path / "x.analytic.json"
    file.write_text(text)
    with pytest.raises(SceneError, match=rf"x\.analytic\.json.*{problem}"):
        read_scene(file)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(SceneError, match="No such file"):
        read_scene(tmp_path / "none.analytic.json")
