"""Foreign videos: matrices, ranges and pixel formats; HDR, wide-gamut and damaged ones are refused."""

from __future__ import annotations

import av
import numpy as np
import pytest

from enfilade.errors import ImageError
from enfilade.images import encode_video, open_sequence, video_suffix
from enfilade.images.ycbcr import BT601, BT709, frame_of, planes_of
from enfilade.kernels.tone import srgb_decode, srgb_encode
from enfilade.settings import VideoSettings

COLOR = (0.6, 0.3, 0.1)  # encoded R'G'B'
SAME = {"src_colorspace": 1, "dst_colorspace": 1, "src_color_range": 1, "dst_color_range": 1}


def written(file, frame, *, codec="ffv1", **tags):
    """Two equal frames."""
    with av.open(str(file), "w") as container:
        stream = container.add_stream(codec, rate=24)
        stream.width, stream.height, stream.pix_fmt = frame.width, frame.height, frame.format.name
        for name, value in tags.items():
            setattr(stream.codec_context, name, value)
            setattr(frame, name, value)
        for index in range(2):
            frame.pts = index
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return file


def foreign(file, pixel_format="yuv444p", *, weights=BT709, full=False, size=(48, 64), **tags):
    kr, kb = weights
    r, g, b = COLOR
    y = kr * r + (1 - kr - kb) * g + kb * b
    spans = (255, 255) if full else (219, 224)
    codes = [y * spans[0] + (0 if full else 16)]
    codes += [c * spans[1] + 128 for c in ((b - y) / (2 - 2 * kb), (r - y) / (2 - 2 * kr))]
    frame = frame_of([np.full(size, round(code), np.uint8) for code in codes], "yuv444p")
    if pixel_format != "yuv444p":
        frame = frame.reformat(format=pixel_format, **SAME)
    return written(file, frame, **{"colorspace": 1, "color_range": 2 if full else 1, **tags})


def shown(file):
    return srgb_encode(next(iter(open_sequence(file))))[20, 30]


@pytest.mark.parametrize("name", ["yuv444p", "yuv420p", "yuv422p", "yuv420p10le", "yuv444p12le", "yuv411p"])
def test_layouts(tmp_path, name):
    file = foreign(tmp_path / "a.mkv", name)
    np.testing.assert_allclose(shown(file), COLOR, atol=0.01)
    with pytest.raises(ImageError, match=r"frame 2 of .*a\.mkv has no layers"):
        open_sequence(file).layers(1)


def test_matrices_and_ranges(tmp_path):
    cases = [{"weights": BT601, "colorspace": matrix} for matrix in (5, 6, 2)]
    cases += [{"size": size, "colorspace": 2} for size in ((720, 1280), (536, 1280), (720, 576))]
    cases += [{"weights": BT601, "size": (576, 720), "colorspace": 2}, {"full": True}]
    for tags in cases:
        np.testing.assert_allclose(shown(foreign(tmp_path / "a.mkv", **tags)), COLOR, atol=0.01)


@pytest.mark.parametrize("name", ["gbrp10le", "gbrp16le", "rgb24", "rgb48be"])
def test_rgb_is_exact(tmp_path, name):
    bits = {"gbrp10le": 10, "rgb24": 8}.get(name, 16)
    dtype = np.uint8 if bits == 8 else np.uint16
    pixels = np.random.default_rng(1).integers(0, 1 << bits, (48, 64, 3), dtype)
    if name.startswith("gbr"):
        frame, codec, suffix = frame_of([pixels[..., c] for c in (1, 2, 0)], name), "ffv1", "mkv"
        np.testing.assert_array_equal(np.stack(planes_of(frame), axis=2)[..., [2, 0, 1]], pixels)
    else:
        frame, codec, suffix = av.VideoFrame.from_ndarray(pixels, format=name), "png", "mov"
    image = next(iter(open_sequence(written(tmp_path / f"a.{suffix}", frame, codec=codec))))
    expected = srgb_decode(pixels.astype(np.float32) / np.float32((1 << bits) - 1))
    np.testing.assert_array_equal(image, expected)


