"""R'G'B' and Y'CbCr: the numbers of BT.709, and there and back."""

from __future__ import annotations

import numpy as np
import pytest

from enfilade.images.ycbcr import BT709, DITHER, planes_from_rgb, quantized, rgb_from_planes

# 100 % bars, Y' Cb Cr of 8 bits: ITU-R BT.709-6 items 3.2-3.4 worked out by hand
BARS = {
    (1, 1, 1): (235, 128, 128),
    (0, 0, 0): (16, 128, 128),
    (1, 0, 0): (63, 102, 240),
    (0, 1, 0): (173, 42, 26),
    (0, 0, 1): (32, 240, 118),
}


@pytest.mark.parametrize(("rgb", "expected"), BARS.items())
@pytest.mark.parametrize("is_halved", [False, True])
def test_primaries_have_the_numbers_of_the_standard_and_dither_keeps_the_mean(rgb, expected, is_halved):
    image = np.broadcast_to(np.float32(rgb), (32, 48, 3))
    for bits in (8, 10, 16):
        exact = planes_from_rgb(image, bits=bits, is_halved=is_halved)
        for plane, number in zip(exact, expected, strict=True):
            assert plane.dtype == (np.uint8 if bits == 8 else np.uint16)
            assert abs(plane.astype(float) / 2 ** (bits - 8) - number).max() <= 0.5
    dithered = planes_from_rgb(image, bits=8, is_halved=is_halved, is_dithered=True)
    for plane, code, number in zip(dithered, exact, expected, strict=True):
        wanted = code[0, 0] / 256
        assert plane.mean() == pytest.approx(wanted, abs=1 / 128)  # a threshold in 64
        assert np.ptp(plane) <= (wanted != number)  # white, black and grey are codes


def test_a_dithered_ramp_has_no_bands():
    # Eight codes over 512 pixels: rounding alone is off by up to half a code over 64 pixels.
    wanted = np.linspace(100, 108, 512, dtype=np.float32)
    grey = np.broadcast_to(((wanted - 16) / 219)[None, :, None], (8, 512, 3))
    errors = []
    for is_dithered in (False, True):
        luma, *chroma = planes_from_rgb(grey, bits=8, is_halved=True, is_dithered=is_dithered)
        means = luma.reshape(8, 64, 8).mean(axis=(0, 2)) - wanted.reshape(64, 8).mean(axis=1)
        errors.append(abs(means).max())
        assert all((plane == 128).all() for plane in chroma)
    assert errors[0] > 0.4
    assert errors[1] < 0.04
    np.testing.assert_allclose(np.sort(DITHER.ravel()), (np.arange(64) + 0.5) / 64 - 0.5)  # mean 0


def test_there_and_back_within_rounding():
    image = np.random.default_rng(1).random((33, 47, 3), np.float32)
    for bits in (8, 10):
        planes = planes_from_rgb(image, bits=bits, is_halved=False)
        back = rgb_from_planes(planes, bits=bits, weights=BT709, is_full_range=False)
        # half a step of luma and of chroma, chroma weighted by at most 1.8556
        assert abs(back - image).max() < (0.5 / 219 + 1.9 * 0.5 / 224) / 2 ** (bits - 8) + 1e-4


@pytest.mark.parametrize(("height", "width"), [(1, 1), (2, 2), (5, 7), (6, 7), (5, 8), (16, 16)])
def test_half_chroma_of_any_size_follows_a_ramp(height, width):
    y, x = np.mgrid[:height, :width]
    ramp = np.stack([x, y, x + y], axis=2).astype(np.float32) / np.float32(2 * max(height, width))
    planes = planes_from_rgb(ramp, bits=16, is_halved=True)
    assert planes[1].shape == ((height + 1) // 2, (width + 1) // 2)
    back = rgb_from_planes(planes, bits=16, weights=BT709, is_full_range=False)
    assert back.shape == ramp.shape
    assert abs(back - ramp)[2:-2, 2:-2].max(initial=0) < 1e-3  # linear filters reproduce linear values


def test_rounding_is_to_the_nearest_and_clipped():
    values = np.float32([-1, 0, 0.49, 0.5, 254.6, 300])
    np.testing.assert_array_equal(quantized(values, 8, unit=1.0), [0, 0, 0, 1, 255, 255])
