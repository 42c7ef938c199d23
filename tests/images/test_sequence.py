"""Sequences: every source read as the same pixels, in order, and refused by name where they can't be."""

from __future__ import annotations

import json
import struct
import zlib
from fractions import Fraction

import av
import numpy as np
import OpenEXR
import pytest
from PIL import Image

from enfilade.errors import ImageError
from enfilade.images import open_sequence, write_exr
from enfilade.kernels.tone import srgb_decode

RNG = np.random.default_rng(2)


def exr(file, value=0.5, size=(4, 6)):
    write_exr(file, {"RGB": np.full((*size, 3), value, np.float32), "Z": np.ones(size, np.float32)})


def png(file, array, mode=None):
    Image.fromarray(array, mode).save(file)


def deep_png(file, pixels):
    """16 bits a channel, written by FFmpeg's encoder."""
    deep(file, pixels, "png", "be")


def deep_tiff(file, pixels):
    deep(file, pixels, "tiff", "le")


def deep(file, pixels, codec, order):
    height, width, channels = pixels.shape
    name = ("rgb48" if channels == 3 else "rgba64") + order
    context = av.CodecContext.create(codec, "w")
    context.width, context.height, context.pix_fmt = width, height, name
    context.time_base = Fraction(1)
    frame = av.VideoFrame(width, height, name)
    rows = np.zeros((height, frame.planes[0].line_size), np.uint8)
    raw = pixels.astype(">u2" if order == "be" else "<u2").reshape(height, -1).view(np.uint8)
    rows[:, : raw.shape[1]] = raw
    frame.planes[0].update(rows)
    file.write_bytes(b"".join(bytes(p) for p in [*context.encode(frame), *context.encode(None)]))


def means(sequence):
    return [round(float(frame.mean()), 4) for frame in sequence]


def test_a_folder_is_read_in_natural_order(tmp_path):
    for name, value in (("-0002", 1), ("-0001", 2), ("0000", 3), ("0009", 4), ("9999", 5), ("10000", 6)):
        exr(tmp_path / f"{name}.exr", value)
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / ".0001.writing-1-a.exr").write_text("")
    sequence = open_sequence(tmp_path)
    assert means(sequence) == means(sequence) == [1, 2, 3, 4, 5, 6]
    assert (len(sequence), sequence.width, sequence.height, sequence.fps) == (6, 6, 4, None)
    assert sequence.name(1).endswith("-0001.exr")
    assert set(sequence.layers(0)) == {"RGB", "Z"}


def test_only_numbers_of_digits_are_taken_by_value(tmp_path):
    for name, value in (("2", 1), ("\u0663", 2), ("10", 3), ("\u00b2", 4)):  # an Arabic three, a superscript
        exr(tmp_path / f"{name}.exr", value)
    assert means(open_sequence(tmp_path / "*.exr")) == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("names", "listed"),
    [
        (
            ("beauty.0001", "beauty.0002", "beauty.0003", "albedo.0001", "albedo.0002"),
            r"beauty\.####\.exr \(3\), albedo\.####\.exr \(2\); give .*/beauty\.####\.exr, or .*/\*\.exr",
        ),
        (("s1-01", "s1-02", "s2-01", "s2-02"), r"s1-##\.exr \(2\), s2-##\.exr \(2\)"),
        (("1", "2", "preview"), r"#\.exr \(2\), preview\.exr \(1\)"),
        ([f"{c}-01" for c in "abcdefghi"], r".*, f-##\.exr \(1\) and 3 more; give"),
    ],
)
def test_a_folder_of_two_sequences_is_not_taken_for_one(tmp_path, names, listed):
    for name in names:
        exr(tmp_path / f"{name}.exr")
    with pytest.raises(ImageError, match=f"differ in more than a number: {listed}"):
        open_sequence(tmp_path)
    assert len(open_sequence(tmp_path / "*.exr")) == len(names)


def test_one_of_two_sequences_is_chosen_by_its_pattern(tmp_path):
    for number in (8, 9, 10):
        exr(tmp_path / f"beauty.{number:04}.exr", number)
        exr(tmp_path / f"albedo.{number:04}.exr")
    for pattern in ("beauty.####.exr", "beauty.*.exr"):
        sequence = open_sequence(tmp_path / pattern)
        assert (means(sequence), sequence.numbers) == ([8, 9, 10], (8, 9, 10))


