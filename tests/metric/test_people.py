"""The metric against measured thresholds: the simple targets of ModelFest.

The chain is the published one; these tests hold its errors where they are.
"""

import math

import numpy as np
import pytest

from enfilade.metric import Aqm
from enfilade.metric.pooling import POOLING_EXPONENT
from enfilade.viewing import Viewing

PPD = 120.0
SIZE = 256
MEAN_CD_M2 = 30.0

# Watson and Ahumada 2005, Journal of Vision 5(9): mean sensitivity of 16 observers, -20 log10 of
# contrast, to horizontal Gabors of Gaussian sigma 0.5 deg: (cpd, dB). Stimuli 1 to 8.
GABORS = (
    (1.12, 36.419),
    (2.00, 39.206),
    (2.83, 41.263),
    (4.00, 42.130),
    (5.66, 39.838),
    (8.00, 36.872),
    (11.3, 32.418),
    (16.0, 25.955),
)


@pytest.fixture(scope="module")
def observer():
    distance_m = 2.0
    pitch_m = distance_m * math.tan(math.radians(1)) / PPD
    diagonal_m = pitch_m * SIZE * math.sqrt(2)
    return Aqm(Viewing(SIZE, SIZE, diagonal_m=diagonal_m, distance_m=distance_m))


def sensitivity_db(observer, pattern, contrast=0.01):
    """Without a mask JND are proportional to contrast: one comparison gives the threshold.

    The map is pooled over space per square degree, since observers see the whole target.
    """
    background = np.full((SIZE, SIZE), MEAN_CD_M2, np.float32)
    target = (MEAN_CD_M2 * (1 + contrast * pattern)).astype(np.float32)
    area_deg2 = (SIZE / PPD) ** 2
    jnd = observer.compare(target, background).score * area_deg2 ** (1 / POOLING_EXPONENT)
    return 20 * math.log10(jnd / contrast)


def test_modelfest_gabors(observer):
    assert len(observer.cortex.bands) == 8  # 120 px/deg: two levels more than at 28
    y, x = (np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2) / PPD
    window = np.exp(-(x**2 + y**2) / (2 * 0.5**2))
    error = np.array(
        [
            sensitivity_db(observer, np.cos(2 * np.pi * cpd * y) * window) - measured
            for cpd, measured in GABORS
        ]
    )
    # Eq. 4 was not made for these: 9 dB too low at 1 cpd, 5 dB too high at 16. No gain is fitted.
    assert abs(error.mean()) < 3.0
    assert error.std() < 6.0


def test_jnd_are_proportional_to_contrast_without_a_mask(observer):
    y = (np.arange(SIZE)[:, None] - SIZE / 2) / PPD
    pattern = np.broadcast_to(np.cos(2 * np.pi * 4 * y), (SIZE, SIZE))
    once, twice = (sensitivity_db(observer, pattern, contrast) for contrast in (0.005, 0.01))
    assert once == pytest.approx(twice, abs=0.1)
