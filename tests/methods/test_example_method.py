"""The example of a method in docs/examples, rendered through the public functions."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

import enfilade
from enfilade.images import read_exr
from enfilade.records import Provenance
from support.analytic_scene import AnalyticScene, Material, Plane, Quad, write_scene
from support.analytic_truth import first_hits, projected, ray_directions, traced_image
from support.example_scenes import slide

EXAMPLES = Path(__file__).parents[2] / "docs/examples"
NOISE, SPP = 0.4, 16
# Flat walls of one colour each: the radiance of a point is that of its shape, from everywhere.
SHAPES = (
    Plane((0, 0, -2), (0, 0, 1), Material((0.2, 0.3, 0.4)), "wall"),
    Quad((-0.4, -3, 0), (0.5, 0, 0), (0, 6, 0), Material((0.7, 0.2, 0.1)), "post"),
)


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """Path, and the layers of the delivered frames."""
    folder, path = tmp_path_factory.mktemp("example"), slide(9, step=0.15)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLES)
        scene = enfilade.Scene(
            write_scene(folder / "scene", AnalyticScene(SHAPES, noise=NOISE)), "support.analytic:load"
        )
        settings = {"sampling": {"spp": SPP}, "keyframes": {"spacing": 4}, "video": {"codec": "ffv1"}}
        method = "nearest_keyframe:NearestKeyframe"
        enfilade.render(scene, path, folder / "run", method=method, settings=settings)
    return path, [read_exr(file) for file in sorted((folder / "run/frames").glob("*.exr"))]


def is_visible_to(camera, world):
    """Points inside the image of a camera that no surface occludes."""
    nearest, _ = first_hits(AnalyticScene(SHAPES), camera.eye, world - camera.eye)
    at, depth = projected(camera, world)
    inside = (depth > 0) & (at > 0).all(-1) & (at < (camera.width, camera.height)).all(-1)
    return (nearest > 1 - 1e-6) & inside


def test_colours_are_right_within_the_monte_carlo_error(frames):
    path, layers = frames
    for camera, frame in zip(path.cameras, layers, strict=True):
        exact = traced_image(AnalyticScene(SHAPES), camera).color.astype(float)
        # One error for all channels: that of the mean of SPP paths. The reused ones are those of a keyframe.
        errors = (frame["RGB"][..., 1] / exact[..., 1] - 1.0) / (NOISE / np.sqrt(SPP))
        for kind in np.unique(frame["provenance"]):
            of = errors[frame["provenance"] == kind]
            assert abs(of.mean()) < 5.0 / np.sqrt(len(of) / 2)  # a keyframe's pixel may be used twice
            assert np.abs(of).max() < 7.0  # the distribution is skewed
            assert of.std() == pytest.approx(1.0, rel=5.0 / np.sqrt(len(of) / 2))


def test_disoccluded_pixels_are_traced_and_all_others_reused(frames):
    path, layers = frames
    for frame, (camera, found) in enumerate(zip(path.cameras, layers, strict=True)):
        nearest = min((0, 4, 8), key=lambda k: abs(k - frame))
        if frame == nearest:
            assert (found["provenance"] == Provenance.KEYFRAME).all()
            continue
        depth, shape_index = first_hits(AnalyticScene(SHAPES), camera.eye, ray_directions(camera))
        world = camera.eye + depth[..., None] * ray_directions(camera)
        is_visible = is_visible_to(path.cameras[nearest], world)
        is_reused = found["provenance"] == Provenance.REUSED
        # The nearest pixel of the keyframe may show another surface beside silhouettes alone.
        labels = 2 * shape_index + is_visible
        is_edge = maximum_filter(labels, 3) != minimum_filter(labels, 3)
        np.testing.assert_array_equal(is_reused[~is_edge], is_visible[~is_edge])
        assert is_edge.mean() < 0.2
        assert 0.7 < is_reused.mean() < 0.99
        assert ((found["provenance"] == Provenance.DISOCCLUDED) == ~is_reused).all()

        # No pixel shows another surface.
        is_red = found["RGB"][..., 0] > found["RGB"][..., 2]
        np.testing.assert_array_equal(is_red, shape_index == 2)
