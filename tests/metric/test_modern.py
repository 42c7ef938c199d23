"""The modern metric: maps, masking between bands, dark corners, what moves before what."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.metric import Aqm, ModernMetric, Transducer
from enfilade.viewing import Viewing

WIDTH, HEIGHT = 640, 480
VIEWING = Viewing(WIDTH, HEIGHT)
Y, X = np.mgrid[:HEIGHT, :WIDTH]


def cloud():
    spectrum = np.fft.rfft2(np.random.default_rng(0).standard_normal((HEIGHT, WIDTH)))
    radius = np.hypot(np.fft.fftfreq(HEIGHT)[:, None], np.fft.rfftfreq(WIDTH))
    noise = np.fft.irfft2(spectrum / np.maximum(radius, 1.0 / WIDTH) ** 1.1, s=(HEIGHT, WIDTH))
    return 35.0 * np.exp(0.45 * noise / noise.std())


@pytest.fixture(scope="module")
def scene():
    """Clouds with four discs and a thin bright bar, cd/m2."""
    image = cloud()
    for x, y, radius, level in (
        (130, 130, 50, 2.2),
        (480, 110, 60, 0.4),
        (300, 340, 70, 1.8),
        (540, 360, 45, 0.5),
    ):
        image = np.where(np.hypot(X - x, Y - y) < radius, level * image, image)
    image[:, 590:594] *= 2.0
    return np.clip(image, 0.5, 100.0)


def defects(reference):
    """The scene with six known defects, and where each is."""
    test = reference.copy()
    blur = np.zeros(test.shape, bool)
    blur[200:260, 80:150] = True
    test[blur] = scipy.ndimage.gaussian_filter(reference, 2.0)[blur]
    missing = np.hypot(X - 540, Y - 360) < 45
    test[missing] = cloud()[missing]
    edge = np.abs(np.hypot(X - 300, Y - 340) - 70) < 2.5
    test[edge] = reference[(Y // 2) * 2, (X // 2) * 2][edge]
    noise = np.zeros(test.shape, bool)
    noise[60:110, 260:330] = True
    test[noise] *= 1.0 + 0.12 * np.random.default_rng(1).standard_normal(np.count_nonzero(noise))
    bright, dark = np.zeros(test.shape, bool), np.zeros(test.shape, bool)
    bright[430, 60], dark[200:203, 400] = True, True
    test[bright], test[dark] = 100.0, 0.5
    places = {"blur": blur, "missing": missing, "edge": edge, "noise": noise, "bright": bright, "dark": dark}
    return np.clip(test, 0.1, 100.0).astype(np.float32), places


@pytest.fixture(scope="module")
def full():
    return Aqm.modern(VIEWING)


def test_defects_light_up_where_they_are_and_nowhere_else(full, scene):
    test, places = defects(scene)
    compared = full.compare(test, scene.astype(np.float32))
    jnd = compared.jnd
    for where in places.values():
        assert jnd[where].max() > 2.0
    for kind in ("blur", "missing", "noise"):
        assert np.median(jnd[places[kind]]) > 4.0
    # Three sigma of the aperture beyond a defect little is seen, and a degree further nothing.
    away = scipy.ndimage.distance_transform_edt(~np.any(list(places.values()), axis=0))
    assert np.mean(jnd[away > 0.9 * VIEWING.pixels_per_degree] > 1.0) < 0.05
    assert jnd[away > 2.0 * VIEWING.pixels_per_degree].max() < 1.0
    assert compared.percent_visible == pytest.approx(22.9, abs=0.3)  # docs/metric.md


def test_a_pan_hides_upright_bars_and_not_level_ones(full, scene):
    upright, level = (np.cos(2.0 * np.pi * axis / 6.0) for axis in (X, Y))
    left, right = (np.exp(-((X - x) ** 2 + (Y - 240) ** 2) / (2.0 * 30.0**2)) for x in (180, 460))
    test = np.clip(scene * (1.0 + 0.25 * (upright * left + level * right)), 0.1, 100.0).astype(np.float32)
    seen = []
    for speed_deg_s in (0.0, 25.0):
        velocity = np.zeros((HEIGHT, WIDTH, 2), np.float32)
        velocity[..., 0] = speed_deg_s
        jnd = full.compare(test, scene.astype(np.float32), velocity=velocity).jnd
        seen.append((jnd[200:280, 140:220].max(), jnd[200:280, 420:500].max()))
    (upright_still, level_still), (upright_panned, level_panned) = seen
    assert upright_panned < 0.15 * upright_still
    assert level_panned > 0.7 * level_still


def test_a_mask_of_a_neighbouring_band_hides(viewing):
    _, x = np.mgrid[:120, :160] / viewing.pixels_per_degree
    small, hidden = viewing.cropped(160, 120), {}
    for transducer in (Transducer(), Transducer(0.7, 0.0)):
        aqm = Aqm(ModernMetric(small, transducer=transducer))
        scores = []
        for mask in (0.0, 0.5):
            reference = 40.0 * (1 + mask * np.cos(2 * np.pi * 2.0 * x))
            test = reference + 2.0 * np.cos(2 * np.pi * 5.0 * x)
            scores.append(aqm.compare(test.astype(np.float32), reference.astype(np.float32)).score)
        hidden[transducer] = scores[1] / scores[0]
    # The two lie in neighbouring bands: only inhibition by these lets one hide the other.
    assert hidden[Transducer()] < 0.5
    assert hidden[Transducer(0.7, 0.0)] > 0.75


def test_an_error_in_a_dark_corner_counts_by_its_own_light(modern):
    # The same relative error, in the dark part of the image and in the bright one.
    reference = np.full((128, 160), 80.0, np.float32)
    reference[:, :80] = 4.0
    test = reference.copy()
    test[50:58, 20:28] *= 1.3
    test[50:58, 132:140] *= 1.3
    jnd = modern.compare(test, reference).jnd
    # Not a twentieth, as the luminances; the CSF alone says that less is seen in the dark.
    assert 0.4 < jnd[:, :48].max() / jnd[:, 112:].max() < 1.0


@pytest.mark.parametrize("rest_cd_m2", [10.0, 100.0])
def test_a_bright_area_far_away_does_not_hide_a_wide_error_in_the_dark(rest_cd_m2):
    # The bright area begins 3 degrees from the error, beyond the adapting surround and the aperture.
    density = VIEWING.pixels_per_degree
    metric = Aqm.modern(VIEWING.cropped(320, 160))
    y, x = np.mgrid[:160, :320] / density
    blob = 0.3 * np.exp(-((x - 4.0) ** 2 + (y - 2.9) ** 2) / (2.0 * 1.2**2)) * (x < 7.0)
    found = []
    for rest in (2.0, rest_cd_m2):
        reference = np.where(x < 7.0, 2.0, rest)
        test = reference * (1.0 + blob)
        jnd = metric.compare(test.astype(np.float32), reference.astype(np.float32)).jnd
        found.append(jnd[:, x[0] < 5.0].max())
    assert found[0] > 2.0
    assert found[1] == pytest.approx(found[0], rel=0.1)


def caption(*, still):
    """A caption three pixels high before a background at 25 deg/s, and a fine error in it."""
    velocity = np.zeros((128, 160, 2), np.float32)
    velocity[..., 0] = 25.0
    where = np.zeros((128, 160), bool)
    where[62:65, 40:120] = True
    if still:
        velocity[where] = 0.0
    reference = np.full((128, 160), 40.0, np.float32)
    test = reference.copy()
    test[where] += 8.0 * (np.mgrid[:128, :160][1][where] % 4 < 2) - 4.0
    return test, reference, velocity


def test_what_stands_before_motion_is_seen_as_if_all_stood(modern):
    test, reference, velocity = caption(still=True)
    standing = modern.compare(test, reference).jnd
    before_motion = modern.compare(test, reference, velocity=velocity).jnd.max()
    swept = modern.compare(test, reference, velocity=caption(still=False)[2]).jnd.max()
    # Channels see the error a little beyond the caption, where the background moves.
    assert 0.4 * standing.max() < before_motion < standing.max()
    assert swept < 0.3 * standing.max()
    assert before_motion > 2.0 * swept
    at_rest = modern.compare(test, reference, velocity=np.zeros_like(velocity)).jnd
    np.testing.assert_allclose(at_rest, standing, rtol=1e-4)


@pytest.mark.parametrize("ppd", [6.0, 120.0])
def test_any_density(ppd):
    viewing = Viewing(640, 480, distance_m=0.5 * ppd / 27.93).cropped(160, 128)
    modern = Aqm.modern(viewing)
    test, reference, velocity = caption(still=True)
    found = modern.compare(test, reference, velocity=velocity).jnd
    assert np.isfinite(found).all()
    assert found.max() > 0
    assert not modern.compare(reference, reference, velocity=velocity).jnd.any()
