"""Videos: colours and tags as decoded again, the same bytes, joined clips, and errors."""

from __future__ import annotations

import errno
import os
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from enfilade.errors import ImageError, RunFolderError, SettingsError
from enfilade.images import encode_video, exact_fps, join_videos, open_sequence, video_suffix
from enfilade.images.codecs import odd_size_note
from enfilade.kernels.tone import srgb_decode, srgb_encode
from enfilade.settings import VideoSettings

NTSC = Fraction(24000, 1001)
CODECS = ("h264", "ffv1", "av1", "prores")
BARS = np.float32(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (0, 0, 0), (0.18,) * 3, (0.5, 0.2, 0.05), (0.02, 0.1, 0.3)]
)


def bars(height=64, width=128, count=3):
    columns = np.arange(width) * len(BARS) // width
    return [np.ascontiguousarray(np.broadcast_to(BARS[columns], (height, width, 3)))] * count


def encoded(file, frames, *, size=(64, 128), fps=24.0, exposure_ev=0.0, **settings):
    height, width = frames[0].shape[:2] if isinstance(frames, list) and frames else size
    settings, how = VideoSettings(**settings), {"width": width, "height": height}
    encode_video(file, iter(frames), fps=fps, settings=settings, exposure_ev=exposure_ev, **how)
    return file


def scheduling():
    return {os.sched_getscheduler(int(thread.name)) for thread in Path("/proc/self/task").iterdir()}


@pytest.mark.parametrize("codec", CODECS)
def test_colours_and_tags_come_back(tmp_path, codec):
    before, meanwhile = scheduling(), set()

    def frames():
        for frame in bars():
            yield frame
            meanwhile.update(scheduling())

    file = encoded(tmp_path / f"a{video_suffix(codec)}", frames(), codec=codec, quality=10)
    assert meanwhile | scheduling() == before
    sequence = open_sequence(file)
    assert (len(sequence), sequence.width, sequence.height, sequence.fps) == (3, 128, 64, 24.0)
    middles = list(sequence)[1][32, 8::16]
    # in code values of sRGB: what 8 bits and a rate factor of 10 leave; FFV1 only rounds
    tolerance = 0.5 / 4095 if codec == "ffv1" else 0.012
    assert abs(srgb_encode(middles) - srgb_encode(BARS)).max() < tolerance + 1e-5
    with av.open(str(file)) as container:
        frame = next(container.decode(video=0))
        tags = (frame.color_primaries, frame.color_trc, int(frame.colorspace), int(frame.color_range))
    # BT.709 primaries, IEC 61966-2-1, BT.709 matrix, limited range; FFV1 holds R'G'B' of full range
    assert tags == ((1, 13, 0, 2) if codec == "ffv1" else (1, 13, 1, 1))
    if codec != "ffv1":
        data = file.read_bytes()
        at = data.index(b"colr" + (b"nclc" if codec == "prores" else b"nclx")) + 8
        assert data[at : at + 6] == bytes([0, 1, 0, 13, 0, 1])


def test_another_decoder_agrees(tmp_path):
    with av.open(str(encoded(tmp_path / "a.mp4", bars(), quality=1))) as container:
        frame = next(container.decode(video=0))
        matrices = {m: frame.to_ndarray(format="rgb24", src_colorspace=m) for m in ("itu709", "itu601")}
    wanted = srgb_encode(BARS) * 255
    errors = {m: abs(rgb[32, 8::16] - wanted).max() for m, rgb in matrices.items()}
    assert errors["itu709"] <= 3  # FFmpeg's converter truncates
    assert errors["itu601"] > 20


def test_a_smooth_wall_has_no_bands(tmp_path):
    # Two codes of luma over the whole width: without dither, the mean of a region is off by a half of one.
    wanted = np.linspace(100.0, 102.0, 256, dtype=np.float32)
    linear = srgb_decode((wanted - 16) / 219)
    wall = np.ascontiguousarray(np.broadcast_to(linear[None, :, None], (64, 256, 3)))
    file = encoded(tmp_path / "a.mp4", [wall] * 24)  # x264 looks ahead to see what stays
    with av.open(str(file)) as container:
        for frame in container.decode(video=0):
            luma = frame.to_ndarray()[:64, :256].reshape(64, 16, 16)
            assert abs(luma.mean(axis=(0, 2)) - wanted.reshape(16, 16).mean(axis=1)).max() < 0.2


@pytest.mark.parametrize("codec", CODECS)
def test_same_frames_same_bytes(tmp_path, codec):
    frames = [*np.random.default_rng(5).random((6, 96, 128, 3), np.float32)]
    files = [encoded(tmp_path / f"{k}{video_suffix(codec)}", frames, codec=codec) for k in range(3)]
    assert len({file.read_bytes() for file in files}) == 1


def test_exposure_and_clipping(tmp_path):
    frames = [np.full((8, 8, 3), value, np.float32) for value in (0.25, 0.5, 3.0, np.inf, -1.0)]
    file = encoded(tmp_path / "a.mkv", frames, codec="ffv1", exposure_ev=1.0)
    np.testing.assert_allclose([f.mean() for f in open_sequence(file)], (0.5, 1, 1, 1, 0), atol=2e-3)


