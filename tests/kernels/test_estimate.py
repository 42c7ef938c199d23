"""Estimates of pixels: random numbers, filters and variance, by the known noise of the analytic renderer."""

from __future__ import annotations

import math

import drjit as dr
import numpy as np
import pytest

from enfilade.arrays import Array3f
from enfilade.camera.pinhole import Camera, look_at
from enfilade.gbuffer import find_geometry
from enfilade.kernels.estimate import Confined, Estimate, Samples
from enfilade.kernels.tone import luminance
from enfilade.methods.decoupled.reconstruction import ReconstructedEstimate
from enfilade.records import SurfaceClass
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from support.analytic import AnalyticRenderer
from support.analytic_scene import AnalyticScene, Material, Plane, Quad
from support.example_scenes import room, room_walk, slide, wall

ROUNDING = 1e-6  # products and quotients of a few float32


def traced(
    scene,
    camera,
    pixels=None,
    *,
    paths_in_flight=1 << 20,
    spp=4,
    seed=7,
    frame=3,
    purpose=Purpose.FILL,
    at=PixelFilter.CENTRE,
):
    if pixels is None:
        pixels = np.arange(camera.width * camera.height, dtype=np.uint32)
    return AnalyticRenderer(scene, paths_in_flight=paths_in_flight).trace(
        camera, pixels, RandomKey(seed, frame, purpose), spp=spp, pixel_filter=at
    )


@pytest.mark.parametrize("at", list(PixelFilter))
def test_random_numbers_depend_on_the_pixel_alone(at):
    camera, scene = room_walk(1, size=(40, 30)).cameras[0], room(noise=0.5)
    pixels = np.random.default_rng(5).permutation(1200).astype(np.uint32)
    whole = traced(scene, camera, spp=70, at=at)  # two passes
    shuffled = traced(scene, camera, pixels, spp=70, at=at)
    batched = traced(scene, camera, pixels[::2], paths_in_flight=1024, spp=70, at=at)
    np.testing.assert_array_equal(shuffled.color, whole.color[pixels])
    np.testing.assert_array_equal(batched.color, whole.color[pixels[::2]])
    np.testing.assert_array_equal(batched.variance, whole.variance[pixels[::2]])


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


def test_rays_of_confined_pixels_keep_their_limits():
    camera = slide(1, size=(16, 12)).cameras[0]
    pixels = np.arange(0, 192, 2, dtype=np.uint32)
    where, chosen = pixels % 3 == 0, pixels % 5 != 0
    low, high = -np.float32(pixels % 4 > 0), np.float32(pixels % 8 > 2)
    limits = np.stack([low, 0.1 * low], axis=1), np.stack([high, 0.1 * high], axis=1)

    def directions(pixel_filter, where):
        found = []

        def radiance(rays, _):
            found.append(np.stack([np.array(axis) for axis in rays.direction], axis=1))
            return Array3f(0.5)

        whole = Estimate(
            camera,
            pixels,
            radiance,
            paths_in_flight=64,  # of several in each call
            pixel_filter=pixel_filter,
            random=RandomKey(7, 3, Purpose.FILL),
            confined=None if where is None else Confined(where, *limits),
        )
        whole.add(2)
        whole.add(3, chosen)
        return np.concatenate(found)

    some, none = (directions(PixelFilter.GAUSSIAN, of) for of in (where, None))
    centres = directions(PixelFilter.CENTRE, None)
    np.testing.assert_allclose(directions(PixelFilter.CENTRE, where), centres, atol=1e-6)

    # Offsets in pixels.
    per_lane = np.concatenate([np.arange(len(pixels)).repeat(2), np.flatnonzero(chosen).repeat(3)])
    to_pixels = np.linalg.inv(camera.direction_from_pixel).T
    some, none = (((of - centres) @ to_pixels)[:, :2] for of in (some, none))
    is_confined = where[per_lane]
    expected = np.clip(0.5 * none, limits[0][per_lane], limits[1][per_lane])
    np.testing.assert_allclose(some, np.where(is_confined[:, None], expected, none), atol=1e-4)
    assert 0.1 < (np.abs(expected - 0.5 * none) > 1e-3)[is_confined].mean() < 0.9


@pytest.mark.parametrize(("layers", "auxiliary"), [(1, 0), (2, 0), (1, 2)])
@pytest.mark.parametrize("kind", [Estimate, ReconstructedEstimate])
def test_the_luminance_is_that_of_all_light_together(kind, layers, auxiliary):
    camera, pixels = slide(1, size=(16, 12)).cameras[0], np.arange(0, 192, 3, dtype=np.uint32)

    def radiance(_, sampler):
        light = [Array3f(sampler.next_1d(), sampler.next_1d(), 0.5) for _ in range(layers)]
        return Samples((*light, *[Array3f(7.0) * sampler.next_1d()] * auxiliary))

    options = (
        {"pixel_filter": PixelFilter.BOX}
        if kind is Estimate
        else {"reconstructed": min(layers + auxiliary, 2)}
    )
    options |= {"paths_in_flight": 1 << 20, "random": RandomKey(7, 3, Purpose.FILL)}
    whole = kind(camera, pixels, radiance, layers=layers, auxiliary=auxiliary, **options)
    whole.add(6)
    mean, variance = (np.array(of) for of in whole.luminance())
    light = whole.shadings[:layers]
    np.testing.assert_allclose(mean, luminance(sum(of.color for of in light)), rtol=1e-6)
    np.testing.assert_allclose(variance, sum(of.variance for of in light), rtol=1e-6)
    some = np.arange(len(pixels)) % 3 == 1
    for of, chosen in zip((mean, variance), whole.luminance(some), strict=True):
        np.testing.assert_array_equal(np.array(chosen), of[some])


def test_an_empty_list_of_pixels_is_traced():
    shading = traced(wall(), slide(1).cameras[0], np.array([], np.uint32))
    assert shading.color.shape == (0, 3)


def test_no_kernel_is_compiled_after_the_first_frame():
    renderer, path = AnalyticRenderer(room(specular=True, noise=0.3)), room_walk(4, size=(48, 36))
    pixels = np.arange(48 * 36, dtype=np.uint32)

    def render(index):
        camera = path.cameras[index]
        find_geometry(renderer, camera)
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
