"""Flow from layers of each known kind, estimated, or none: the same motion whichever way it is told."""

import numpy as np
import pytest
from PIL import Image

from enfilade.comparison.motion import KINDS
from enfilade.errors import ImageError
from enfilade.images import write_exr
from support.sequences import SIZE, Notes, compared, textured, write_run

RIGHT, DOWN = 3.0, -2.0  # of the surface, pixels per frame


def plane(value):
    return np.full(SIZE, value, np.float32)


def layers_of(kind):
    """Layers as `read_exr` gives them, of a surface that moves by RIGHT, DOWN."""
    motion = np.stack([plane(RIGHT), plane(DOWN)], axis=-1)
    if kind == "own":
        return {"forward": motion, "backward": -motion}
    if kind == "motion":
        return {"motion": motion}
    # Cycles: previous - now in x and (upwards) y, then now - next
    x, y, z, w = -RIGHT, DOWN, -RIGHT, DOWN
    return {f"{kind}": np.stack([plane(x), plane(y), plane(z)], axis=-1), f"{kind}.W": plane(w)}


def flow_of_layers(layers):
    return next((flow for flow in (kind.read(layers) for kind in KINDS) if flow is not None), None)


@pytest.mark.parametrize("kind", ["own", "motion", "Vector", "View Layer.Vector"])
def test_layers_of_each_kind_tell_the_same_motion(kind):
    flow = flow_of_layers(layers_of(kind))
    assert (flow.has_backward, flow.has_forward) == (True, True)
    np.testing.assert_allclose(flow.forward, np.broadcast_to((RIGHT, DOWN), (*SIZE, 2)))
    np.testing.assert_allclose(flow.motion, flow.forward)


def test_the_vector_pass_that_blender_writes_is_read_from_its_file(sequence):
    layers = {f"View Layer.Vector.{c}": plane(v) for c, v in zip("XYZW", (-3, -2, -3, -2), strict=True)}
    notes = Notes()
    folder = sequence("blender", [textured(), textured(3.0)], layers=layers)
    found = compared(folder, folder, notes)
    assert found.flow == "layers"
    assert "Blender's Vector pass" in notes.said[0]
    assert found.frames[0].velocity_deg_s == pytest.approx(found.viewing.velocity_deg_s(np.hypot(3.0, 2.0)))


def test_other_layers_are_no_flow():
    three = np.zeros((*SIZE, 3), np.float32)
    for layers in ({"RGB": three}, {"forward": plane(1.0)}, {"Vector": three}, {"motion": plane(1.0)}):
        assert flow_of_layers(layers) is None


def test_flow_comes_from_the_layers_of_the_reference_or_the_test(sequence):
    plain, told = sequence("plain", [textured(1.0)]), sequence("told", [textured()], flow_px=2.0)
    for test, reference, role in ((plain, told, "reference"), (told, plain, "test")):
        notes = Notes()
        found = compared(test, reference, notes)
        assert found.flow == "layers"
        assert f"the {role}'s layers" in notes.said[0]
        assert found.frames[0].velocity_deg_s == pytest.approx(found.viewing.velocity_deg_s(2.0), rel=1e-5)


def test_without_layers_it_is_estimated_and_that_is_said(tmp_path):
    rng = np.random.default_rng(0)
    wide = np.repeat(np.repeat(rng.integers(40, 200, (24, 40), np.uint8), 4, axis=0), 4, axis=1)
    for i in range(3):
        Image.fromarray(wide[:, 2 * i : 2 * i + 120]).convert("RGB").save(tmp_path / f"{i}.png")
    notes = Notes()
    found = compared(tmp_path, tmp_path, notes)
    assert found.flow == "estimate"
    assert "estimated from the reference" in notes.said[0]
    for frame in found.frames:  # ends included; at the borders it can't be exact
        assert frame.velocity_deg_s == pytest.approx(found.viewing.velocity_deg_s(2.0), rel=0.1)


def test_none_and_a_single_image_stand_still(sequence):
    one = sequence("one", [textured()])
    two = sequence("two", [textured(), textured(2.0)], flow_px=2.0)
    for folder, flow in ((one, "auto"), (one, "estimate"), (two, "none")):
        notes = Notes()
        found = compared(folder, folder, notes, flow=flow)
        assert (found.flow, found.frames[0].velocity_deg_s) == ("none", 0.0)
        assert "compared as static" in notes.said[0]


def test_layers_that_are_asked_for_have_to_be_there(sequence):
    plain = sequence("plain", [textured()])
    with pytest.raises(
        ImageError, match=r"neither .*0001\.exr.* has layers of motion vectors; known are: .*Vector"
    ):
        compared(plain, plain, flow="layers")


