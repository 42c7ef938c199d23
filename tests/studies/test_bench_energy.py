"""Energy of a bench by shape."""

import numpy as np
import pytest

from studies.bench.energy import energy_of


def test_energy_of_shapes_and_of_the_whole():
    index = np.repeat(np.uint32([0, 1, 2, 3]), [500, 2000, 4000, 1000])
    light = np.where(index == 1, 2.0, 1.0)[:, None].repeat(3, 1).astype(np.float32)
    halves = np.stack([0.9 * light, 1.1 * light])
    image = np.where((index == 2)[:, None], 1.05, 1.0).astype(np.float32) * light
    whole, shapes = energy_of(image, halves, index, ("lamp", "wall", "small"))
    assert (whole.pixels, whole.ratio) == (7500, pytest.approx(1.0 + 0.05 * 4000 / 9500))
    assert [(s.name, s.pixels) for s in shapes] == [("lamp", 2000), ("wall", 4000)]
    assert [s.ratio for s in shapes] == pytest.approx([1.0, 1.05])
    assert [s.error for s in shapes] == pytest.approx([0.1, 0.1])
