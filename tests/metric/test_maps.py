"""Maps of the modern mode: defects light up where they are and nowhere else; a pan hides upright bars."""

import numpy as np
import pytest
import scipy.ndimage

from enfilade.metric import MetricOptions, SequenceAqm
from enfilade.viewing import Viewing

WIDTH, HEIGHT = 640, 480
VIEWING = Viewing(WIDTH, HEIGHT)
Y, X = np.mgrid[:HEIGHT, :WIDTH]


def cloud():
    spectrum = np.fft.rfft2(np.random.default_rng(0).standard_normal((HEIGHT, WIDTH)))
    radius = np.hypot(np.fft.fftfreq(HEIGHT)[:, None], np.fft.rfftfreq(WIDTH))
    noise = np.fft.irfft2(spectrum / np.maximum(radius, 1.0 / WIDTH) ** 1.1, s=(HEIGHT, WIDTH))
    return 35.0 * np.exp(0.45 * noise / noise.std())


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
def still():
    reference = scene()
    test, places = defects(reference)
    found = {
        name: SequenceAqm(VIEWING, options=options).judge(test, reference.astype(np.float32))
        for name, options in (
            ("modern", MetricOptions.modern()),
            ("unpooled", MetricOptions.modern().without("spatial_pooling")),
        )
    }
    return found, places


@pytest.mark.parametrize("name", ["modern", "unpooled"])
def test_defects_light_up_where_they_are_and_nowhere_else(still, name):
    found, places = still
    jnd = found[name].jnd
    for where in places.values():
        assert jnd[where].max() > 2.0
    for kind in ("blur", "missing", "noise"):
        assert np.median(jnd[places[kind]]) > 4.0
    # Three sigma of the aperture beyond a defect little is seen, and a degree further nothing.
    away = scipy.ndimage.distance_transform_edt(~np.any(list(places.values()), axis=0))
    assert np.mean(jnd[away > 0.9 * VIEWING.pixels_per_degree] > 1.0) < 0.05
    assert jnd[away > 2.0 * VIEWING.pixels_per_degree].max() < 1.0


def test_gathering_widens_what_is_visible(still):
    # The figures that docs/compare.md has.
    assert still[0]["modern"].percent_visible == pytest.approx(22.9, abs=0.3)
    assert still[0]["unpooled"].percent_visible == pytest.approx(15.7, abs=0.3)


def test_a_pan_hides_upright_bars_and_not_level_ones():
    reference = scene()
    upright, level = (np.cos(2.0 * np.pi * axis / 6.0) for axis in (X, Y))
    left, right = (np.exp(-((X - x) ** 2 + (Y - 240) ** 2) / (2.0 * 30.0**2)) for x in (180, 460))
    test = np.clip(reference * (1.0 + 0.25 * (upright * left + level * right)), 0.1, 100.0).astype(np.float32)
    seen = {}
    for speed_deg_s in (0.0, 25.0):
        flow_px = np.zeros((HEIGHT, WIDTH, 2), np.float32)
        flow_px[..., 0] = -VIEWING.flow_px(speed_deg_s)
        jnd = SequenceAqm(VIEWING).judge(test, reference.astype(np.float32), backward_flow_px=flow_px).jnd
        seen[speed_deg_s] = jnd[200:280, 140:220].max(), jnd[200:280, 420:500].max()
    assert seen[25.0][0] < 0.15 * seen[0.0][0]
    assert seen[25.0][1] > 0.7 * seen[0.0][1]
