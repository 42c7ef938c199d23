"""Images, viewing conditions and both modes of the metric."""

import numpy as np
import pytest

from enfilade.metric import Aqm
from enfilade.viewing import Viewing


@pytest.fixture(scope="session")
def viewing():
    """A 160x128 window of the paper's screen, 27.93 pixels per degree."""
    return Viewing(640, 480).cropped(160, 128)


@pytest.fixture(scope="session")
def paper(viewing):
    return Aqm.paper(viewing)


@pytest.fixture(scope="session")
def modern(viewing):
    return Aqm.modern(viewing)


@pytest.fixture(params=["paper", "modern"])
def aqm(request, paper, modern):
    """Either mode."""
    return paper if request.param == "paper" else modern


@pytest.fixture(scope="session")
def textured():
    """A room-like image: panels of different brightness with smooth random texture, cd/m2."""
    rng = np.random.default_rng(11)
    grain = rng.standard_normal((128, 160))
    for axis in (0, 1):
        grain = sum(np.roll(grain, shift, axis) for shift in (-2, -1, 0, 1, 2)) / 5
    panels = 35.0 + 15.0 * (np.arange(160) // 40 % 2) + 8.0 * (np.arange(128) // 32 % 2)[:, None]
    return (panels + 20.0 * grain).clip(2.0).astype(np.float32)
