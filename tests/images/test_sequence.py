"""Sequences: the files of a source in order, the beauty layer, and sources that are refused by name."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from enfilade.errors import ImageError
from enfilade.images import open_sequence, write_exr

PLANE = np.full((4, 6), 0.5, np.float32)


def exr(file, value=0.5, size=(4, 6)):
    write_exr(file, {"RGB": np.full((*size, 3), value, np.float32), "Z": np.ones(size, np.float32)})


def means(sequence):
    return [round(float(frame.mean()), 4) for frame in sequence]


def test_a_folder_is_read_in_natural_order(tmp_path):
    for name, value in (("-0002", 1), ("-0001", 2), ("0000", 3), ("0009", 4), ("9999", 5), ("10000", 6)):
        exr(tmp_path / f"{name}.exr", value)
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / ".0001.writing-host-1-01234567.exr").write_text("")
    sequence = open_sequence(tmp_path)
    assert means(sequence) == means(sequence) == [1, 2, 3, 4, 5, 6]
    assert (len(sequence), sequence.width, sequence.height, sequence.fps) == (6, 6, 4, None)
    assert sequence.name(1).endswith("-0001.exr")
    assert set(sequence.layers(0)) == {"RGB", "Z"}


@pytest.mark.parametrize(
    ("names", "listed"),
    [
        (("beauty.01", "beauty.02", "albedo.01"), r"\(albedo\.#\.exr, beauty\.#\.exr\).*/albedo\.#\.exr or"),
        (("s1-01", "s1-02", "s2-01", "s2-02"), r"\(s1-#\.exr, s2-#\.exr\)"),
        (("1", "2", "preview"), r"\(#\.exr, preview\.exr\)"),
        ([f"{c}-01" for c in "abcdefghi"], r"\(a-#.*, f-#\.exr, \.\.\.\)"),
    ],
)
def test_a_folder_of_two_sequences_is_not_taken_for_one(tmp_path, names, listed):
    for name in names:
        exr(tmp_path / f"{name}.exr")
    with pytest.raises(ImageError, match=rf"differ in more than a number {listed}.*/\*\.exr"):
        open_sequence(tmp_path)
    assert len(open_sequence(tmp_path / "*.exr")) == len(names)


@pytest.mark.parametrize("name", ["%04d", "%d", "####", "#", "*", "**", "[0-9]*"])
def test_patterns(tmp_path, name):
    for number in (1, 2, 10):
        exr(tmp_path / f"shot-{number}.exr", number)
        exr(tmp_path / f"other{number}.exr", 0)
    sequence = open_sequence(str(tmp_path / f"shot-{name}.exr"))
    assert (means(sequence), sequence.numbers) == ([1, 2, 10], (1, 2, 10))


def test_numbers_are_those_that_vary_in_the_names_if_they_rise(tmp_path):
    cases = {
        ("-0002", "-0001", "0000", "0003"): (-2, -1, 0, 3),
        ("shot2-0009", "shot2-0010"): (9, 10),
        ("0001-v2", "0002-v2"): (1, 2),
        ("a7", "b6"): None,
        ("1", "end"): None,
    }
    for index, (names, numbers) in enumerate(cases.items()):
        (tmp_path / str(index)).mkdir()
        for name in names:
            exr(tmp_path / str(index) / f"{name}.exr")
        assert open_sequence(tmp_path / str(index) / "*.exr").numbers == numbers
        assert numbers is None or open_sequence(tmp_path / str(index)).numbers == numbers


@pytest.mark.parametrize(
    ("selected", "cuts", "starts"),
    [
        (range(1, 12), [2], {1, 2, 3}),
        ((1, 2, 5, 11), [5], {2}),
        ((1, 2, 5, 11), [], set()),
        (None, [], None),
    ],
)
def test_a_run_states_its_rate_and_where_shots_begin(tmp_path, selected, cuts, starts):
    (tmp_path / "frames").mkdir()
    for number in (1, 2, 5, 11):
        exr(tmp_path / "frames" / f"{number:04}.exr", number)
        Image.new("RGB", (6, 4)).save(tmp_path / "frames" / f"{number:04}.png")  # a heatmap
    path = {"fps": 23.976, "frames": None if selected is None else list(selected), "cuts": cuts}
    (tmp_path / "run.json").write_text(json.dumps({"identity": {"path": path}}))
    (tmp_path / "job.json").write_text(json.dumps({"settings": {"viewing": {"exposure_ev": 1.5}}}))
    for folder in (tmp_path, tmp_path / "frames"):
        run = open_sequence(folder)
        assert means(run) == [1, 2, 5, 11]
        assert (run.fps, run.exposure_ev, run.numbers, run.starts) == (23.976, 1.5, (1, 2, 5, 11), starts)
        assert run.identity == {"path": path}
    part = open_sequence(tmp_path / "frames" / "00*1.exr")  # has the rate and exposure of its run
    assert (means(part), part.fps, part.exposure_ev, part.numbers) == ([1, 11], 23.976, 1.5, (1, 11))
    assert part.starts == (None if starts is None else {1})
    one = open_sequence(tmp_path / "frames" / "0005.exr")
    assert (means(one), one.exposure_ev) == ([5], 1.5)
    (tmp_path / "run.json").write_text("[1]")  # of another program
    assert open_sequence(tmp_path).fps is None


def test_frames_state_their_rate_where_no_run_does(tmp_path):
    rgb = {"RGB": np.zeros((4, 6, 3), np.float16)}
    rates = {Fraction(24000, 1001): 24000 / 1001, Fraction(0): None, "24": None, None: None}
    for index, (rate, fps) in enumerate(rates.items()):
        file = tmp_path / f"{index}.exr"
        write_exr(file, rgb, attributes=None if rate is None else {"framesPerSecond": rate})
        assert open_sequence(file).fps == fps
    (tmp_path / "run.json").write_text(json.dumps({"identity": {"path": {"fps": 30.0}}}))
    assert open_sequence(tmp_path / "0.exr").fps == 30.0


def test_sources_that_are_not_there_are_named(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.txt").write_text("x")
    cases = {
        "empty": "empty has no images of",
        "a.txt": "unknown format .txt",
        **dict.fromkeys(("none", "none%04d.exr", "no/where/*.png", "no/#.png"), "there is no file"),
    }
    for name, message in cases.items():
        with pytest.raises(ImageError, match=message):
            open_sequence(tmp_path / name)
    exr(tmp_path / "1.exr")
    Image.new("RGB", (6, 4)).save(tmp_path / "2.png")
    with pytest.raises(ImageError, match=r"\(#\.exr, #\.png\)"):
        open_sequence(tmp_path)
    with pytest.raises(ImageError, match=r"/\* matches OpenEXR files \(1\.exr\) and others \(2\.png\)"):
        open_sequence(tmp_path / "*")


def test_frames_are_read_one_by_one_and_errors_name_the_frame(tmp_path):
    for number in range(3):
        exr(tmp_path / f"{number}.exr", number)
    sequence = open_sequence(tmp_path)
    (tmp_path / "1.exr").write_bytes(b"")
    frames = iter(sequence)
    assert next(frames).mean() == 0
    with pytest.raises(ImageError, match=r"1\.exr"):
        next(frames)
    exr(tmp_path / "1.exr", size=(4, 8))
    with pytest.raises(ImageError, match=r"1\.exr has 8x4 pixels, the first image 0\.exr 6x4"):
        list(sequence)


@pytest.mark.parametrize(
    ("layers", "value"),
    [
        ({"beauty": 1}, 1),
        ({"diffuse": 3, "N": 2}, 3),
        ({"albedo": 2, "beauty": 1, "C": 3}, 1),
        ({"albedo": 2, "C": 3}, 3),
        ({"albedo": 2, "RGB": 1, "beauty": 3}, 1),
        ({"View Layer.Combined": 1, "View Layer.DiffCol": 2}, 1),
    ],
)
def test_the_beauty_is_found_among_layers(tmp_path, layers, value):
    write_exr(tmp_path / "a.exr", {name: np.full((4, 6, 3), v, np.float32) for name, v in layers.items()})
    sequence = open_sequence(tmp_path / "a.exr")
    assert means(sequence) == [value]
    is_noted = len(layers) > 1 and not {"N", "RGB"} & set(layers)
    assert ("a.exr; --layer chooses another: " in sequence.note) == is_noted


@pytest.mark.parametrize("prefix", ["", "beauty."])
def test_the_part_that_is_the_beauty_is_taken(tmp_path, prefix):
    named = {"albedo": ("RGB", 1), "beauty": ([prefix + c for c in "RGB"], 2), "depth": ("Z", 3)}
    parts = [
        OpenEXR.Part(
            {"name": name, "type": OpenEXR.scanlineimage}, dict.fromkeys(channels, PLANE * 2 * value)
        )
        for name, (channels, value) in named.items()
    ]
    with OpenEXR.File(parts) as image:
        image.write(str(tmp_path / "a.exr"))
    assert means(open_sequence(tmp_path / "a.exr")) == [2]
    assert means(open_sequence(tmp_path / "a.exr", layer="albedo")) == [1]


def test_a_layer_is_chosen_among_several(tmp_path):
    for number in (1, 2):
        layers = {"View.Combined": 0, "Hair.Combined": number, "Hair.DiffCol": 9}
        planes = {name: np.full((4, 6, 3), value, np.float32) for name, value in layers.items()}
        write_exr(tmp_path / f"{number}.exr", planes)
    with pytest.raises(ImageError, match=r"1\.exr has the colour layers .*Combined, .*Combined; .* --layer"):
        open_sequence(tmp_path)
    for name in ("Hair.Combined", "hair.combined"):
        sequence = open_sequence(tmp_path, layer=name)
        assert (means(sequence), sequence.note) == ([1, 2], "")
    assert means(open_sequence(tmp_path, layer="diffcol")) == [9, 9]
    with pytest.raises(ImageError, match="several colour layers combined; it has the "):
        open_sequence(tmp_path, layer="combined")
    with pytest.raises(ImageError, match=r"no colour layer beauty; it has .*Hair\.DiffCol"):
        open_sequence(tmp_path, layer="beauty")
    exr(tmp_path / "2.exr")
    with pytest.raises(ImageError, match=r"2\.exr has no layer Hair\.Combined of R G B"):
        list(open_sequence(tmp_path, layer="Hair.Combined"))


def test_luminance_is_grey_but_depth_and_other_primaries_are_refused(tmp_path):
    write_exr(tmp_path / "grey.exr", {"Y": PLANE.astype(np.float16)})
    write_exr(tmp_path / "depth.exr", {"Z": PLANE})
    aces = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    rec709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    for name, values in (("aces", aces), ("rec709", rec709)):
        header = {"type": OpenEXR.scanlineimage, "chromaticities": values}
        with OpenEXR.File(header, dict.fromkeys("RGB", PLANE)) as image:
            image.write(str(tmp_path / f"{name}.exr"))
    for name in ("grey", "rec709"):
        assert means(open_sequence(tmp_path / f"{name}.exr")) == [0.5]
    for name, message in (("depth", "no channels R G B; it has the layers Z"), ("aces", "states primaries")):
        with pytest.raises(ImageError, match=rf"{name}\.exr.*{message}"):
            open_sequence(tmp_path / f"{name}.exr")