def test_layers_that_end_or_hold_a_nan_name_the_frame(sequence):
    ends = sequence("ends", [textured()], flow_px=2.0)
    sequence("rest", [textured(), textured()])
    (ends.parent / "rest" / "0002.exr").rename(ends / "0002.exr")
    with pytest.raises(ImageError, match=r"0002\.exr has no layers forward"):
        compared(ends, ends)
    bad = np.zeros((*SIZE, 2), np.float32)
    bad[3, 4] = np.nan
    broken = sequence("broken", [textured()], layers={"forward": bad, "backward": bad})
    with pytest.raises(ImageError, match=r"0001\.exr has NaN or infinite values in its motion vectors"):
        compared(broken, broken)


def moving_right(step_px):
    """Layers that tell the flow to the next frame alone."""
    return {"motion": across(step_px)}


def test_a_cut_between_shots_that_move_is_found_without_flow_to_the_last_frame(sequence):
    shots = [textured(-2.0 * f, level) for level in (0.1, 0.6) for f in range(3)]
    faulty = [image.copy() for image in shots]
    for f, image in enumerate(faulty):
        image[10:30, 10 + 2 * (f % 3) : 30 + 2 * (f % 3)] *= 0.8  # on its surface
    test, reference = (
        sequence(name, images, layers=moving_right(2.0)) for name, images in (("t", faulty), ("r", shots))
    )
    found = compared(test, reference)
    assert found.flow == "layers"
    assert [f.transient.score for f in found.frames] == pytest.approx([0.0] * 6, abs=1e-3)
    assert min(f.steady.score for f in found.frames) > 0.1


@pytest.mark.parametrize("across_px", [2.0, 20.0, 500.0])
@pytest.mark.parametrize("kind", ["own", "Vector"])
def test_a_cut_that_motion_vectors_lead_across_is_found(tmp_path, kind, across_px):
    """Blender and others write vectors to the neighbours of a frame also where they are of another shot."""
    for name, factor in (("t", 0.8), ("r", 1.0)):
        (tmp_path / name).mkdir()
        for index in range(6):
            f = index % 3
            image = textured(-2.0 * f, 0.1 if index < 3 else 0.6)
            image[10:30, 10 + 2 * f : 30 + 2 * f] *= np.float32(factor)  # on its surface
            back, ahead = (across_px if index == cut else 2.0 for cut in (3, 2))
            layers = {
                "own": {"backward": across(-back), "forward": across(ahead)},
                "Vector": {
                    "Vector": np.stack([plane(-back), plane(0.0), plane(-ahead)], axis=-1),
                    "Vector.W": plane(0.0),
                },
            }[kind]
            write_exr(tmp_path / name / f"{index:04}.exr", {"RGB": image, **layers})
    found = compared(tmp_path / "t", tmp_path / "r")
    assert found.flow == "layers"
    assert [f.transient.score for f in found.frames] == pytest.approx([0.0] * 6, abs=1e-3)
    speed = found.viewing.velocity_deg_s(2.0)
    assert [f.velocity_deg_s for f in found.frames] == pytest.approx([speed] * 6)


def across(step_px):
    return np.broadcast_to(np.float32((step_px, 0.0)), (*SIZE, 2)).copy()


def test_a_frame_without_motion_came_as_the_one_before_and_then_rests(tmp_path):
    places = [0, 4, 8, 12, 12, 12]
    images = [textured(-float(place)) for place in places]
    faulty = [image.copy() for image in images]
    for place, image in zip(places, faulty, strict=True):
        image[10:30, 10 + place : 30 + place] *= 0.8  # on its surface
    for name, frames in (("t", faulty), ("r", images)):
        for number, image in enumerate(frames):
            motion = moving_right(4.0 if number < 3 else 0.0)
            (tmp_path / name).mkdir(exist_ok=True)
            write_exr(tmp_path / name / f"{number:04}.exr", {"RGB": image, **motion})
    found = compared(tmp_path / "t", tmp_path / "r")
    assert [f.transient.score for f in found.frames] == pytest.approx([0.0] * 6, abs=1e-3)
    fast = found.frames[2].velocity_deg_s
    assert [f.velocity_deg_s for f in found.frames] == pytest.approx([*[fast] * 4, 0.0, 0.0])