@pytest.mark.parametrize(
    "pattern", ["shot-%04d.exr", "shot-%d.exr", "shot-####.exr", "shot-*.exr", "shot-[0-9]*.exr"]
)
def test_patterns(tmp_path, pattern):
    for k in (1, 2, 10):
        exr(tmp_path / f"shot-{k}.exr", k)
        exr(tmp_path / f"other{k}.exr", 0)
    assert means(open_sequence(str(tmp_path / pattern))) == [1, 2, 10]


def test_a_single_image_and_a_run_folder(tmp_path):
    (tmp_path / "frames").mkdir()
    exr(tmp_path / "frames" / "0001.exr", 7)
    assert means(open_sequence(tmp_path / "frames" / "0001.exr")) == [7]
    (tmp_path / "run.json").write_text(json.dumps({"format": 1, "identity": {"path": {"fps": 23.976}}}))
    run = open_sequence(tmp_path)
    assert (means(run), run.fps) == ([7], 23.976)


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (("-0002", "-0001", "0000", "0003"), (-2, -1, 0, 3)),
        (("shot2-0009", "shot2-0010"), (9, 10)),
        (("0001-v2", "0002-v2"), (1, 2)),
        (("a7", "b6"), None),
        (("1", "end"), None),
    ],
)
def test_numbers_are_what_varies_in_the_names_where_they_rise(tmp_path, names, numbers):
    for name in names:
        exr(tmp_path / f"{name}.exr")
    for source in (tmp_path, tmp_path / "*.exr") if numbers else (tmp_path / "*.exr",):
        sequence = open_sequence(source)
        assert (sequence.numbers, sequence.starts) == (numbers, None)


@pytest.mark.parametrize(
    ("selected", "cuts", "starts"),
    [
        (range(1, 12), [], {2, 3}),
        (range(1, 12), [2], {1, 2, 3}),
        (range(1, 12), [6], {2, 3}),
        ((1, 2, 5, 11), [5], {2}),
        ((1, 2, 5, 11), [], set()),
        (None, [], None),
        ([1, [2], "5"], [], None),
    ],
)
def test_a_run_says_which_frames_do_not_follow_the_one_before(tmp_path, selected, cuts, starts):
    (tmp_path / "frames").mkdir()
    for number in (1, 2, 5, 11):
        exr(tmp_path / "frames" / f"{number:04}.exr")
    path = {"fps": 30.0, "frames": None if selected is None else list(selected), "cuts": cuts}
    (tmp_path / "run.json").write_text(json.dumps({"identity": {"path": path}}))
    run = open_sequence(tmp_path)
    assert (run.numbers, run.starts) == ((1, 2, 5, 11), starts)


def test_display_referred_images_are_decoded(tmp_path):
    eight = RNG.integers(0, 256, (4, 6, 3), np.uint8)
    png(tmp_path / "a.png", eight)
    expected = srgb_decode(eight.astype(np.float32) / np.float32(255))
    np.testing.assert_allclose(next(iter(open_sequence(tmp_path / "a.png"))), expected, atol=1e-6)
    grey = eight[..., 0]
    png(tmp_path / "g.png", grey)
    first = next(iter(open_sequence(tmp_path / "g.png")))
    np.testing.assert_allclose(
        first[..., 1], srgb_decode(grey.astype(np.float32) / np.float32(255)), atol=1e-6
    )
    smooth = np.full((32, 32, 3), (200, 100, 50), np.uint8)
    Image.fromarray(smooth).save(tmp_path / "a.jpg", quality=95)
    jpeg = next(iter(open_sequence(tmp_path / "a.jpg")))
    np.testing.assert_allclose(jpeg[16, 16], srgb_decode(np.float32([200, 100, 50]) / 255), atol=0.01)


