"""Sequences are compared frame by frame, with the flow that comes with them."""

import math

import numpy as np
import pytest
from PIL import Image

from enfilade.codec import write_exr
from enfilade.errors import ImageError
from enfilade.monitor import Silence
from enfilade.pipeline.compare import compare, psnr_db
from enfilade.settings import MetricSettings, ViewingSettings

SIZE = (48, 64)


class Notes(Silence):
    def __init__(self):
        self.said = []

    def say(self, text):
        self.said.append(text)


def textured(shift=0.0, level=0.2):
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    grey = level * (1.0 + 0.5 * np.sin(0.8 * (x + shift)) * np.cos(0.6 * y))
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


@pytest.fixture
def sequence(tmp_path):
    def write(name, images, flow_px=None):
        folder = tmp_path / name
        folder.mkdir()
        for i, image in enumerate(images, 1):
            layers = {"RGB": image}
            if flow_px is not None:
                forward = np.zeros((*SIZE, 2), np.float32)
                forward[..., 0] = flow_px
                layers |= {"forward": forward, "backward": -forward}
            write_exr(folder / f"{i:04}.exr", layers)
        return folder

    return write


def judged(test, reference, monitor=None, **options):
    conditions = {"viewing": ViewingSettings(), "metric": MetricSettings(), **options}
    return compare(test, reference, monitor or Silence(), **conditions)


def test_equal_sequences_have_no_difference(sequence):
    folder = sequence("a", [textured(), textured(2.0)])
    found = judged(folder, folder)
    assert [f.percent_visible for f in found.frames] == [0.0, 0.0]
    assert [f.score for f in found.frames] == [0.0, 0.0]
    assert found.psnr_db == math.inf
    assert found.to_dict()["psnr_db"] is None


def test_a_visible_difference_is_found_in_its_frame(sequence):
    good = [textured(), textured(), textured()]
    bad = [textured(), textured(3.0), textured()]
    found = judged(sequence("bad", bad), sequence("good", good)).to_dict()
    assert [f["percent_visible"] > 50.0 for f in found["per_frame"]] == [False, True, False]
    assert found["percent_visible"]["most"] == found["per_frame"][1]["percent_visible"]
    assert found["percent_visible"]["mean"] == pytest.approx(found["percent_visible"]["most"] / 3.0)


def test_psnr_is_that_of_the_encoded_images(sequence):
    white, black = np.ones((*SIZE, 3), np.float32), np.zeros((*SIZE, 3), np.float32)
    found = judged(sequence("white", [white, white]), sequence("black", [black, white]))
    assert found.psnr_db == pytest.approx(10.0 * math.log10(2.0))  # one of two frames is wrong by 1
    assert psnr_db(0.01) == pytest.approx(20.0)


def test_without_flow_everything_stands_still_and_that_is_said(sequence):
    notes = Notes()
    folder = sequence("a", [textured()])
    found = judged(folder, folder, notes)
    assert not found.has_flow
    assert found.frames[0].velocity_deg_s == 0.0
    assert len(notes.said) == 1
    assert "stood still" in notes.said[0]


def test_flow_comes_from_the_layers(sequence):
    notes = Notes()
    test = sequence("test", [textured(1.0)])
    found = judged(test, sequence("reference", [textured()], flow_px=2.0), notes)
    assert found.has_flow
    assert notes.said == []
    assert found.frames[0].velocity_deg_s == pytest.approx(found.viewing.velocity_deg_s(2.0), rel=1e-5)


def test_a_frame_at_the_end_of_a_shot_moves_as_fast_as_the_others(tmp_path):
    forward = np.full((*SIZE, 2), 2.0, np.float32)
    layers = {"RGB": textured(), "forward": forward, "backward": np.zeros_like(forward)}
    write_exr(tmp_path / "1.exr", layers)
    found = judged(tmp_path / "1.exr", tmp_path / "1.exr")
    expected = found.viewing.velocity_deg_s(math.hypot(2.0, 2.0))
    assert found.frames[0].velocity_deg_s == pytest.approx(expected, rel=1e-5)


def test_fast_motion_hides_what_is_seen_at_rest_by_a_resting_eye(sequence):
    reference = sequence("still", [textured()])
    moving = sequence("moving", [textured()], flow_px=40.0)
    test = sequence("test", [textured(0.2)])
    resting = {"metric": MetricSettings.from_table({"metering": "none"})}
    assert (
        judged(test, moving, **resting).frames[0].score < judged(test, reference, **resting).frames[0].score
    )


def test_exposure_is_for_scene_linear_frames_alone(sequence, tmp_path):
    dark = sequence("dark", [np.full((*SIZE, 3), 0.25, np.float32)])
    shown = np.full((*SIZE, 3), 188, np.uint8)  # sRGB of 0.5
    Image.fromarray(shown).save(tmp_path / "shown.png")
    found = judged(tmp_path / "shown.png", dark, viewing=ViewingSettings(exposure_ev=1.0))
    assert found.frames[0].percent_visible == 0.0
    assert found.psnr_db > 45.0


def test_maps_are_handed_over(sequence):
    kept = {}
    folder = sequence("a", [textured(), textured()])
    judged(folder, sequence("b", [textured(3.0), textured()]), keep_map=kept.__setitem__)
    first, second = kept.values()
    assert first.shape == SIZE
    assert first.max() > 0.9
    assert second.max() == 0.0


def test_fps_is_given_or_the_default(sequence):
    folder = sequence("a", [textured()])
    assert judged(folder, folder).viewing.fps == 30.0
    assert judged(folder, folder, fps=60.0).viewing.fps == 60.0


def test_sequences_that_differ_in_length_or_size(sequence, tmp_path):
    one, two = sequence("one", [textured()]), sequence("two", [textured(), textured()])
    with pytest.raises(ImageError, match="1 frames and the reference 2"):
        judged(one, two)
    Image.fromarray(np.zeros((10, 20, 3), np.uint8)).save(tmp_path / "small.png")
    with pytest.raises(ImageError, match="20x10 and the reference's 64x48"):
        judged(tmp_path / "small.png", one)