@pytest.mark.parametrize("codec", ["h264", "ffv1", "prores"])
def test_odd_sizes_keep_their_pixels(tmp_path, codec):
    file = encoded(tmp_path / f"a{video_suffix(codec)}", bars(65, 121), codec=codec)
    assert next(iter(open_sequence(file))).shape == (65, 121, 3)
    sizes = {(640, 480): "", (641, 480): "640x480", (640, 361): "640x360", (3, 3): "2x2"}
    for size, even in sizes.items():
        wanted = f"--size {even} is" if codec == "h264" and even else ""
        assert wanted in odd_size_note(codec, *size)
        assert bool(wanted) == bool(odd_size_note(codec, *size))


@pytest.mark.parametrize(
    ("settings", "size", "message"),
    [
        ({"codec": "mjpeg"}, (64, 64), "h264, ffv1, av1, prores"),
        ({"codec": "av1"}, (65, 64), "64x65 pixels; choose an even size"),
        ({"codec": "av1"}, (32, 32), "must have 64 at least; choose a larger size, or another"),
        ({"codec": "av1"}, (8706, 64), "8704 is its greatest height"),
        ({"codec": "av1", "fps": 240.5}, (64, 64), "240.5 frames per second: 240 is its most"),
        ({"codec": "h264", "quality": 60}, (64, 64), "between 0 and 51"),
        ({"view": "Filmic"}, (64, 64), "set .video. ocio too"),
        ({"ocio": "/nowhere/config.ocio"}, (64, 64), "/nowhere/config.ocio"),
    ],
)
def test_impossible_settings_are_refused(tmp_path, settings, size, message):
    with pytest.raises(SettingsError, match=message):
        encoded(tmp_path / "a.mp4", bars(*size), **settings)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("codec", CODECS)
def test_bad_frames_leave_the_older_video(tmp_path, codec):
    file = tmp_path / f"a{video_suffix(codec)}"
    file.write_text("older")
    nan, small = np.full((64, 128, 3), np.nan, np.float32), np.zeros((64, 62, 3), np.float32)
    for frames in ([], [nan], [*bars(), small], [*bars(), nan]):
        with pytest.raises(ImageError, match=r"no frames|frame [03] of the video"):
            encoded(file, frames, codec=codec)
    assert [f.read_text() for f in tmp_path.iterdir()] == ["older"]


def test_a_place_that_can_not_be_written_and_too_little_memory_differ(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match=r"file/a\.mp4"):
        encoded(tmp_path / "file" / "a.mp4", bars())

    def scarce():
        yield bars()[0]
        raise av.error.MemoryError(errno.ENOMEM, "Cannot allocate memory")

    with pytest.raises(MemoryError):
        encoded(tmp_path / "a.mp4", scarce())
    assert [f.name for f in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("fps", "exact"),
    [(24, 24), (23.976, NTSC), (23.98, NTSC), (59.94, NTSC * 5 / 2), (12.5, Fraction(25, 2)), (NTSC, NTSC)],
)
def test_frames_per_second_are_the_fraction_that_is_meant(tmp_path, fps, exact):
    assert exact_fps(fps) == exact
    with av.open(str(encoded(tmp_path / "a.mp4", bars(16, 16), fps=fps))) as container:
        assert container.streams.video[0].average_rate == exact
    for impossible in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="frames per second"):
            exact_fps(impossible)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("fps", [30.0, 23.976])
def test_joined_clips_are_the_video(tmp_path, monkeypatch, codec, fps):
    monkeypatch.chdir(tmp_path)
    wide = np.random.default_rng(4).random((64, 160, 3)).astype(np.float32)
    frames = [np.ascontiguousarray(wide[:, i : i + 96]) for i in range(20)]
    suffix, clips = video_suffix(codec), []
    for first, last in ((0, 9), (9, 18), (18, 20)):
        clip = encoded(Path(f"walk:2/{first}{suffix}"), frames[first:last], fps=fps, codec=codec)
        clips.append((clip, last - first))  # FFmpeg must not take the name for a protocol
    files = [Path(f"walk:2/{name}{suffix}") for name in ("joined", "again")]
    for file in files:
        join_videos(file, clips, fps=fps)
    assert files[0].read_bytes() == files[1].read_bytes()
    joined = open_sequence(files[0])
    assert joined.fps == pytest.approx(float(exact_fps(fps)), abs=1e-6)
    parts = [frame for clip, _ in clips for frame in open_sequence(clip)]
    assert all(np.array_equal(a, b) for a, b in zip(joined, parts, strict=True))
    with av.open(str(files[0].absolute())) as container:
        times = [float(frame.pts * frame.time_base) for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(20) / float(exact_fps(fps)), atol=6e-4)  # Matroska's are ms


def test_a_damaged_clip_is_named(tmp_path):
    clip, file = encoded(tmp_path / "0.mp4", bars()), tmp_path / "a.mp4"
    with pytest.raises(ImageError, match=r"0\.mp4 has 3 frames, not 4"):
        join_videos(file, [(clip, 4)], fps=24.0)
    with pytest.raises(ImageError, match=r"can't decode .*1\.mp4.*delete it to make it again"):
        join_videos(file, [(tmp_path / "1.mp4", 4)], fps=24.0)
    assert not file.exists()
