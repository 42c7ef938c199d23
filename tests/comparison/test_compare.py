"""Sequences are compared frame by frame, with the flow that comes with them."""

import json
import math
import shutil

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from enfilade.comparison import CompareOptions, compare
from enfilade.errors import ImageError, InputError, SettingsError
from enfilade.metric import SequenceAqm
from enfilade.viewing import display_named
from support.sequences import SIZE, Notes, compared, terms, textured


@pytest.mark.parametrize("mode", ["paper", "modern"])
@pytest.mark.parametrize("flow", ["none", "estimate"])
def test_equal_sequences_have_exactly_no_difference(sequence, mode, flow):
    folder = sequence("a", [textured(2.0 * i) for i in range(4)])
    found = compared(folder, folder, mode=mode, flow=flow)
    assert found.score == 0.0
    assert [f.percent_visible for f in found.frames] == [0.0] * 4
    assert not any(any(part.band_jnd) for f in found.frames for part in (f.steady, f.transient))
    assert found.psnr_db == math.inf
    as_json = found.to_dict()
    assert (as_json["psnr_db"], as_json["meaning"]) == (None, "identical")


@pytest.mark.parametrize("mode", ["paper", "modern"])
def test_a_visible_difference_is_found_in_its_frame(sequence, mode):
    good = [textured(), textured(), textured()]
    bad = [textured(), textured(3.0), textured()]
    found = compared(sequence("bad", bad), sequence("good", good), mode=mode, flow="none").to_dict()
    assert found["per_frame"][0]["score_jnd"] == 0.0
    assert found["per_frame"][1]["percent_visible"] > 50.0
    assert found["worst_frame"] == 1
    assert found["percent_visible"]["most"] == found["per_frame"][1]["percent_visible"]
    assert 0.0 < found["score_jnd"] < found["per_frame"][1]["score_jnd"]


def test_flicker_counts_as_transient_and_blur_as_steady(sequence):
    rng = np.random.default_rng(5)
    still = textured()
    blurred = np.stack([gaussian_filter(still[..., c], 2.0) for c in range(3)], axis=-1)
    noisy = [np.clip(still + rng.normal(0.0, 0.05, (*SIZE, 1)), 0, 1).astype(np.float32) for _ in range(4)]
    reference = sequence("reference", [still] * 4)
    blur = compared(sequence("blur", [blurred] * 4), reference, flow="none").to_dict()
    noise = compared(sequence("noise", noisy), reference, flow="none").to_dict()
    assert blur["transient_jnd"] < 0.01 * blur["steady_jnd"]
    assert noise["transient_jnd"] > 0.2 * noise["steady_jnd"]


def test_psnr_is_that_of_the_encoded_images(sequence):
    white, black = np.ones((*SIZE, 3), np.float32), np.zeros((*SIZE, 3), np.float32)
    found = compared(sequence("white", [white, white]), sequence("black", [black, white]), flow="none")
    assert found.psnr_db == pytest.approx(10.0 * math.log10(2.0))  # one of two frames is wrong by 1


@pytest.mark.parametrize("fault", ["blur", "noise", "object"])
def test_swapping_changes_little(sequence, fault):
    rng = np.random.default_rng(8)
    good = [textured(0.7 * i) for i in range(3)]
    bad = [image.copy() for image in good]
    for image in bad:
        if fault == "blur":
            image[12:36, 16:48] = gaussian_filter(image[12:36, 16:48], (2, 2, 0))
        elif fault == "noise":
            image[...] = np.clip(image + rng.normal(0.0, 0.02, (*SIZE, 1)), 0.0, 1.0)
        else:
            image[20:28, 30:38] *= 0.6
    one, other = sequence("bad", bad), sequence("good", good)
    screen = display_named("paper")
    there, back = (compared(*pair, display=screen).score for pair in ((one, other), (other, one)))
    assert there > 0.2
    assert back == pytest.approx(there, rel=0.1)  # docs/metric.md


def test_a_frame_at_the_end_of_a_shot_moves_as_fast_as_the_others(sequence):
    forward = np.full((*SIZE, 2), 2.0, np.float32)
    folder = sequence("a", [textured()], layers={"forward": forward, "backward": np.zeros_like(forward)})
    found = compared(folder, folder)
    expected = found.viewing.velocity_deg_s(math.hypot(2.0, 2.0))
    assert found.frames[0].velocity_deg_s == pytest.approx(expected, rel=1e-5)


def test_fast_motion_hides_what_is_seen_at_rest_by_a_resting_eye(sequence):
    reference = sequence("still", [textured()])
    moving = sequence("moving", [textured()], flow_px=40.0)
    test = sequence("test", [textured(0.2)])
    scores = [compared(test, r, pursuit="none").score for r in (moving, reference)]
    assert scores[0] < scores[1]


