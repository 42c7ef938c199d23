"""Light behind glass in scenes that limit the length of paths, against path tracing."""

from types import SimpleNamespace

import numpy as np
import pytest

from enfilade.arrays import UInt
from enfilade.camera.path import CameraPath, Segment
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.kernels.tone import REC709_LUMINANCE
from enfilade.methods.base import TaskId
from enfilade.methods.decoupled import Decoupled
from enfilade.methods.decoupled.path_depth import UNWEIGHTED, DepthWeights, light_by_depth, weight_after
from enfilade.methods.decoupled.shot import ShotContext
from enfilade.renderer import UNLIMITED, PixelFilter, Purpose, RandomKey
from enfilade.scene.mitsuba.renderer import MitsubaRenderer
from enfilade.settings import Settings
from support.in_memory import InMemory, run_passes, walk_of

SIZE = 64, 48
CAMERAS = tuple(Camera(look_at((x, 0.0, 3.5), (0, 0, 0)), 40, *SIZE) for x in np.linspace(0.0, 0.1, 3))
PATH = CameraPath(CAMERAS, (1, 2, 3), 24.0)
MIDDLE = 1
SCENE = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="{max_depth}"/></integrator>
<shape type="cube"><transform name="to_world"><scale value="4"/></transform>
  <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></bsdf></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="3.9"/></transform>
  <emitter type="area"><rgb name="radiance" value="10"/></emitter></shape>
