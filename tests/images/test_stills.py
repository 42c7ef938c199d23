"""Display-referred images: every format as the same pixels, and refused by name where that can't be."""

from __future__ import annotations

import struct
from base64 import b64decode
from fractions import Fraction
from io import BytesIO

import av
import numpy as np
import pytest
from PIL import Image

from enfilade.errors import ImageError
from enfilade.images.stills import embedded, read_image, resized
from enfilade.kernels.tone import srgb_decode

RNG = np.random.default_rng(2)
EIGHT = RNG.integers(0, 256, (5, 7, 3), np.uint8)
DEEP = RNG.integers(0, 65536, (5, 7, 3), np.uint16)
KINDS = ["png", "jpg", "tif", "tiff", "tga", "webp", "bmp"]


def expected(pixels):
    return srgb_decode(pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max))


def save(file, pixels, **options):
    if pixels.dtype == np.uint16 and pixels.ndim == 3:
        save_deep(file, pixels)
    else:
        options |= {"lossless": True} if file.suffix == ".webp" else {}
        Image.fromarray(pixels).save(file, **options)
    return file


def save_deep(file, pixels):
    """16-bit colours by FFmpeg's encoders."""
    codec, order = ("png", "be") if file.suffix == ".png" else ("tiff", "le")
    frame = av.VideoFrame.from_ndarray(pixels, format=("rgb48" if pixels.shape[2] == 3 else "rgba64") + order)
    context = av.CodecContext.create(codec, "w")
    context.width, context.height, context.pix_fmt = frame.width, frame.height, frame.format.name
    context.time_base = Fraction(1)
    file.write_bytes(b"".join(bytes(p) for p in [*context.encode(frame), *context.encode(None)]))


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "jpg"])
def test_8_bits(tmp_path, kind):
    for pixels in (EIGHT, np.dstack([EIGHT, np.full_like(EIGHT[..., 0], 255)])):  # opaque
        linear = read_image(save(tmp_path / f"a.{kind}", pixels))
        assert linear.dtype == np.float32
        np.testing.assert_allclose(linear, expected(EIGHT), atol=1e-6)


def test_jpeg_and_palettes(tmp_path):
    file = save(tmp_path / "a.jpg", np.full((32, 32, 3), (200, 100, 50), np.uint8), quality=95)
    file.rename(tmp_path / "a.png")  # the suffix may be wrong
    linear = read_image(tmp_path / "a.png")
    np.testing.assert_allclose(linear[16, 16], expected(np.uint8([200, 100, 50])), atol=0.01)
    image = Image.fromarray(EIGHT).quantize(16)
    image.save(tmp_path / "b.png")
    colors = expected(np.asarray(image.convert("RGB")))
    np.testing.assert_allclose(read_image(tmp_path / "b.png"), colors, atol=1e-6)


@pytest.mark.parametrize("kind", ["png", "tif"])
def test_16_bits_are_kept(tmp_path, kind):
    for pixels in (DEEP, np.dstack([DEEP, np.full_like(DEEP[..., 0], 65535)])):
        linear = read_image(save(tmp_path / f"a.{kind}", pixels))
        np.testing.assert_allclose(linear, expected(DEEP), atol=1e-6)


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_deflate", "packbits"])
def test_grey_of_8_and_16_bits(tmp_path, compression):
    for pixels in (EIGHT[..., 0], DEEP[..., 0]):
        file = tmp_path / ("a.tif" if compression else "a.png")
        save(file, pixels, **({"compression": compression} if compression else {}))
        tolerance = 1e-6 if compression else 1e-4  # FFmpeg rounds 16-bit grey of the other byte order
        np.testing.assert_allclose(read_image(file)[..., 1], expected(pixels), atol=tolerance)


def test_transparency_is_refused(tmp_path):
    rgba = np.dstack([EIGHT, np.full_like(EIGHT[..., 0], 255)])
    rgba[0, 0, 3] = 254
    for kind in ("png", "tif", "tga", "webp"):
        for pixels in (rgba, rgba.astype(np.uint16) * 257) if kind in ("png", "tif") else (rgba,):
            with pytest.raises(ImageError, match=rf"a\.{kind} has transparent pixels"):
                read_image(save(tmp_path / f"a.{kind}", pixels))


def test_tiff_of_other_samples_is_refused(tmp_path):
    file = tmp_path / "a.tif"
    save(file, np.zeros((16, 16), np.float32))
    with pytest.raises(ImageError, match=r"a\.tif has 32 bits .*OpenEXR"):
        read_image(file)
    data = save(file, np.zeros((16, 16), np.uint16)).read_bytes()
    changes = {
        "tiles": (struct.pack("<HH", 284, 3), struct.pack("<HH", 322, 3)),  # which FFmpeg ignores
        "0 is white": (struct.pack("<HHII", 262, 3, 1, 1), struct.pack("<HHII", 262, 3, 1, 0)),
    }
    for old, new in changes.values():
        assert old in data
        file.write_bytes(data.replace(old, new))
        with pytest.raises(ImageError, match=r"a\.tif has 16 bits .*OpenEXR"):
            read_image(file)


def test_the_size_in_a_header_is_checked_first(tmp_path):
    file = tmp_path / "a.tga"
    file.write_bytes(bytes([0, 0, 2, *[0] * 9]) + struct.pack("<HHBB", 20000, 20000, 24, 0))
    with pytest.raises(ImageError, match="400000000 pixels"):
        read_image(file)


@pytest.mark.parametrize("kind", [*KINDS, "deep.png", "deep.tif", "lzw.tif"])
def test_files_that_are_cut_off_are_refused_by_name(tmp_path, kind):
    pixels = RNG.integers(0, 256, (40, 40, 3), np.uint8)
    options = {"compression": "tiff_lzw"} if kind == "lzw.tif" else {}
    file = tmp_path / f"a.{kind}"
    data = save(file, pixels.astype(np.uint16) * 251 if "deep" in kind else pixels, **options).read_bytes()
    for part in range(20):
        file.write_bytes(data[: len(data) * part // 20])
        with pytest.raises(ImageError, match=f"a.{kind}"):
            read_image(file)


def test_webp_of_a_report(tmp_path):
    rgba = RNG.integers(1, 256, (6, 8, 4), np.uint8)
    grey = np.full((6, 8, 3), 90, np.uint8)
    lossless, lossy = (
        np.asarray(Image.open(BytesIO(b64decode(text))), np.int64)
        for text in (embedded(rgba, is_lossless=True), embedded(grey))
    )
    np.testing.assert_array_equal(lossless, rgba)
    assert abs(lossy - 90).max() < 3
    assert resized(rgba, (8, 6), is_mixed=True) is rgba
    np.testing.assert_array_equal(resized(rgba, (4, 3), is_mixed=False), rgba[1::2, 1::2])
    means = rgba[..., :3].reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(resized(rgba[..., :3].copy(), (4, 3), is_mixed=True), means, atol=1)
