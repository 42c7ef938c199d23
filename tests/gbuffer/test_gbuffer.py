"""The G-buffer against exact rays in float64."""

from dataclasses import replace

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import positions
from enfilade.records import SurfaceClass
from support.analytic_scene import AnalyticScene, Material, Plane, Quad, Sphere
from support.analytic_truth import first_hits, geometry_of, ray_directions
from support.example_scenes import ball, room, room_walk, slide, wall

SCENES = {
    "wall": (wall(), slide(1).cameras[0]),
    "ball": (ball(), slide(1).cameras[0]),
    "room": (room(), room_walk(5).cameras[1]),
    "specular room": (room(specular=True), room_walk(5).cameras[3]),
    "lens shift": (room(), replace(room_walk(5).cameras[1], principal_point=(0.4, 0.75))),
}


@pytest.fixture(params=SCENES)
def seen(request):
    scene, camera = SCENES[request.param]
    return scene, camera, geometry_of(scene, camera)


def truth(scene, camera):
    """Exact depth and shape, and where neighbours agree: away from edges, where rounding may decide."""
    depth, shape_index = first_hits(scene, camera.eye, ray_directions(camera))
    padded = np.pad(shape_index, 1, mode="edge")
    shifted = [
        padded[j : j + shape_index.shape[0], i : i + shape_index.shape[1]] for j in range(3) for i in range(3)
    ]
    return depth, shape_index, np.all([s == shape_index for s in shifted], axis=0)


def test_items_are_exact(seen):
    scene, camera, geometry = seen
    _, shape_index, inner = truth(scene, camera)
    np.testing.assert_array_equal(geometry.shape_index[inner], shape_index[inner])
    assert (geometry.shape_index != shape_index).mean() < 1e-3


def test_depth_is_exact(seen):
    scene, camera, geometry = seen
    depth, shape_index, _ = truth(scene, camera)
    same = (geometry.shape_index == shape_index) & (shape_index > 0)
    error = np.abs(geometry.depth[same] / depth[same] - 1)
    assert np.quantile(error, 0.99) < 2e-6  # float32
    assert error.max() < 1e-3  # at a sphere's silhouette the root magnifies rounding


def test_what_sees_nothing_holds_nothing(seen):
    _, _, geometry = seen
    empty = ~geometry.is_hit
    for values in (geometry.depth, geometry.normal, geometry.albedo, geometry.surface, geometry.disparity):
        assert not values[empty].any()
    for values in (geometry.depth, geometry.normal, geometry.albedo, geometry.disparity):
        assert np.isfinite(values).all()


def test_classes_are_the_materials(seen):
    scene, _, geometry = seen
    classes = np.array([SurfaceClass.NONE, *(shape.material.surface for shape in scene.shapes)])
    np.testing.assert_array_equal(geometry.surface, classes[geometry.shape_index])


def test_normals_are_unit_and_towards_the_camera(seen):
    _, camera, geometry = seen
    hit = geometry.is_hit
    np.testing.assert_allclose(np.linalg.norm(geometry.normal, axis=-1)[hit], 1.0, atol=1e-5)
    assert ((geometry.normal * ray_directions(camera)).sum(-1)[hit] <= 1e-6).all()


def test_positions_lie_on_the_surfaces():
    scene, camera = SCENES["room"]
    world = positions(geometry_of(scene, camera))
    depth, shape_index = first_hits(scene, camera.eye, ray_directions(camera))
    exact = camera.eye + depth[..., None] * ray_directions(camera)
    np.testing.assert_allclose(world[shape_index > 0], exact[shape_index > 0], atol=2e-4)
    scene, camera = SCENES["ball"]
    geometry = geometry_of(scene, camera)
    world = positions(geometry)
    assert not world[~geometry.is_hit].any()
    np.testing.assert_allclose(np.linalg.norm(world[geometry.is_hit], axis=-1), 1.0, atol=1e-3)


def test_the_nearest_of_several_surfaces_is_seen():
    shapes = (
        Plane((0, 0, -2), (0, 0, 1)),
        Quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0), Material(surface=SurfaceClass.GLOSSY)),
        Sphere((0, 0, 1), 0.3, Material(surface=SurfaceClass.MIRROR)),
    )
    geometry = geometry_of(AnalyticScene(shapes), Camera(look_at((0, 0, 4), (0, 0, 0)), 60.0, 41, 31))
    assert geometry.shape_index[15, 20] == 3
    assert geometry.depth[15, 20] == pytest.approx(2.7, rel=1e-6)
    assert geometry.shape_index[15, 17] == 2
    assert geometry.shape_index[2, 2] == 1


def test_an_image_of_one_pixel():
    geometry = geometry_of(ball(), Camera(look_at((0, 0, 4), (0, 0, 0)), 45.0, 1, 1))
    assert geometry.depth.shape == (1, 1)
    assert geometry.depth[0, 0] == pytest.approx(3.0, rel=1e-6)
