"""sRGB, Rec.709 luminance and the display."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enfilade.errors import InputError
from enfilade.kernels.tone import display_luminance, luminance, srgb_decode, srgb_encode


@pytest.mark.parametrize(
    ("linear", "encoded"),
    # IEC 61966-2-1: the ends, the join of the two parts, mid-grey, and 8-bit 128.
    [(0.0, 0.0), (1.0, 1.0), (0.0031308, 0.04045), (0.18, 0.461356), (0.2158605, 128 / 255)],
)
def test_srgb_values(linear, encoded):
    assert srgb_encode(np.float32([linear])) == pytest.approx(encoded, abs=2e-6)
    assert srgb_decode(np.float32([encoded])) == pytest.approx(linear, abs=2e-6)


@given(st.floats(-1, 16, width=32))
def test_srgb_round_trip(value):
    there = srgb_decode(srgb_encode(np.float32([value])))
    assert there[0] == pytest.approx(value, rel=3e-5, abs=1e-6)  # float32 powers


def test_luminance_weights_sum_to_one():
    assert luminance(np.ones((2, 2, 3), np.float32)) == pytest.approx(1.0)
    assert luminance(np.float32([0, 1, 0])) == pytest.approx(0.7152)


def test_luminance_refuses_other_channels():
    with pytest.raises(InputError, match=r"\(2, 4\)"):
        luminance(np.ones((2, 4), np.float32))


def test_display_is_encoding_then_decoding():
    rng = np.random.default_rng(7)
    rgb = rng.uniform(-0.2, 1.6, (9, 11, 3)).astype(np.float32)
    shown = srgb_decode(np.clip(srgb_encode(rgb * 2.0), 0.0, 1.0))
    expected = luminance(shown.astype(np.float32)) * 99.9 + 0.1
    got = display_luminance(rgb, exposure_ev=1.0, peak_cd_m2=100.0, black_cd_m2=0.1)
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, expected, rtol=1e-5)


def test_display_ends():
    rgb = np.float32([[-1, 0, 0], [0, 0, 0], [1, 1, 1], [9, 9, 9]])
    got = display_luminance(rgb, exposure_ev=0.0, peak_cd_m2=300.0, black_cd_m2=0.5)
    np.testing.assert_allclose(got, [0.5, 0.5, 300, 300], rtol=1e-6)


def test_nan_stays_for_the_metric_to_name():
    rgb = np.float32([[np.nan, 0, 0]])
    assert np.isnan(display_luminance(rgb, exposure_ev=0, peak_cd_m2=100, black_cd_m2=0)).all()
