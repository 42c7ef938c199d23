"""Borders, uniform differences, and the inputs that they rest on."""

import numpy as np
import pytest

from enfilade.metric.channels import ChannelBank, uniform_part
from enfilade.metric.inputs import fill_undefined
from enfilade.viewing import Viewing


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (16, 16), (33, 70)])
def test_images_are_mirrored_at_their_borders(shape):
    bank = ChannelBank(Viewing(640, 480).cropped(*shape[::-1]))
    image = np.random.default_rng(2).random(shape).astype(np.float32)
    padded = bank.pad(image)
    margin = 32  # a period of the lowest ring, 1/32 cycles per pixel
    after = [n - length - margin for n, length in zip(padded.shape, shape, strict=True)]
    assert min(after) >= margin
    assert all(n % (2 * bank.bands[-1].reduction) == 0 for n in padded.shape)
    expected = np.pad(image, [(margin, after[0]), (margin, after[1])], mode="symmetric")
    np.testing.assert_array_equal(padded, expected)
    np.testing.assert_array_equal(bank.crop(padded, bank.bands[0]), image)


def test_the_uniform_part_is_the_median_where_it_is_contained():
    difference = np.float32([[3.0, 2.0, -1.0, 9.0], [1.0, 2.0, 0.0, 9.0]])
    found = uniform_part(difference, np.array([[True, True, True], [True, False, True]]))
    np.testing.assert_array_equal(found, np.float32([[1.0, 1.0, 0.0, 1.0], [1.0, 1.0, 0.0, 1.0]]))
    assert not uniform_part(difference, np.zeros((2, 3), bool)).any()


def test_undefined_pixels_take_the_other_image():
    nan = np.nan
    test = np.float32([[nan, 5.0, nan, 8.0]])
    reference = np.float32([[3.0, nan, nan, 2.0]])
    valid = np.array([[False, False, False, True]])
    filled_test, filled_reference = fill_undefined(test, reference, valid)
    np.testing.assert_array_equal(filled_test, np.float32([[3.0, 5.0, 2.0, 8.0]]))
    np.testing.assert_array_equal(filled_reference, np.float32([[3.0, 5.0, 2.0, 2.0]]))
