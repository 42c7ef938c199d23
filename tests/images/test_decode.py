"""Foreign videos: other matrices, ranges and pixel formats; HDR and damaged ones are refused."""

from __future__ import annotations

import av
import numpy as np
import pytest

from enfilade.errors import ImageError
from enfilade.images import encode_video, open_sequence, video_suffix
from enfilade.images.ycbcr import BT601, BT709
from enfilade.settings import VideoSettings

COLOR = (0.6, 0.3, 0.1)  # encoded R'G'B'


def foreign(file, pixels, *, weights=BT709, full=False, codec="ffv1", size=(48, 64), **tags):
    """Two frames of one colour."""
    kr, kb = weights
    r, g, b = COLOR
    y = kr * r + (1 - kr - kb) * g + kb * b
    chroma = ((b - y) / (2 - 2 * kb), (r - y) / (2 - 2 * kr))
    top = (255, 255) if full else (219, 224)
    numbers = [y * top[0] + (0 if full else 16), *(c * top[1] + 128 for c in chroma)]
    frame = av.VideoFrame(size[1], size[0], "yuv444p")
    for plane, number in zip(frame.planes, numbers, strict=True):
        plane.update(np.full((plane.height, plane.line_size), round(number), np.uint8))
    if pixels != "yuv444p":
        same = {"src_colorspace": 1, "dst_colorspace": 1, "src_color_range": 1, "dst_color_range": 1}
        frame = frame.reformat(format=pixels, **same)
    with av.open(str(file), "w") as container:
        stream = container.add_stream(codec, rate=24)
        stream.width, stream.height, stream.pix_fmt = size[1], size[0], pixels
        tags.setdefault("color_range", 2 if full else 1)
        for name, value in tags.items():
            setattr(stream.codec_context, name, value)
            setattr(frame, name, value)
        for index in range(2):
            frame.pts = index
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return file


def shown(file):
    linear = next(iter(open_sequence(file)))
    return np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, linear * 12.92)[20, 30]


@pytest.mark.parametrize("pixels", ["yuv444p", "yuv420p", "yuv422p", "yuv420p10le", "yuv444p12le", "yuv411p"])
def test_layouts(tmp_path, pixels):
    file = foreign(tmp_path / "a.mkv", pixels, colorspace=1)
    np.testing.assert_allclose(shown(file), COLOR, atol=0.01)


@pytest.mark.parametrize(
    ("weights", "full", "matrix", "size"),
    [
        (BT601, False, 5, (48, 64)),
        (BT601, False, 6, (48, 64)),
        (BT601, False, 2, (48, 64)),
        (BT709, False, 2, (720, 1280)),
        (BT709, True, 1, (48, 64)),
    ],
)
def test_matrices_and_ranges(tmp_path, weights, full, matrix, size):
    file = foreign(tmp_path / "a.mkv", "yuv444p", weights=weights, full=full, size=size, colorspace=matrix)
    np.testing.assert_allclose(shown(file), COLOR, atol=0.01)


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        ({"color_trc": 16}, "PQ"),
        ({"color_trc": 18}, "HLG"),
        ({"color_trc": 9}, "logarithmic"),
        ({"color_primaries": 9}, "primaries 9"),
        ({"color_primaries": 12}, "primaries 12"),
    ],
)
def test_hdr_and_wide_gamut_are_refused(tmp_path, tags, message):
    file = foreign(tmp_path / "a.mkv", "yuv444p", colorspace=1, **tags)
    with pytest.raises(ImageError, match=rf"a\.mkv.*{message}.*convert"):
        open_sequence(file)


def test_another_matrix_is_refused(tmp_path):
    with pytest.raises(ImageError, match="matrix 9"):
        list(open_sequence(foreign(tmp_path / "a.mkv", "yuv444p", colorspace=9)))


def test_a_cut_off_or_foreign_file_is_refused_by_name(tmp_path):
    rng = np.random.default_rng(0)
    frames = [rng.random((64, 64, 3), np.float32) for _ in range(8)]
    for suffix, codec in ((".mp4", "h264"), (".mkv", "ffv1"), (".mov", "prores")):
        file = tmp_path / f"a{suffix}"
        encode_video(
            file, frames, fps=24, width=64, height=64, settings=VideoSettings(codec=codec), exposure_ev=0
        )
        data = file.read_bytes()
        for part in range(20):
            file.write_bytes(data[: len(data) * part // 20])
            with pytest.raises(ImageError, match=rf"a\{suffix}"):
                list(open_sequence(file))
        file.write_bytes(b"#EXTM3U\n#EXTINF:1\n/etc/passwd\n")
        with pytest.raises(ImageError, match=rf"a\{suffix}"):
            open_sequence(file)


def trimmed(source, target, frames, fps):
    """A copy that begins some frames later: by its edit list, without being encoded anew."""
    with av.open(str(source)) as whole, av.open(str(target), "w", options={"movflags": "faststart"}) as part:
        stream = whole.streams.video[0]
        copy = part.add_stream_from_template(stream)
        for packet in whole.demux(stream):
            if packet.dts is not None:
                shift = round(frames / (fps * stream.time_base))
                packet.pts, packet.dts, packet.stream = packet.pts - shift, packet.dts - shift, copy
                part.mux(packet)
    return target


@pytest.mark.parametrize(("codec", "suffix"), [("h264", ".mp4"), ("h264", ".mov"), ("prores", ".mov")])
def test_a_trimmed_video_has_the_frames_that_are_shown(tmp_path, codec, suffix):
    levels = np.linspace(0.1, 0.9, 24)
    frames = [np.full((64, 64, 3), level, np.float32) for level in levels]
    source, settings = tmp_path / f"a{video_suffix(codec)}", VideoSettings(codec=codec)
    encode_video(source, frames, fps=24, width=64, height=64, settings=settings, exposure_ev=0)
    file = trimmed(source, tmp_path / f"b{suffix}", 5, 24)
    found = [float(frame.mean()) for frame in open_sequence(file)]
    assert len(open_sequence(file)) == len(found) == 19
    np.testing.assert_allclose(found, levels[5:], atol=0.02)
    data = file.read_bytes()
    for part in range(20):
        file.write_bytes(data[: len(data) * part // 20])
        with pytest.raises(ImageError, match=rf"b\{suffix}"):
            list(open_sequence(file))


@pytest.mark.parametrize("codec", ["h264", "ffv1", "av1", "prores"])
def test_mutated_files_are_read_or_refused(tmp_path, codec):
    rng = np.random.default_rng(7)
    frames = [rng.random((64, 64, 3), np.float32) for _ in range(3)]
    file = tmp_path / f"a{video_suffix(codec)}"
    encode_video(
        file, frames, fps=24, width=64, height=64, settings=VideoSettings(codec=codec), exposure_ev=0
    )
    data = np.frombuffer(file.read_bytes(), np.uint8)
    refused = 0
    for _ in range(80):
        mutated = data.copy()
        mutated[rng.integers(0, len(data), 8)] = rng.integers(0, 256, 8)
        file.write_bytes(mutated.tobytes())
        try:
            shapes = {frame.shape for frame in open_sequence(file)}
        except ImageError:
            refused += 1
        else:
            assert shapes == {(64, 64, 3)}
    assert refused > 0


def test_layers_of_a_video_are_refused(tmp_path):
    with pytest.raises(ImageError, match=r"frame 2 of .*a\.mkv has no layers"):
        open_sequence(foreign(tmp_path / "a.mkv", "yuv444p", colorspace=1)).layers(1)
