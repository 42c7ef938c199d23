"""Short sequences, the noise-free renderer, virtual images of mirrors, and scores of regions of maps."""

from functools import cache

import numpy as np
import pytest

from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry, image_flow
from enfilade.records import SurfaceClass
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.settings import MetricSettings, TraceSettings
from studies.cases.supports import uniform
from studies.cases.virtual_images import VIRTUAL, mirror_pixels, reflected_geometry
from studies.cases.visibility import Viewer, score_in, visible_percent
from studies.cases.windows import probe_frames
from support.analytic import AnalyticRenderer
from support.analytic_scene import AnalyticScene, Checker, Material, Quad
from support.example_scenes import room
from support.study_runs import windows_of


@cache
def plain():
    return windows_of(room())


def test_the_noise_free_renderer_has_no_noise_and_paths_through_a_pixel_antialias():
    camera, pixels = plain().walk.path.cameras[3], np.arange(64 * 48, dtype=np.uint32)

    def trace(seed, pixel_filter, spp=4):
        key = RandomKey(seed, 1, Purpose.FILL)
        return plain().walk.renderer.trace(camera, pixels, key, spp=spp, pixel_filter=pixel_filter)

    centre = trace(0, PixelFilter.CENTRE)
    np.testing.assert_array_equal(centre.color, trace(1, PixelFilter.CENTRE).color)
    assert not centre.variance.any()
    box = trace(0, PixelFilter.BOX, 64)
    assert (box.variance > 0.0).mean() > 0.02
    is_flat = box.variance < 1e-9  # inside a smooth surface both agree
    np.testing.assert_allclose(centre.color[is_flat], box.color[is_flat], atol=0.02)


def test_the_noise_free_renderer_shows_reflections():
    windows = windows_of(room(specular=True), 8)
    geometry, reflected = windows.geometry(5), windows.reflected_geometry(5)
    mirror = mirror_pixels(geometry)
    assert mirror.any()
    np.testing.assert_array_equal(reflected.shape_index[~mirror], geometry.shape_index[~mirror])
    is_plain = np.isin(reflected.surface, [SurfaceClass.DIFFUSE, SurfaceClass.GLOSSY])
    hit = mirror & (reflected.shape_index > VIRTUAL) & is_plain
    cosine = np.abs(reflected.normal[hit] @ np.array([0.36, 0.48, 0.8]))
    wanted = reflected.albedo[hit] * (0.3 + 0.7 * cosine)[:, None]
    np.testing.assert_allclose(windows.traced(5).color[hit], wanted, atol=2e-3)


def test_the_virtual_image_of_a_plane_mirror_is_static():
    """A mirror as back wall: the reflected room is a room behind it, whose motion is that of its points."""
    mirror = Material((0.9, 0.9, 0.9), SurfaceClass.MIRROR)
    checks = Material(Checker((0.8, 0.8, 0.8), (0.2, 0.2, 0.2), 0.5))
    glass = Quad((-9, -9, 0), (18, 0, 0), (0, 18, 0), mirror, "mirror")  # z = 0
    wall = Quad((-20, -20, 5), (0, 40, 0), (40, 0, 0), checks, "wall")  # z = 5, behind the camera
    image = Quad((-20, -20, -5), (40, 0, 0), (0, 40, 0), checks, "wall")
    cameras = [Camera(look_at((0.1 * k, 0, 3), (0.1 * k + 0.3, 0.1, 0)), 50.0, 32, 24) for k in range(2)]
    real, virtual = (AnalyticRenderer(AnalyticScene(shapes)) for shapes in ((glass, wall), (image,)))
    geometry, wanted = (find_geometry(renderer, cameras[0]) for renderer in (real, virtual))
    reflected = reflected_geometry(real, geometry)
    np.testing.assert_allclose(reflected.depth, wanted.depth, rtol=2e-3)  # rays begin beside the mirror
    motion, truth, of_mirror = (
        image_flow(g, None, cameras[1]).forward for g in (reflected, wanted, geometry)
    )
    np.testing.assert_allclose(motion, truth, atol=0.01)
    assert np.abs(motion - of_mirror).max() > 0.3


def test_probes_go_from_slow_to_fast_each_once():
    analysis = plain().analysis
    probes = probe_frames(analysis, 4)
    speeds = [analysis.frames[f].speed_deg_s for f in probes]
    assert speeds == sorted(speeds)
    assert len(set(probes)) == len(probes) == 4
    assert probe_frames(analysis, 100) == probe_frames(analysis, 99)


def test_a_keyframe_is_reused_as_it_was_traced():
    np.testing.assert_array_equal(plain().reused(0).color, plain().traced(0).color)
    assert 0.0 < np.abs(plain().reused(3).color - plain().traced(3).color).mean() < 0.05


def test_traced_frames_are_kept_and_read_again(tmp_path):
    windows = windows_of(room(), 8, folder=tmp_path)
    first = windows.traced(2).color
    assert len(list(tmp_path.rglob("*.exr"))) == 1
    np.testing.assert_array_equal(windows_of(room(), 8, folder=tmp_path).traced(2).color, first)
    halves = windows, windows.second_half
    assert len({half.walk.settings[TraceSettings].seed for half in halves}) == 2
    windows.second_half.traced(2)
    assert len(list(tmp_path.rglob("second half/**/*.exr"))) == 1
    assert np.abs(windows.reference(2).color - first).max() > 0.0  # other random numbers, another filter


def test_scores_of_regions_of_a_map():
    jnd = np.array([[0.5, 2.0], [2.0, 4.0]], np.float32)
    everywhere, nowhere = np.ones((2, 2), bool), np.zeros((2, 2), bool)
    assert visible_percent(jnd, everywhere) == 75.0
    assert score_in(jnd, jnd == 2.0) == pytest.approx(2.0)
    assert 2.0 < score_in(jnd, everywhere) < 4.0
    assert score_in(jnd, nowhere) is visible_percent(jnd, nowhere) is None


def test_noise_of_halves_does_not_count_and_the_slope_of_masking_does():
    walk, viewer, reference = plain().walk, plain().viewer, plain().traced(5).color
    noise = np.random.default_rng(1).normal(0.0, 0.05, (2, *reference.shape[:2], 1)).astype(np.float32)
    tests = np.maximum(reference + noise, 0.0)
    test = tests[0]
    assert (viewer.paper(test, reference, None) > 1.0).mean() > 0.3
    assert (viewer.halves(tests, (reference, reference), None) > 1.0).mean() < 0.05
    steep, flat = (
        Viewer(walk.viewing, walk.settings.replace(MetricSettings, mask_slope=slope)) for slope in (1.0, 0.0)
    )
    assert steep.paper(test, reference, None).mean() < 0.95 * flat.paper(test, reference, None).mean()


def test_uniform_supports():
    traced = plain().traced(8).color
    np.testing.assert_allclose(plain().antialiased(8, uniform(1.0, 1)), traced, atol=1e-6)
    wide = plain().antialiased(8, uniform(11.0, 1))
    assert np.abs(np.diff(wide, axis=1)).mean() < 0.7 * np.abs(np.diff(traced, axis=1)).mean()
