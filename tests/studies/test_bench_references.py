"""Windows and references of the bench: drawn from the scene, traced in halves, shared and grown."""

from dataclasses import replace

import numpy as np
import pytest

from enfilade.errors import InputError
from enfilade.methods.walkthrough import Walkthrough
from enfilade.monitor import Silence
from enfilade.renderer import PixelFilter, Purpose, RandomKey
from enfilade.settings import SampleFilter
from studies.bench.references import BATCH, FILTERS, LARGE_BATCH, References
from studies.bench.windows import KINDS, MARGIN_PX, Window, content, draw_windows, windows_of
from support.example_scenes import room_walk
from support.study_runs import room_job

WINDOWS = [Window("edges", 5, 5, 16), Window("flat", 25, 12, 16)]


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return room_job(tmp_path_factory.mktemp("room"), 2, method="reference")


@pytest.fixture(scope="module")
def held(job, tmp_path_factory):
    references = References(tmp_path_factory.mktemp("store"), job, WINDOWS)
    references.grow(2 * BATCH, Silence())
    return references


def test_windows_show_their_kind_and_do_not_overlap(job):
    walk = Walkthrough(job.path, job.settings, job.open_renderer())
    windows = draw_windows(walk)
    assert [w.kind for w in windows] == list(KINDS[: len(windows)])
    assert len(windows) >= 3
    shares = content(walk, 1)
    for one in windows:
        assert one.left >= MARGIN_PX
        assert one.top + one.side <= walk.path.height - MARGIN_PX
        for other in windows:
            is_apart = abs(one.left - other.left) >= one.side or abs(one.top - other.top) >= one.side
            assert one == other or is_apart
    # The first takes the largest share of edges there is; the flat one has fewer edges.
    assert windows[0].crop(shares["edges"]).mean() > shares["edges"].mean()
    assert windows[0].crop(shares["edges"]).mean() > windows[-1].crop(shares["edges"]).mean()
    assert draw_windows(walk) == windows
    assert windows_of([vars(w) for w in windows]) == windows


def test_a_small_image_is_refused(job):
    path = job.path
    cameras = tuple(replace(camera, width=16, height=12) for camera in path.cameras)
    walk = Walkthrough(replace(path, cameras=cameras), job.settings, job.open_renderer())
    with pytest.raises(InputError, match=r"20 pixels or more.*16x12"):
        draw_windows(walk)


def test_a_path_that_shows_no_surface_has_no_windows(job):
    away = np.eye(4)
    away[:3, 3] = 1e6, 1e6, 1e6
    cameras = tuple(replace(camera, world_from_camera=away) for camera in job.path.cameras)
    walk = Walkthrough(replace(job.path, cameras=cameras), job.settings, job.open_renderer())
    with pytest.raises(InputError, match="choose other frames"):
        draw_windows(walk)


@pytest.mark.parametrize("kind", FILTERS)
def test_both_filters_are_those_of_the_renderer(job, held, kind):
    """Path traced by the renderer's own filters: equal within the noise, no bias over the window."""
    camera = job.path.cameras[1]
    frame, spp = held.read(1), 512
    random = RandomKey(99, 1, Purpose.REFERENCE)
    for index, window in enumerate(WINDOWS):
        lanes = window.crop(np.arange(camera.width * camera.height).reshape(camera.height, camera.width))
        traced = job.open_renderer().trace(
            camera, lanes.ravel().astype(np.uint32), random, spp=spp, pixel_filter=PixelFilter[kind.name]
        )
        wanted = traced.color.reshape(window.side, window.side, 3)
        found = frame.halves[kind].mean(axis=0)[index]
        half_noise = np.square(frame.halves[kind][0] - frame.halves[kind][1])[index].mean() / 4.0
        noise = half_noise + traced.variance.mean()
        # 1.5: radiance of three channels against the variance of luminance, and chance
        assert np.square(found - wanted).mean() < 1.5 * noise + 1e-6
        assert abs((found - wanted).mean()) < 4.0 * np.sqrt(noise / wanted[..., 0].size)


@pytest.mark.parametrize("kind", FILTERS)
def test_denoised_halves_agree_and_keep_the_light(held, kind):
    """Also through the Gaussian filter, whose noise is correlated between pixels."""
    frame = held.read(0)
    halves, denoised = frame.halves[kind], frame.denoised[kind]
    assert (halves[0] != halves[1]).any()
    raw, clean = (np.square(of[0] - of[1]).mean() for of in (halves, denoised))
    assert clean < 0.6 * raw  # of windows of 16 pixels
    np.testing.assert_allclose(denoised[2].mean(), halves.mean(), rtol=0.01)


def test_references_grow_are_shared_and_are_the_same_however_they_grew(job, held, tmp_path):
    assert held.missing(2 * BATCH) == []
    assert held.missing(2 * BATCH + 1) == [0, 1]
    grown = References(tmp_path, job, WINDOWS)
    grown.grow(10, Silence())
    np.testing.assert_array_equal(
        grown.read(1).halves[SampleFilter.BOX], held.read(1).halves[SampleFilter.BOX]
    )
    grown.grow(3 * BATCH, Silence())
    direct = References(tmp_path / "direct", job, WINDOWS)
    direct.grow(4 * BATCH, Silence())
    assert (grown.spp(1), direct.spp(1)) == (4 * BATCH, 4 * BATCH)
    np.testing.assert_array_equal(
        grown.read(1).halves[SampleFilter.BOX], direct.read(1).halves[SampleFilter.BOX]
    )
    # Another method and a copy of the scene share them; other windows or other seeds do not.
    assert References(tmp_path, replace(job, method="paper"), WINDOWS).missing(1) == []
    (tmp_path / "copy").mkdir()
    copy = room_job(tmp_path / "copy", 2, method="reference")
    assert References(tmp_path, copy, WINDOWS).missing(1) == []
    assert References(tmp_path, job, WINDOWS[:1]).missing(1) == [0, 1]
    assert References(tmp_path, job, WINDOWS, seed=5).missing(1) == [0, 1]


def test_references_of_large_windows_have_smaller_batches(job, tmp_path):
    job = replace(job, path=room_walk(1, size=(150, 140)))
    references = References(tmp_path, job, [Window("flat", 2, 2, 136)])
    references.grow(1, Silence())
    assert references.spp(0) == 2 * LARGE_BATCH


def test_a_damaged_reference_is_named(job, tmp_path):
    references = References(tmp_path, job, WINDOWS)
    references.grow(1, Silence())
    for file in references.folder.glob("*.npz"):
        file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(InputError, match=r"missing or damaged.*delete it"):
        references.read(0)
