"""All methods, task by task in memory: independent random numbers, finite frames near the reference."""

import json

import numpy as np
import pytest

import enfilade
from enfilade.images import read_exr
from enfilade.methods.opener import METHODS, open_method
from enfilade.methods.walkthrough import Walkthrough
from enfilade.records import Provenance
from enfilade.settings import Settings
from support.closed_room import opened_room, room_path
from support.in_memory import run_passes

PATH = room_path(7, (48, 32))
TABLES = {
    "sampling": {"spp": 16},
    "keyframes": {"spacing": 6},
    "decoupled": {"quality": 100.0},
    "masks": {"split_percent": 20.0},
}


class RecordingWalkthrough(Walkthrough):
    """Records the keys of all random numbers."""

    def __init__(self, *args):
        super().__init__(*args)
        self.keys = []

    def random(self, frame, purpose):
        self.keys.append((self.path.numbers[frame], purpose))
        return super().random(frame, purpose)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Walkthrough and results of each method."""
    renderer = opened_room(tmp_path_factory.mktemp("room"))
    walks = {name: RecordingWalkthrough(PATH, Settings.from_tables(TABLES), renderer) for name in METHODS}
    return {name: (walk, run_passes(open_method(name), walk)) for name, walk in walks.items()}


@pytest.mark.parametrize("name", METHODS)
def test_no_stream_of_random_numbers_is_used_twice(runs, name):
    keys = runs[name][0].keys
    assert len(set(keys)) == len(keys) >= len(PATH)


@pytest.mark.parametrize("name", METHODS)
def test_frames_are_those_of_the_reference_up_to_noise(runs, name):
    reference, found = (runs[n][1] for n in ("reference", name))
    assert np.isfinite(found.colors).all()
    np.testing.assert_allclose(found.colors.mean(axis=(1, 2)), reference.colors.mean(axis=(1, 2)), rtol=0.05)
    provenance = np.stack([found.record("frames", frame).provenance for frame in range(len(PATH))])
    found_kinds = set(np.unique(provenance)) - {Provenance.SLOW}
    expected = {Provenance.KEYFRAME}
    if name != "reference":
        expected |= {Provenance.REUSED, Provenance.SPECULAR}
    if name == "paper":
        expected |= {Provenance.DISOCCLUDED}
    if name == "decoupled":  # nearly all that comes into view has an image
        assert (provenance == Provenance.DISOCCLUDED).mean() < 1e-2
        found_kinds -= {Provenance.DISOCCLUDED}
    assert found_kinds == expected


@pytest.mark.parametrize("name", ["decoupled", "paper"])
def test_frames_of_a_pose_that_is_held_reuse_its_first_frame(name, tmp_path):
    opened_room(tmp_path)
    keys = [
        {"time": 0, "eye": [-0.2, 1.3, 0.8], "target": [0, 1.1, -2], "fov": 70},
        {"time": 2, "eye": [0.2, 1.3, 0.8], "target": [0, 1.1, -2], "hold": 2},
        {"time": 6, "eye": [0.4, 1.3, 0.8], "target": [0, 1.1, -2]},
    ]
    path = {"format": "enfilade-path", "fps": 1, "size": [48, 32], "keys": keys}
    (tmp_path / "path.json").write_text(json.dumps(path))
    enfilade.render(
        tmp_path / "scene.xml", tmp_path / "path.json", tmp_path / "run", method=name, settings=TABLES
    )
    for number in (4, 5):
        held = read_exr(tmp_path / "run" / "frames" / f"{number:04d}.exr")
        assert (held["provenance"] == Provenance.REUSED).all()