@pytest.mark.parametrize(
    ("name", "codec", "suffix"),
    [("yuva444p", "ffv1", "mkv"), ("gbrap12le", "ffv1", "mkv"), ("yuva444p10le", "prores_ks", "mov")],
)
def test_transparent_frames_are_refused(tmp_path, name, codec, suffix):
    pixels = np.full((48, 64, 4), 65535, np.uint16)
    file = tmp_path / f"a.{suffix}"
    for alpha in (65535, 32768):
        pixels[20, 30, 3] = alpha
        frame = av.VideoFrame.from_ndarray(pixels, format="rgba64le").reformat(format=name)
        sequence = open_sequence(written(file, frame, codec=codec))
        if alpha == 65535:
            assert len(list(sequence)) == 2
        else:
            with pytest.raises(ImageError, match=r"frame 1 of .* has transparent pixels; put it over a back"):
                list(sequence)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        *(("color_trc", value, name) for value, name in ((16, "PQ"), (18, "HLG"), (9, "logarithmic"))),
        *(("color_primaries", value, f"primaries {value}") for value in (9, 12)),
        ("colorspace", 9, "matrix 9"),
    ],
)
def test_hdr_and_wide_gamut_are_refused(tmp_path, name, value, message):
    with pytest.raises(ImageError, match=rf"a\.mkv.*{message}.*convert"):
        list(open_sequence(foreign(tmp_path / "a.mkv", **{name: value})))


def encoded(file, frames, codec):
    settings = VideoSettings(codec=codec)
    encode_video(file, frames, fps=24, width=64, height=64, settings=settings, exposure_ev=0)
    return file


def check_cut_off(file):
    data = file.read_bytes()
    for part in range(20):
        file.write_bytes(data[: len(data) * part // 20])
        with pytest.raises(ImageError, match=file.name):
            list(open_sequence(file))


@pytest.mark.parametrize("codec", ["h264", "ffv1", "prores"])
def test_files_that_are_cut_off_or_foreign_are_refused_by_name(tmp_path, codec):
    frames = np.random.default_rng(0).random((8, 64, 64, 3), np.float32)
    file = encoded(tmp_path / f"a{video_suffix(codec)}", frames, codec)
    check_cut_off(file)
    file.write_bytes(b"#EXTM3U\n#EXTINF:1\n/etc/passwd\n")
    with pytest.raises(ImageError, match=file.name):
        open_sequence(file)


@pytest.mark.parametrize(("codec", "suffix"), [("h264", ".mp4"), ("prores", ".mov")])
def test_a_trimmed_video_has_the_frames_that_are_shown(tmp_path, codec, suffix):
    levels = np.linspace(0.1, 0.9, 24)
    frames = [np.full((64, 64, 3), level, np.float32) for level in levels]
    source, file = encoded(tmp_path / f"a{suffix}", frames, codec), tmp_path / f"b{suffix}"
    with av.open(str(source)) as whole, av.open(str(file), "w", options={"movflags": "faststart"}) as part:
        stream = whole.streams.video[0]
        copy = part.add_stream_from_template(stream)
        for packet in whole.demux(stream):
            if packet.dts is not None:
                shift = round(5 / (24 * stream.time_base))
                packet.pts, packet.dts, packet.stream = packet.pts - shift, packet.dts - shift, copy
                part.mux(packet)
    found = [float(frame.mean()) for frame in open_sequence(file)]
    assert len(open_sequence(file)) == len(found) == 19
    np.testing.assert_allclose(found, levels[5:], atol=0.02)
    check_cut_off(file)


@pytest.mark.parametrize("codec", ["h264", "ffv1", "av1", "prores"])
def test_mutated_files_are_read_or_refused(tmp_path, codec):
    rng = np.random.default_rng(7)
    file = encoded(tmp_path / f"a{video_suffix(codec)}", rng.random((3, 64, 64, 3), np.float32), codec)
    data = np.frombuffer(file.read_bytes(), np.uint8)
    refused = 0
    for _ in range(80):
        mutated = data.copy()
        mutated[rng.integers(0, len(data), 8)] = rng.integers(0, 256, 8)
        file.write_bytes(mutated.tobytes())
        try:
            assert {frame.shape for frame in open_sequence(file)} == {(64, 64, 3)}
        except ImageError:
            refused += 1
    assert refused > 0