def test_a_colon_in_a_relative_name_is_no_protocol(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    deep_png(tmp_path / "walk:1.png", RNG.integers(0, 65536, (5, 7, 3), np.uint16))
    assert next(iter(open_sequence("walk:1.png"))).shape == (5, 7, 3)


def test_sixteen_bits_keep_all_of_them(tmp_path):
    deep = RNG.integers(0, 65536, (5, 7, 3), np.uint16)
    deep_png(tmp_path / "a.png", deep)
    expected = srgb_decode(deep.astype(np.float32) / np.float32(65535))
    np.testing.assert_allclose(next(iter(open_sequence(tmp_path / "a.png"))), expected, atol=1e-6)
    grey = RNG.integers(0, 65536, (5, 7), np.uint16)
    Image.fromarray(grey).save(tmp_path / "g.png")
    first = next(iter(open_sequence(tmp_path / "g.png")))
    np.testing.assert_allclose(
        first[..., 2], srgb_decode(grey.astype(np.float32) / np.float32(65535)), atol=1e-4
    )


@pytest.mark.parametrize("kind", ["tif", "tiff", "tga", "webp", "bmp", "ppm"])
def test_other_formats_of_8_bits(tmp_path, kind):
    eight = RNG.integers(0, 256, (4, 6, 3), np.uint8)
    options = {"lossless": True} if kind == "webp" else {}
    for number in (1, 2):
        Image.fromarray(eight).save(tmp_path / f"{number}.{kind}", **options)
    sequence = open_sequence(tmp_path)
    assert sequence.numbers == (1, 2)
    expected = srgb_decode(eight.astype(np.float32) / np.float32(255))
    for frame in sequence:
        np.testing.assert_allclose(frame, expected, atol=1e-6)


@pytest.mark.parametrize("compression", ["raw", "tiff_lzw", "tiff_deflate", "packbits"])
def test_grey_tiff_of_8_and_16_bits(tmp_path, compression):
    for kind, most in ((np.uint8, 255), (np.uint16, 65535)):
        grey = RNG.integers(0, most + 1, (5, 7), kind)
        Image.fromarray(grey).save(tmp_path / "g.tif", compression=compression)
        expected = srgb_decode(grey.astype(np.float32) / np.float32(most))
        np.testing.assert_allclose(next(iter(open_sequence(tmp_path / "g.tif")))[..., 1], expected, atol=1e-6)


@pytest.mark.parametrize(("kind", "largest"), [("tif", 65535), ("ppm", 65535), ("ppm", 1023)])
def test_other_formats_of_16_bits_keep_all_of_them(tmp_path, kind, largest):
    pixels = RNG.integers(0, largest + 1, (5, 7, 3), np.uint16)
    file = tmp_path / f"a.{kind}"
    if kind == "tif":
        deep_tiff(file, pixels)
    else:
        file.write_bytes(b"P6\n# 9 9 9\n7 5\n%d\n" % largest + pixels.astype(">u2").tobytes())
    expected = srgb_decode(pixels.astype(np.float32) / np.float32(largest))
    # FFmpeg widens 10 bits to 16: half a step of those, times the transfer's steepest slope
    np.testing.assert_allclose(next(iter(open_sequence(file))), expected, atol=2e-5)


def test_tiff_of_floats_is_refused(tmp_path):
    Image.fromarray(RNG.random((4, 6)).astype(np.float32)).save(tmp_path / "a.tif")
    with pytest.raises(ImageError, match=r"a\.tif has 32 bits .*write it as OpenEXR"):
        open_sequence(tmp_path / "a.tif")


def png_that_claims(width, height, *, bits):
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"")),
    ]
    parts = [
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in chunks
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.png", png_that_claims(20000, 20000, bits=8)),
        ("a.png", png_that_claims(20000, 20000, bits=16)),
        ("a.ppm", b"P6\n20000 20000\n255\n"),
        ("a.ppm", b"P6\n20000 20000\n65535\n"),
        ("a.tga", bytes([0, 0, 2, *[0] * 9]) + struct.pack("<HHBB", 20000, 20000, 24, 0)),
    ],
    ids=["png", "deep png", "ppm", "deep ppm", "tga"],
)
def test_the_size_in_a_header_is_checked_first(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ImageError, match="20000x20000 pixels; at most 268435456 are read"):
        open_sequence(tmp_path / name)


