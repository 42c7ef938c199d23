"""What has to be alike, what is refused and by which name, and how little memory it takes."""

import json
import tracemalloc
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image

from enfilade.comparison import compare
from enfilade.errors import ImageError
from enfilade.images import encode_video
from enfilade.images.imagefiles import ImageFiles
from enfilade.settings import VideoSettings
from support.sequences import SIZE, Notes, compared, terms, textured, write_run


def video(file, images, fps):
    size = {"width": SIZE[1], "height": SIZE[0]}
    encode_video(file, images, fps=fps, settings=VideoSettings(codec="ffv1"), exposure_ev=0.0, **size)
    return file


def test_fps_is_given_or_the_sequences_or_the_default(sequence, tmp_path):
    folder = sequence("a", [textured()])
    assert compared(folder, folder).viewing.fps == 30.0
    assert compared(folder, folder, fps=60.0).viewing.fps == 60.0
    film = video(tmp_path / "a.mkv", [textured()], Fraction(24))
    assert compared(folder, film).viewing.fps == compared(film, folder).viewing.fps == 24.0


def test_frame_rates_that_differ(tmp_path):
    slow = video(tmp_path / "slow.mkv", [textured()] * 2, Fraction(24))
    fast = video(tmp_path / "fast.mkv", [textured()] * 2, Fraction(30))
    with pytest.raises(ImageError, match=r"24 frames .*slow\.mkv.* 30 .*fast\.mkv.*--fps"):
        compared(slow, fast)
    assert compared(slow, fast, fps=25.0).viewing.fps == 25.0
    ntsc = video(tmp_path / "ntsc.mkv", [textured()] * 2, Fraction(30000, 1001))
    assert compared(ntsc, fast).viewing.fps == pytest.approx(30.0)


def test_a_video_and_its_frames_are_the_same(sequence, tmp_path):
    images = [textured(float(i)) for i in range(3)]
    found = compared(video(tmp_path / "a.mkv", images, 30), sequence("a", images), flow="none")
    assert found.psnr_db > 60.0  # 12 bits
    assert found.score < 0.2


def test_sequences_that_differ_in_length_or_size(sequence, tmp_path):
    one, two = sequence("one", [textured()]), sequence("two", [textured(), textured()])
    with pytest.raises(ImageError, match=r"1 frames .*one.* and the reference 2 .*two"):
        compared(one, two)
    Image.fromarray(np.zeros((10, 20, 3), np.uint8)).save(tmp_path / "small.png")
    with pytest.raises(ImageError, match=r"20x10 .*small\.png.* and the reference's 64x48"):
        compared(tmp_path / "small.png", one)


@pytest.mark.parametrize(
    ("ours", "theirs", "message"),
    [
        (
            (1, 2, 3),
            (11, 12, 13),
            r"test's run has the frame 1 \(.*t/frames/0001\.exr\).*first .*r/frames/0011",
        ),
        ((1, 3, 4), (1, 2, 3), r"reference's run has the frame 2 \(.*r/frames/0002\.exr\)"),
        ((1, 2, 3, 4), (1, 2, 3), r"test's run has the frame 4 \(.*--frames"),
    ],
)
def test_runs_of_other_frames_are_refused(tmp_path, ours, theirs, message):
    test, reference = (
        write_run(tmp_path / name, [textured()] * len(numbers), numbers, selected=range(1, 20))
        for name, numbers in (("t", ours), ("r", theirs))
    )
    with pytest.raises(ImageError, match=message):
        compared(test, reference)


def test_numbers_that_differ_are_paired_in_order_and_that_is_said_once(sequence):
    images = [textured()] * 3
    one, other = sequence("one", images, numbers=(1, 2, 3)), sequence("other", images, numbers=(1, 3, 4))
    notes = Notes()
    assert compared(one, other, notes).score == 0.0
    (said,) = [text for text in notes.said if "numbers differ" in text]
    assert said.endswith(f"{one}/0002.exr with {other}/0003.exr, and so on")
    for pair in ((one, one), (one / "0001.exr", other / "0003.exr")):
        notes = Notes()
        compared(*pair, notes)
        assert not any("numbers differ" in text for text in notes.said)


@pytest.mark.parametrize(
    ("poses", "selected", "is_said"),
    [
        ("a", range(1, 4), False),
        ("b", range(1, 4), True),
        ("b", range(1, 9), False),
        (None, range(1, 4), False),
    ],
)
def test_another_camera_path_is_told(tmp_path, poses, selected, is_said):
    images, numbers = [textured()] * 3, (1, 2, 3)
    test = write_run(tmp_path / "t", images, numbers, poses="a")
    reference = write_run(tmp_path / "r", images, numbers, selected=selected, poses=poses)
    notes = Notes()
    compared(test, reference / "frames" / "*.exr", notes)
    said = [text for text in notes.said if "different camera paths" in text]
    assert len(said) == is_said
    assert all(str(test) in text and str(reference) in text for text in said)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("role", ["test", "reference"])
