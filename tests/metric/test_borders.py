"""Mirroring and filling."""

import numpy as np
import pytest

from enfilade.metric.borders import MirrorBorder, fill_undefined


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (16, 16), (33, 70)])
def test_mirror_is_numpys_symmetric_padding(shape):
    border = MirrorBorder(*shape, margin_px=32, multiple_px=16)
    image = np.random.default_rng(2).random(shape).astype(np.float32)
    after = [n - length - 32 for n, length in zip(border.padded_shape, shape, strict=True)]
    assert all(n % 16 == 0 for n in border.padded_shape)
    assert min(after) >= 32
    padded = border.pad(image)
    expected = np.pad(image, [(32, after[0]), (32, after[1])], mode="symmetric")
    np.testing.assert_array_equal(padded, expected)
    np.testing.assert_array_equal(border.crop(padded, 1, shape), image)


def test_undefined_pixels_take_the_other_image():
    nan = np.nan
    test = np.float32([[nan, 5.0, nan, 8.0]])
    reference = np.float32([[3.0, nan, nan, 2.0]])
    valid = np.array([[False, False, False, True]])
    filled_test, filled_reference = fill_undefined(test, reference, valid)
    np.testing.assert_array_equal(filled_test, np.float32([[3.0, 5.0, 2.0, 8.0]]))
    np.testing.assert_array_equal(filled_reference, np.float32([[3.0, 5.0, 2.0, 2.0]]))