<shape type="sphere"><bsdf type="dielectric"/></shape>
</scene>"""


def room_with_a_ball_of_glass(folder, max_depth):
    file = folder / "scene.xml"
    file.write_text(SCENE.format(max_depth=max_depth))
    return MitsubaRenderer(file)


@pytest.mark.slow
@pytest.mark.parametrize(("max_depth", "tolerance"), [(5, 0.07), (8, 0.03)])
def test_light_behind_glass_is_that_of_paths_of_limited_depth(tmp_path, max_depth, tolerance):
    # 0.96 and 0.99; it was 1.21 and 1.07 where all light was taken.
    renderer = room_with_a_ball_of_glass(tmp_path, max_depth)
    geometry = find_geometry(renderer, CAMERAS[MIDDLE])
    shapes = renderer.describe().shapes
    is_glass = geometry.shape_index == 1 + next(k for k, name in enumerate(shapes) if "phere" in name)
    assert 300 < is_glass.sum() < 1500
    found = run_passes(Decoupled(), walk_of(PATH, renderer)).colors[MIDDLE][is_glass].mean()
    pixels = np.flatnonzero(is_glass).astype(np.uint32)
    key = RandomKey(1, MIDDLE, Purpose.REFERENCE)
    traced = renderer.trace(CAMERAS[MIDDLE], pixels, key, spp=512, pixel_filter=PixelFilter.GAUSSIAN)
    assert found / traced.color.mean() == pytest.approx(1.0, abs=tolerance)


def light_of(renderer):
    geometry, key = find_geometry(renderer, CAMERAS[MIDDLE]), RandomKey(1, MIDDLE, Purpose.DEPTHS)
    shot = ShotContext(0, [Segment(0, len(PATH) - 1)], None, walk_of(PATH, renderer), None, None)
    light, count = light_by_depth(renderer, geometry, None, key, shot.estimate)
    assert count.rays == 4 * geometry.has_diffuse.sum()
    return np.array(light) / geometry.has_diffuse.sum()


def test_paths_that_end_early_bring_less_light(tmp_path):
    *soft, sharp = light_of(room_with_a_ball_of_glass(tmp_path, 5))
    assert sharp == 0.0
    assert np.all(np.diff(soft) < 0.0)
    # Of walls of reflectance 0.8 each bounce brings about that much of the last one.
    assert soft[1] / soft[0] == pytest.approx(0.85, abs=0.07)


def test_sharp_light_is_apart(tmp_path):
    point = '<emitter type="point"><point name="position" value="0, 3, 2"/></emitter></scene>'
    file = tmp_path / "both.xml"
    file.write_text(SCENE.format(max_depth=6).replace("</scene>", point))
    renderer = MitsubaRenderer(file)
    *soft, sharp = light_of(renderer)
    assert 0.0 < sharp < soft[-1] < soft[0]
    found, traced = find_geometry(renderer, CAMERAS[MIDDLE]), MitsubaRenderer(file, max_depth=6)
    pixels = np.flatnonzero(found.has_diffuse).astype(np.uint32)
    key = RandomKey(2, MIDDLE, Purpose.REFERENCE)
    whole = traced.trace(CAMERAS[MIDDLE], pixels, key, spp=64).color @ REC709_LUMINANCE
    assert whole.mean() / 0.8 == pytest.approx(soft[0] + sharp, rel=0.05)


def test_of_mirrors_alone_it_is_the_light_of_what_they_show(tmp_path):
    scene = SCENE.format(max_depth=5).replace('"dielectric"', '"conductor"')
    file = tmp_path / "scene.xml"
    file.write_text(scene)
    renderer, close = MitsubaRenderer(file), Camera(look_at((0, 0, 1.3), (0, 0, 0)), 20.0, *SIZE)
    geometry, key = find_geometry(renderer, close), RandomKey(1, MIDDLE, Purpose.DEPTHS)
    assert not geometry.has_diffuse.any()
    shot = ShotContext(0, [Segment(0, len(PATH) - 1)], None, walk_of(PATH, renderer), None, None)
    light, _ = light_by_depth(renderer, geometry, None, key, shot.estimate)
    soft, wide = np.array(light[:-1]), light_of(renderer)[:-1]
    np.testing.assert_allclose(soft[1:] / soft[:-1], wide[1:] / wide[:-1], rtol=0.15)  # other walls


def test_only_scenes_that_limit_the_depth_of_paths_need_it(tmp_path):
    assert room_with_a_ball_of_glass(tmp_path, 8).max_path_depth() == 8
    assert room_with_a_ball_of_glass(tmp_path, -1).max_path_depth() == UNLIMITED


def test_without_limit_nothing_is_weighted(tmp_path):
    method, walk = Decoupled(), walk_of(PATH, room_with_a_ball_of_glass(tmp_path, -1))
    results = InMemory(walk)
    keyframes = method.keyframes(results.analysis)
    for task in list(method.tasks(results.analysis))[: len(keyframes)]:
        assert task.id == TaskId("prepass", task.frame)
        results.task_metadata[task.id] = method.run(task, results, walk).metadata
        assert results.task_metadata[task.id]["light_by_depth"] is None
    shot = ShotContext(0, [Segment(0, len(PATH) - 1)], results, walk, None, None)
    assert shot._depth_weights is UNWEIGHTED


def test_weights_are_relative_to_the_depth_at_which_cached_paths_begin():
    light = [[8.0, 6.0, 4.0, 2.0, 2.0], [8.0, 6.0, 4.0, 2.0, 2.0]]  # of two keyframes; the last is sharp
    weights = DepthWeights.of(light)
    bounces = UInt([0, 1, 2, 3, 7])
    others = [10 / 8, 1, 6 / 8, 4 / 8, 4 / 8]
    found = weight_after(weights.images, bounces)
    np.testing.assert_allclose(np.array(found), [1, 6 / 8, 4 / 8, 2 / 8, 2 / 8])
    np.testing.assert_allclose(np.array(weight_after(weights.others, bounces)), others)
    soft = [8 / 6, 1, 4 / 6, 2 / 6, 2 / 6]
    np.testing.assert_allclose(np.array(weight_after(weights.soft, bounces)), soft, rtol=1e-6)


def test_prepass_images_are_weighted_as_other_irradiance(monkeypatch):
    walk = SimpleNamespace(path=PATH, settings=Settings())
    shot = ShotContext(0, [Segment(0, len(PATH) - 1)], None, walk, None, None)
    weights = DepthWeights.of([[8.0, 6.0, 4.0, 2.0, 2.0]])
    monkeypatch.setattr(ShotContext, "_depth_weights", weights)
    assert shot._prepass_weights.images is shot._prepass_weights.others is weights.others


def test_without_light_nothing_is_left_out():
    weights = DepthWeights.of([[0.0] * 5])
    for of in (weights.images, weights.others, weights.soft):
        assert np.array(weight_after(of, UInt([0, 3, 8]))).tolist() == [1.0] * 3


SPHERE_LAMP = (
    '<shape type="sphere"><point name="center" x="0.5" y="1.5" z="0"/><float name="radius" value="0.3"/>'
    '<emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>'
)
POINT_LAMP = (
    '<emitter type="point"><point name="position" x="0.5" y="1.5" z="0"/>'
    '<rgb name="intensity" value="2"/></emitter>'
)


@pytest.mark.slow
@pytest.mark.parametrize(("max_depth", "error"), [(6, 0.0), (8, 0.28), (12, 0.1), (20, 0.03)])
@pytest.mark.parametrize("lamp", [SPHERE_LAMP, POINT_LAMP], ids=["soft", "sharp"])
def test_deep_paths_end_at_the_limit(tmp_path, max_depth, error, lamp):
    """Behind three panes, which have six interfaces, paths of depth 8 and more light a wall.

    Cached light has the weight of the fourth surface there: 1.20 and 1.26 of the light, 0.97 and 0.92, 1.01
    and 0.99.
    """
    walls = "".join(
        f'<shape type="rectangle"><transform name="to_world"><scale value="2"/>{place}</transform>'
        '<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></bsdf>'
        "</shape>"
        for place in ('<rotate x="1" angle="-90"/>', '<translate z="-1.5"/>')
    )
    panes = "".join(
        f'<shape type="cube"><transform name="to_world"><scale x="3" y="3" z="0.02"/><translate z="{z}"/>'
        '</transform><bsdf type="dielectric"/></shape>'
        for z in (0.6, 0.8, 1.0)
    )
    integrator = f'<integrator type="path"><integer name="max_depth" value="{max_depth}"/></integrator>'
    file = tmp_path / "scene.xml"
    file.write_text(f'<scene version="3.0.0">{integrator}{walls}{panes}{lamp}</scene>')
    renderer, camera = MitsubaRenderer(file), Camera(look_at((0.0, 1.0, 4.0), (0.0, 0.6, 0.0)), 30.0, 32, 24)
    walk = walk_of(CameraPath((camera,), (1,), 24.0), renderer)
    wall = np.s_[4:20, 4:28]
    found = run_passes(Decoupled(), walk).colors[0][wall].mean()
    key = RandomKey(1, 0, Purpose.REFERENCE)
    pixels = np.arange(32 * 24, dtype=np.uint32).reshape(24, 32)[wall].ravel()
    # Of 1024 paths the mean has a standard error of 0.5 %.
    traced = renderer.trace(camera, pixels, key, spp=1024, pixel_filter=PixelFilter.GAUSSIAN)
    expected = traced.color.mean()
    assert (expected > 0.0) == (max_depth > 6)
    assert found == pytest.approx(expected, rel=error, abs=1e-3)