def test_the_limit_of_pixels_is_our_own(tmp_path, monkeypatch):
    # an image is read that Pillow alone would refuse, and its own limit stays what it was
    png(tmp_path / "a.png", np.zeros((40, 60, 3), np.uint8))
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    assert open_sequence(tmp_path / "a.png").width == 60
    assert Image.MAX_IMAGE_PIXELS == 1000


def test_transparency_is_refused_and_opaque_alpha_dropped(tmp_path):
    rgba = RNG.integers(0, 256, (4, 6, 4), np.uint8)
    rgba[..., 3] = 255
    png(tmp_path / "a.png", rgba)
    assert next(iter(open_sequence(tmp_path / "a.png"))).shape == (4, 6, 3)
    rgba[0, 0, 3] = 254
    png(tmp_path / "a.png", rgba)
    deep_png(tmp_path / "b.png", rgba.astype(np.uint16) * 257)
    deep_tiff(tmp_path / "c.tif", rgba.astype(np.uint16) * 257)
    for kind in ("tif", "tga", "webp"):
        Image.fromarray(rgba).save(tmp_path / f"d.{kind}", **({"lossless": True} if kind == "webp" else {}))
    for name in ("a.png", "b.png", "c.tif", "d.tif", "d.tga", "d.webp"):
        with pytest.raises(ImageError, match=rf"{name} has transparent pixels"):
            open_sequence(tmp_path / name)


def test_mixed_sizes_name_the_frame(tmp_path):
    exr(tmp_path / "0001.exr")
    exr(tmp_path / "0002.exr", size=(4, 8))
    with pytest.raises(ImageError, match=r"0002\.exr has 8x4 pixels, the first image 0001\.exr 6x4"):
        list(open_sequence(tmp_path))


