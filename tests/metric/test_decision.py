"""The modern decision against its twin: energies, aperture, transducer, together."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import scipy.ndimage

from enfilade.metric import Aqm, Fitted, MetricOptions
from enfilade.metric.comparison import Pool, PoolingRule
from enfilade.metric.cortex import bands
from enfilade.metric.decision import Decision, Masking
from enfilade.metric.spatial import Aperture
from enfilade.viewing import Viewing

PPD = 28.0
SHAPE = (48, 64)


@pytest.fixture(scope="module")
def transducer_twin():
    path = Path(__file__).parents[1] / "twins" / "transducer.py"
    spec = importlib.util.spec_from_file_location("transducer_twin", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("count", [1, 3])
def test_twin(transducer_twin, count):
    random = np.random.default_rng(8)
    ladder = tuple(band for band in bands(PPD, 1.0) if band.reduction == 1)[-count:]
    shown = []
    for _ in ladder:
        smooth = scipy.ndimage.gaussian_filter(random.standard_normal((2, 6, *SHAPE)), (0, 0, 1.5, 1.5))
        reference = (12.0 * smooth[0]).astype(np.float32)
        test = (reference + 8.0 * smooth[1] * (np.arange(SHAPE[1]) > 30)).astype(np.float32)
        shown.append((reference, test))
    aperture = Aperture(SHAPE, PPD, Fitted().aperture_sigma_deg)
    pool = Pool(bands(PPD, 1.0), np.ones(SHAPE, bool), PoolingRule(1.0, 1.0, True), aperture)
    decision = Decision(pool, Masking(MetricOptions.modern(), Fitted(), 0.7, 1.0), aperture)
    for band, images in zip(ladder, shown, strict=True):
        decision.add(band, ((c.copy(), None, t - c) for c, t in zip(*images, strict=True)))
    decision.close()
    jnd = pool.comparison().jnd
    places = [(y, x) for y in (0, 13, 24, 40) for x in (8, 30, 41, 56)]
    expected = [
        sum(
            transducer_twin.band_jnd(images, shown[max(k - 1, 0) : k] + shown[k + 1 : k + 2], y, x, PPD)
            for k, images in enumerate(shown)
        )
        for y, x in places
    ]
    found = [jnd[place] for place in places]
    # The map is interpolated from every eighth pixel.
    np.testing.assert_allclose(found, expected, rtol=0.06, atol=0.03 * max(expected))


def test_a_mask_of_a_neighbouring_band_hides(viewing):
    y, x = np.mgrid[:120, :160] / viewing.pixels_per_degree
    grey = np.full(y.shape, 40.0)
    found = {}
    for name, options in (
        ("broad", MetricOptions.modern()),
        ("narrow", MetricOptions.modern().without("broad_masking")),
    ):
        judge = Aqm(viewing.cropped(160, 120), options=options)
        for mask in (0.0, 0.5):
            reference = grey * (1 + mask * np.cos(2 * np.pi * 2.0 * x))
            test = reference + grey * 0.05 * np.cos(2 * np.pi * 5.0 * x)
            images = (test.astype(np.float32), reference.astype(np.float32))
            found[name, mask] = judge.compare(*images).score
    # The two lie in neighbouring bands: only the broad pool lets one hide the other.
    assert found["broad", 0.5] < 0.5 * found["broad", 0.0]
    assert found["narrow", 0.5] > 0.75 * found["narrow", 0.0]


@pytest.fixture(scope="module")
def modern(viewing):
    return Aqm(viewing, options=MetricOptions.modern())


def test_equal_images_give_exactly_zero(modern, textured):
    velocity = np.full((*textured.shape, 2), 3.0, np.float32)
    for motion in (None, velocity):
        compared = modern.compare(textured, textured.copy(), velocity=motion)
        assert compared.score == compared.percent_visible == 0.0
        assert not compared.jnd.any()


def test_a_local_defect_lights_up_there_only(modern, textured):
    test = textured.copy()
    test[48:72, 64:96] += 30.0
    jnd = modern.compare(test, textured).jnd
    row, column = np.unravel_index(jnd.argmax(), jnd.shape)
    assert 44 <= row < 76
    assert 60 <= column < 100
    assert max(jnd[:16].max(), jnd[-16:].max(), jnd[:, :24].max()) < 0.15 * jnd.max()


def test_holes_do_not_ring(modern, textured):
    valid = np.ones(textured.shape, bool)
    valid[50:70, 60:90] = False
    test = np.where(valid, textured, np.float32(np.nan))
    assert not modern.compare(test, textured, valid=valid).jnd.any()
    worse = np.where(valid, textured, textured + 40)
    assert not modern.compare(worse, textured, valid=valid).jnd.any()


def test_an_error_in_a_dark_corner_counts_by_its_own_light(viewing, modern):
    # The same relative error, in the dark part of the image and in the bright one.
    reference = np.full((128, 160), 80.0, np.float32)
    reference[:, :80] = 4.0
    test = reference.copy()
    test[50:58, 20:28] *= 1.3
    test[50:58, 132:140] *= 1.3
    jnd = modern.compare(test, reference).jnd
    # Not a twentieth, as the luminances; the CSF alone says that less is seen in the dark.
    assert 0.4 < jnd[:, :48].max() / jnd[:, 112:].max() < 1.0


@pytest.mark.parametrize("departure", MetricOptions.departures())
def test_each_departure_can_be_left_out(viewing, modern, textured, departure):
    test = textured.copy()
    test[48:72, 64:96] *= 0.7
    options = MetricOptions.modern().without(departure)
    velocity = np.full((*textured.shape, 2), 3.0, np.float32)
    found = Aqm(viewing, options=options).compare(test, textured, velocity=velocity)
    assert np.isfinite(found.jnd).all()
    assert 0.1 < found.score < 20
    if departure != "transient":
        assert found.score != modern.compare(test, textured, velocity=velocity).score


@pytest.mark.parametrize("shape", [(1, 1), (2, 37), (23, 5)])
def test_any_size(shape):
    height, width = shape
    random = np.random.default_rng(1)
    reference = random.uniform(5, 90, shape).astype(np.float32)
    modern = Aqm(Viewing(640, 480).cropped(width, height), options=MetricOptions.modern())
    found = modern.compare((0.7 * reference).astype(np.float32), reference)
    assert found.jnd.shape == shape
    assert np.isfinite(found.jnd).all()