def test_exposure_is_for_scene_linear_frames_alone(sequence, tmp_path):
    dark = sequence("dark", [np.full((*SIZE, 3), 0.25, np.float32)])
    shown = np.full((*SIZE, 3), 188, np.uint8)  # sRGB of 0.5
    Image.fromarray(shown).save(tmp_path / "shown.png")
    found = compared(tmp_path / "shown.png", dark, exposure_ev=1.0)
    assert found.frames[0].percent_visible == 0.0
    assert found.psnr_db > 45.0
    with pytest.raises(ImageError, match="leave out --exposure-ev"):
        compared(tmp_path / "shown.png", tmp_path / "shown.png", exposure_ev=1.0)


def run_of(folder, exposure_ev):
    """The folder's frames as those of a run that is shown at so many stops."""
    run = folder.with_name(f"run{exposure_ev:+g}")
    shutil.copytree(folder, run / "frames")
    settings = {"viewing": {"exposure_ev": exposure_ev}}
    (run / "run.json").write_text(json.dumps({"identity": {"path": {"fps": 30.0}}}))
    (run / "job.json").write_text(json.dumps({"settings": settings}))
    return run


def test_a_run_is_shown_at_its_own_exposure(sequence, tmp_path):
    dark = sequence("dark", [np.full((*SIZE, 3), 0.25, np.float32)])
    brighter, same = run_of(dark, 1.0), run_of(dark, 0.0)
    Image.fromarray(np.full((*SIZE, 3), 188, np.uint8)).save(tmp_path / "shown.png")  # sRGB of 0.5
    assert compared(tmp_path / "shown.png", brighter).psnr_db > 45.0
    assert compared(brighter, dark).psnr_db == math.inf  # scene-linear frames beside a run take its exposure
    assert compared(tmp_path / "shown.png", same).psnr_db < 20.0
    assert compared(tmp_path / "shown.png", brighter, exposure_ev=0.0).psnr_db < 20.0
    with pytest.raises(ImageError, match=r"\+1 stops.*\+0.*--exposure-ev"):
        compared(brighter, same)
    assert compared(brighter, same, exposure_ev=0.0).psnr_db == math.inf


def test_the_slope_of_masking_counts_in_the_papers_mode(sequence):
    random = np.random.default_rng(3)
    texture = random.uniform(0.1, 0.9, (*SIZE, 1)).repeat(3, axis=2).astype(np.float32)
    folder, other = sequence("a", [texture]), sequence("b", [np.roll(texture, 1, axis=0)])
    scores = {
        (mode, slope): compared(folder, other, mode=mode, mask_slope=slope).score
        for mode in ("paper", "modern")
        for slope in (0.0, 0.7)
    }
    assert scores["paper", 0.0] > 2.0 * scores["paper", 0.7]
    assert scores["modern", 0.0] == scores["modern", 0.7]


def test_maps_are_shown_as_they_come(sequence):
    kept = []
    folder, other = sequence("a", [textured(), textured()]), sequence("b", [textured(3.0), textured()])

    def show(frames, viewing):
        assert (viewing.width_px, viewing.height_px) == SIZE[::-1]
        kept.extend(frames)

    compare(folder, other, terms(flow="none"), Notes(), show=show)
    first, second = kept
    assert (first.difference.number, second.difference.number) == (1, 2)
    assert first.jnd.shape == first.grey.shape == SIZE
    assert first.jnd.max() > 1.0
    assert second.difference.steady.score == 0.0


def test_the_screen_is_said_where_none_is_named(sequence):
    folder = sequence("a", [textured()])
    for display, said in ((None, True), (display_named("phone"), False)):
        notes = Notes()
        compared(folder, folder, notes, display=display)
        assert any("fills a diagonal of 0.25 m" in line for line in notes.said) == said


def test_a_display_shows_pixel_for_pixel(sequence):
    folder = sequence("a", [textured()])
    display = display_named("desktop-24-fhd")
    found = compared(folder, folder, display=display)
    assert found.viewing.pixels_per_degree == pytest.approx(display.pixels_per_degree)
    assert found.viewing.peak_cd_m2 == 200.0


def test_a_display_may_be_named(sequence):
    folder = sequence("a", [textured()])
    given = [compared(folder, folder, display=of).viewing for of in ("phone", display_named("phone"))]
    assert given[0] == given[1]
    with pytest.raises(InputError, match="unknown display 'fridge'"):
        compared(folder, folder, display="fridge")


def test_what_the_metric_refuses_names_the_frame(sequence, monkeypatch):
    folder = sequence("a", [textured()])

    def refuse(*_arguments, **_options):
        raise InputError("metric: no")

    monkeypatch.setattr(SequenceAqm, "compare", refuse)
    with pytest.raises(ImageError, match=r"0001\.exr can't be compared: metric: no"):
        compared(folder, folder)


@pytest.mark.parametrize(("name", "value"), [("flow", "no"), ("mode", "moden")])
def test_an_unknown_mode_or_flow_is_refused_with_the_known_ones(name, value):
    with pytest.raises(SettingsError, match=f"{name} = '{value}': choose one of "):
        CompareOptions(**{name: value})