def test_pixels_that_are_no_numbers_are_named(sequence, value, role):
    bad = textured()
    bad[7, 5] = value
    bad[9, 9, 1] = value
    folders = {
        "test": sequence("test", [textured()] * 2),
        "reference": sequence("reference", [textured()] * 2),
    }
    (folders[role] / "0002.exr").unlink()
    other = sequence("other", [bad])
    (other / "0001.exr").rename(folders[role] / "0002.exr")
    with pytest.raises(ImageError, match=rf"{role}/0002\.exr has 2 pixels .*row 7, column 5"):
        compared(folders["test"], folders["reference"])


def test_negative_values_are_black_and_that_is_said_once(sequence):
    dark = textured()
    dark[:10] = 0.0
    below = dark.copy()
    below[:10] = -0.5
    notes = Notes()
    found = compared(sequence("below", [below] * 3), sequence("dark", [dark] * 3), notes)
    assert found.score == 0.0
    (said,) = [text for text in notes.said if "negative" in text]
    assert "below/0001.exr holds negative values" in said


@pytest.mark.parametrize("flow", ["none", "estimate"])
def test_a_frame_that_cannot_be_read_is_named_when_it_comes(sequence, flow):
    good, bad = sequence("good", [textured()] * 4), sequence("bad", [textured()] * 4)
    file = bad / "0003.exr"
    file.write_bytes(file.read_bytes()[:400])
    seen = []
    with pytest.raises(ImageError, match=r"bad/0003\.exr is cut off or damaged"):
        compare(bad, good, terms(flow=flow), Notes(), show=lambda frames, _: seen.extend(frames))
    with pytest.raises(ImageError, match=r"bad/0003\.exr"):
        compared(good, bad, flow=flow)


def test_transparent_frames_are_named(tmp_path):
    for name, alpha in (("1", 255), ("2", 255), ("3", 200)):
        Image.fromarray(np.full((*SIZE, 4), alpha, np.uint8)).save(tmp_path / f"{name}.png")
    with pytest.raises(ImageError, match=r"3\.png has transparent pixels"):
        compared(tmp_path, tmp_path)


def test_each_frame_is_read_once(sequence, monkeypatch):
    read = []
    from enfilade.images import imagefiles as images

    original = images.read_exr
    monkeypatch.setattr(images, "read_exr", lambda file: read.append(file.name) or original(file))
    test, reference = sequence("t", [textured()] * 5), sequence("r", [textured(0.5)] * 5, flow_px=1.0)
    compared(test, reference)
    later = [name for name in read if name != "0001.exr"]  # the first also tells size and layers
    assert sorted(later) == sorted(2 * [f"{i:04}.exr" for i in range(2, 6)])


@pytest.mark.parametrize("flow", ["none", "estimate"])
def test_memory_does_not_grow_with_the_number_of_frames(tmp_path, flow):
    rng = np.random.default_rng(0)
    files = []
    for i in range(4):
        files.append(tmp_path / f"{i}.png")
        Image.fromarray(rng.integers(0, 256, (120, 160, 3), np.uint8)).save(files[-1])
    peaks = []
    for count in (6, 60):
        sequences = [ImageFiles([files[(i + k) % 4] for i in range(count)]) for k in range(2)]
        peaks.append(_peak_bytes(sequences, flow))
    frame = 120 * 160 * 3 * 4
    assert peaks[1] < peaks[0] + frame


def _peak_bytes(sequences, flow):
    from enfilade.comparison import pairs

    opened = iter(sequences)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pairs, "open_sequence", lambda *_, **__: next(opened))
        tracemalloc.start()
        try:
            compare("test", "reference", terms(mode="paper", flow=flow), Notes())
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()


@pytest.mark.parametrize(
    ("method", "seed", "is_said"), [("reference", 0, True), ("reference", 1, False), ("decoupled", 0, False)]
)
def test_noise_of_one_seed_is_told(tmp_path, method, seed, is_said):
    folders = []
    for name, of_method, of_seed in (("t", "reference", 0), ("r", method, seed)):
        folder = write_run(tmp_path / name, [textured()], [1])
        run = json.loads((folder / "run.json").read_text())
        run["identity"] |= {"method": {"name": of_method}, "settings": {"trace": {"seed": of_seed}}}
        (folder / "run.json").write_text(json.dumps(run))
        folders.append(folder)
    notes = Notes()
    compared(*folders, notes)
    assert any("are of one method and --seed 0" in text for text in notes.said) == is_said
    compared(folders[0], folders[0], itself := Notes())
    assert not any("--seed" in text for text in itself.said)