def test_motion_that_changes_the_whole_image_is_no_cut(sequence):
    panels = np.where(np.arange(SIZE[1] + 64) // 16 % 2, np.float32(0.6), np.float32(0.05))
    shots = [
        np.broadcast_to(panels[64 - 16 * f :][: SIZE[1], None], (*SIZE, 3)).astype(np.float32)
        for f in range(3)
    ]
    faulty = [image * np.float32(0.8 if f == 1 else 1.0) for f, image in enumerate(shots)]
    test, reference = (
        sequence(name, images, layers=moving_right(16.0)) for name, images in (("t", faulty), ("r", shots))
    )
    found = compared(test, reference)
    assert [f.transient.score > 1.0 for f in found.frames] == [False, True, True]


STILL = np.zeros((*SIZE, 2), np.float32)


@pytest.mark.parametrize("levels", [(0.1, 0.6), (0.2, 0.25), (0.004, 0.012)])
def test_what_flickers_at_a_cut_is_not_counted(sequence, levels):
    """Across a cut the error changes altogether, and nobody sees that as flicker."""
    layers = {"forward": STILL, "backward": STILL}
    shots = [textured(level=level) for level in levels for _ in range(2)]
    faulty = [image.copy() for image in shots]
    for image in faulty:
        image[10:30, 10:30] *= 0.5
    test, reference = sequence("t", faulty, layers=layers), sequence("r", shots, layers=layers)
    found = compared(test, reference)
    assert [f.transient.score for f in found.frames] == [0.0] * 4
    assert min(f.steady.score for f in found.frames) > 0.1


def test_a_cut_between_images_without_flow_is_found(sequence):
    shots = [textured(level=level) for level in (0.1, 0.6) for _ in range(2)]
    faulty = [image * np.float32(0.9) for image in shots]
    found = compared(sequence("t", faulty), sequence("r", shots), flow="none")
    assert [f.transient.score for f in found.frames] == pytest.approx([0.0] * 4, abs=1e-3)
    assert min(f.steady.score for f in found.frames) > 0.1


def test_motion_beside_a_rest_is_the_mean_with_no_motion(tmp_path):
    """The camera of a run rests in the first two frames."""
    folder = write_run(tmp_path / "run", [textured()] * 3, (1, 2, 3))
    moving = np.zeros((*SIZE, 2), np.float32)
    moving[..., 0] = 2.0
    for number, backward, forward in ((1, STILL, STILL), (2, STILL, moving), (3, -moving, STILL)):
        layers = {"RGB": textured(), "backward": backward, "forward": forward}
        write_exr(folder / "frames" / f"{number:04}.exr", layers)
    found = compared(folder, folder)
    speed = found.viewing.velocity_deg_s(np.array([0.0, 1.0, 2.0]))
    assert [f.velocity_deg_s for f in found.frames] == pytest.approx(speed, rel=1e-5)


@pytest.mark.parametrize("kind", ["own", "motion"])
def test_layers_of_both_directions_tell_what_was_covered(tmp_path, kind):
    """A square that is too bright uncovers four pixels of the background in each frame."""
    folders = {}
    for name, level in (("t", 0.35), ("r", 0.3)):
        folder = folders[name] = tmp_path / name
        folder.mkdir()
        for number in range(3):
            image, motion = textured(), np.zeros((*SIZE, 2), np.float32)
            where = np.s_[10:30, 4 + 4 * number : 24 + 4 * number]
            image[where], motion[where] = level, (4.0, 0.0)
            layers = {"motion": motion} if kind == "motion" else {"forward": motion, "backward": -motion}
            write_exr(folder / f"{number:04}.exr", {"RGB": image, **layers})
    transient = [f.transient.score for f in compared(folders["t"], folders["r"]).frames]
    assert max(transient) < 0.01 if kind == "own" else min(transient[1:]) > 0.3


def flickering(images):
    """Every other frame has a dark square."""
    faulty = [image.copy() for image in images]
    for image in faulty[1::2]:
        image[10:30, 10:30] *= 0.5
    return faulty


def test_noise_before_a_resting_camera_is_no_cut(sequence):
    rng = np.random.default_rng(4)
    still = textured()
    noisy = [(still * rng.uniform(0.6, 1.4, (*SIZE, 1))).astype(np.float32) for _ in range(3)]
    layers = {"forward": STILL, "backward": STILL}
    test, reference = sequence("t", flickering(noisy), layers=layers), sequence("r", noisy, layers=layers)
    transient = [f.transient.score for f in compared(test, reference).frames]
    assert transient[0] == 0.0
    assert min(transient[1:]) > 0.5


@pytest.mark.parametrize("flow", ["layers", "estimate", "none"])
def test_a_run_says_where_shots_begin_and_what_is_missing(tmp_path, flow):
    """Frame 2 begins a shot that looks like the one before it; 4 and 5 are missing, or were left out."""
    images = [textured()] * 4
    transients = []
    for name, selected in (("gap", range(1, 7)), ("step", (1, 2, 3, 6))):
        options = {"selected": selected, "cuts": [2], "flow_px": 0.5}
        test = write_run(tmp_path / name / "t", flickering(images), (1, 2, 3, 6), **options)
        reference = write_run(tmp_path / name / "r", images, (1, 2, 3, 6), **options)
        found = compared(test, reference, flow=flow)
        transients.append([f.transient.score > 0.1 for f in found.frames])
    assert transients == [[False, False, True, False], [False, False, True, True]]


@pytest.mark.parametrize("flow", ["estimate", "none"])
def test_a_light_that_goes_on_in_a_shot_of_a_run_is_no_cut(tmp_path, flow):
    images = [textured(level=level) for level in (0.1, 0.1, 0.6, 0.6)]
    test = write_run(tmp_path / "t", flickering(images), (1, 2, 3, 4))
    reference = write_run(tmp_path / "r", images, (1, 2, 3, 4))
    transient = [f.transient.score for f in compared(test, reference, flow=flow).frames]
    assert transient[0] == 0.0
    assert min(transient[1:]) > 0.5
