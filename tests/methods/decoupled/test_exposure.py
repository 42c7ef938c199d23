"""The unit of radiance: a brighter scene at a lower exposure is the same picture."""

import numpy as np
import pytest

from enfilade.methods.decoupled import Decoupled
from support.closed_room import opened_room, room_path
from support.in_memory import run_passes, walk_of

RADIANCE = 1.5
PATH = room_path(4)


def frames(folder, stops, denoiser):
    """Frames of a room whose lamp is brighter by some stops, at an exposure lower by as many."""
    renderer = opened_room(folder, radiance=RADIANCE * 2.0**stops)
    tables = {
        "viewing": {"exposure_ev": -float(stops)},
        "keyframes": {"spacing": 2},
        "decoupled": {"denoiser": denoiser},
    }
    return run_passes(Decoupled(), walk_of(PATH, renderer, **tables)).colors * 2.0**-stops


@pytest.mark.parametrize("denoiser", ["none", "balanced"])
def test_frames_scale_with_the_light(tmp_path, denoiser):
    # Half floats of shaded frames may be rounded to the next one.
    expected = frames(tmp_path, 0, denoiser)
    for stops in (-6, 6):
        found = frames(tmp_path, stops, denoiser)
        assert (np.abs(found - expected) / (expected + 0.01)).max() < 1e-3