def test_what_is_not_there_is_said(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.txt").write_text("x")
    cases = {
        "empty": "no images in it",
        "none": "there is no file",
        "none%04d.exr": "there is no file",
        "no/where/*.png": "there is no file",
        "a.txt": "can't tell what a .txt is",
    }
    for name, message in cases.items():
        with pytest.raises(ImageError, match=message):
            open_sequence(tmp_path / name)
    (tmp_path / "mixed").mkdir()
    exr(tmp_path / "mixed" / "a.exr")
    png(tmp_path / "mixed" / "a.png", np.zeros((4, 6, 3), np.uint8))
    with pytest.raises(ImageError, match=r"several kinds \(\.exr, \.png\)"):
        open_sequence(tmp_path / "mixed")


def test_foreign_layers(tmp_path):
    three, one = np.full((4, 6, 3), 0.25, np.float32), np.full((4, 6), 0.5, np.float16)
    write_exr(tmp_path / "blender.exr", {"View Layer.Combined": three, "View Layer.Depth": one})
    write_exr(tmp_path / "grey.exr", {"Y": one})
    write_exr(tmp_path / "depth.exr", {"Z": one})
    assert means(open_sequence(tmp_path / "blender.exr")) == [0.25]
    assert means(open_sequence(tmp_path / "grey.exr")) == [0.5]
    with pytest.raises(ImageError, match="no channels R G B; it has the layers Z"):
        open_sequence(tmp_path / "depth.exr")


def parts(file, **parts):
    """A file of several parts, each of channels of one value."""
    made = [
        OpenEXR.Part(
            {"name": name, "type": OpenEXR.scanlineimage},
            {channel: np.full((4, 6), value, np.float32) for channel in channels},
        )
        for name, (channels, value) in parts.items()
    ]
    with OpenEXR.File(made) as image:
        image.write(str(file))


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
def test_the_picture_is_found_among_layers(tmp_path, layers, value):
    planes = {name: np.full((4, 6, 3), v, np.float32) for name, v in layers.items()}
    write_exr(tmp_path / "a.exr", planes)
    sequence = open_sequence(tmp_path / "a.exr")
    assert means(sequence) == [value]
    assert bool(sequence.note) == (len(layers) > 1 and not {"N", "RGB"} & set(layers))
    if sequence.note:
        assert "a.exr; --layer chooses another: " in sequence.note


@pytest.mark.parametrize("channels", [("R", "G", "B"), ("beauty.R", "beauty.G", "beauty.B")])
def test_the_part_that_is_the_picture_is_taken(tmp_path, channels):
    parts(tmp_path / "a.exr", albedo=("RGB", 1), beauty=(channels, 2), depth=("Z", 3))
    assert means(open_sequence(tmp_path / "a.exr")) == [2]
    assert means(open_sequence(tmp_path / "a.exr", layer="albedo")) == [1]


def test_half_and_float_make_a_picture_together(tmp_path):
    plane = np.full((4, 6), 0.5, np.float32)
    channels = {"R": plane.astype(np.float16), "G": plane, "B": plane.astype(np.float16)}
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as image:
        image.write(str(tmp_path / "a.exr"))
    assert means(open_sequence(tmp_path / "a.exr")) == [0.5]


def test_a_layer_is_chosen_among_several(tmp_path):
    for number in (1, 2):
        layers = {"View.Combined": 0, "Hair.Combined": number, "Hair.DiffCol": 9}
        planes = {name: np.full((4, 6, 3), value, np.float32) for name, value in layers.items()}
        write_exr(tmp_path / f"{number}.exr", planes)
    with pytest.raises(
        ImageError, match=r"1\.exr has the colour layers .*Combined, .*Combined; say by --layer"
    ):
        open_sequence(tmp_path)
    for name in ("Hair.Combined", "hair.combined"):
        sequence = open_sequence(tmp_path, layer=name)
        assert (means(sequence), sequence.note) == ([1, 2], "")
    assert means(open_sequence(tmp_path, layer="diffcol")) == [9, 9]
    with pytest.raises(ImageError, match=r"several colour layers combined: "):
        open_sequence(tmp_path, layer="combined")
    with pytest.raises(ImageError, match=r"no colour layer beauty; it has the colour layers .*Hair\.DiffCol"):
        open_sequence(tmp_path, layer="beauty")
    exr(tmp_path / "2.exr")
    with pytest.raises(ImageError, match=r"2\.exr has no layer Hair\.Combined of R G B"):
        list(open_sequence(tmp_path, layer="Hair.Combined"))


def test_other_primaries_are_refused(tmp_path):
    plane = np.ones((4, 6), np.float32)
    aces = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    rec709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    for name, values in (("aces", aces), ("rec709", rec709)):
        header = {"type": OpenEXR.scanlineimage, "chromaticities": values}
        with OpenEXR.File(header, dict.fromkeys("RGB", plane)) as image:
            image.write(str(tmp_path / f"{name}.exr"))
    assert means(open_sequence(tmp_path / "rec709.exr")) == [1]
    with pytest.raises(ImageError, match=r"aces\.exr says that its primaries"):
        open_sequence(tmp_path / "aces.exr")


def test_frames_are_read_when_they_are_asked_for(tmp_path):
    for k in range(3):
        exr(tmp_path / f"{k}.exr", k)
    sequence = open_sequence(tmp_path)
    for k in (1, 2):
        (tmp_path / f"{k}.exr").write_bytes(b"")
    frames = iter(sequence)
    assert next(frames).mean() == 0
    with pytest.raises(ImageError, match=r"1\.exr"):
        next(frames)


@pytest.mark.parametrize(
    "kind",
    ["exr", "png", "deep.png", "jpg", "tif", "lzw.tif", "deep.tif", "tga", "webp", "bmp", "ppm", "deep.ppm"],
)
def test_truncated_images_are_refused_by_name(tmp_path, kind):
    file = tmp_path / f"a.{kind}"
    pixels = RNG.integers(0, 256, (40, 40, 3), np.uint8)
    if kind == "exr":
        write_exr(file, {"RGB": pixels.astype(np.float32)})
    elif kind == "deep.png":
        deep_png(file, pixels.astype(np.uint16) * 251)
    elif kind == "deep.tif":
        deep_tiff(file, pixels.astype(np.uint16) * 251)
    elif kind == "deep.ppm":
        file.write_bytes(b"P6 40 40 65535\n" + pixels.astype(">u2").tobytes())
    elif kind == "lzw.tif":
        Image.fromarray(pixels).save(file, compression="tiff_lzw")
    else:
        Image.fromarray(pixels).save(file)
    data = file.read_bytes()
    for part in range(20):
        file.write_bytes(data[: len(data) * part // 20])
        with pytest.raises(ImageError, match=f"a.{kind}"):
            open_sequence(file)
