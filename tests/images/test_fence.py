"""A process of its own decodes: the same frames, the same errors, and bounds that hold."""

from __future__ import annotations

import os
import signal
import socket
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from enfilade.errors import ImageError
from enfilade.images import FencedSequence, encode_video, open_sequence, write_exr
from enfilade.images.fence import receive, send
from enfilade.settings import LimitSettings, VideoSettings

LIMITS = LimitSettings()


def exrs(folder, count=3):
    rng = np.random.default_rng(3)
    for index in range(count):
        color = rng.random((4, 6, 3)).astype(np.float32)
        write_exr(folder / f"{index:04d}.exr", {"RGB": color, "item": np.full((4, 6), index, np.uint32)})
    return folder


def test_frames_names_and_layers_are_those_of_the_sequence(tmp_path):
    plain, fenced = open_sequence(exrs(tmp_path)), FencedSequence(tmp_path, LIMITS)
    for name in ("width", "height", "fps", "exposure_ev", "numbers", "starts", "note"):
        assert getattr(fenced, name) == getattr(plain, name)
    assert len(fenced) == len(plain) == 3
    for _ in range(2):  # a second iteration begins anew
        assert all(np.array_equal(a, b) for a, b in zip(fenced, plain, strict=True))
    for index in range(3):
        assert fenced.name(index) == plain.name(index)
        layers, wanted = fenced.layers(index), plain.layers(index)
        assert all(np.array_equal(layers[name], wanted[name]) for name in wanted)
        assert {name: a.dtype for name, a in layers.items()} == {name: a.dtype for name, a in wanted.items()}


def test_a_video(tmp_path):
    frames = [np.full((16, 32, 3), value, np.float32) for value in (0.2, 0.5)]
    file, settings = tmp_path / "a.mkv", VideoSettings(codec="ffv1")
    encode_video(file, frames, fps=24.0, width=32, height=16, settings=settings, exposure_ev=0.0)
    fenced = FencedSequence(file, LIMITS)
    assert fenced.fps == 24.0
    assert all(np.array_equal(a, b) for a, b in zip(fenced, open_sequence(file), strict=True))
    with pytest.raises(ImageError, match="has no layers"):
        fenced.layers(0)


def test_errors_are_those_of_the_sequence(tmp_path):
    with pytest.raises(ImageError, match="there is no file, folder or pattern"):
        FencedSequence(tmp_path / "missing.exr", LIMITS)
    exrs(tmp_path)
    file = tmp_path / "0001.exr"
    file.write_bytes(file.read_bytes()[:-20])
    frames = iter(FencedSequence(tmp_path, LIMITS))
    next(frames)
    with pytest.raises(ImageError, match=r"0001\.exr is cut off or damaged"):
        next(frames)


def large_png(folder, size=6000):
    file = folder / "large.png"
    Image.fromarray(np.zeros((size, size, 3), np.uint8)).save(file)
    return file


def test_too_much_memory(tmp_path):
    with pytest.raises(ImageError, match=r"large\.png"):  # 36 megapixels are 430 MB as floats
        FencedSequence(large_png(tmp_path), replace(LIMITS, preflight_mb=900))


def test_too_much_time(tmp_path):
    with pytest.raises(ImageError, match=r"was not decoded in 0\.1 s; raise --limits-preflight-s"):
        FencedSequence(large_png(tmp_path), replace(LIMITS, preflight_s=0.1))


def test_a_decoder_that_dies(tmp_path):
    fenced = FencedSequence(exrs(tmp_path), LIMITS)
    os.kill(fenced._child.pid, signal.SIGSEGV)
    with pytest.raises(ImageError, match=r"too much for the process that decodes it \(exit code -11"):
        list(fenced)


def test_the_process_ends_with_the_sequence(tmp_path):
    fenced = FencedSequence(exrs(tmp_path), LIMITS)
    child = fenced._child
    del fenced
    assert child.poll() is not None


@pytest.mark.parametrize(
    "head",
    [
        b"[{}, []",
        b'[{}, [["a", "object", [1]]]]',
        b'[{}, [["a", "float32", [-1, 2]]]]',
        b'[{}, [["a", "float32", [100000, 100000]]]]',
    ],
)
def test_a_message_that_promises_too_much_is_refused(head):
    here, there = socket.socketpair()
    with here, there:
        there.sendall(len(head).to_bytes(8, "little") + head)
        with pytest.raises(ValueError, match=r".+"):
            receive(here, most_bytes=1 << 20)


def test_a_message_that_ends_early():
    here, there = socket.socketpair()
    with here:
        with there:
            send(there, "x", {"a": np.zeros(3, np.float32)})
        answer, pixels = receive(here, most_bytes=100)
        assert answer == "x"
        assert pixels["a"].tolist() == [0.0, 0.0, 0.0]
        with pytest.raises(EOFError):
            receive(here, most_bytes=100)


def test_modules_that_lie_where_one_stands_are_not_run(tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit(7)")
    exrs(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert len(FencedSequence(tmp_path, LIMITS)) == 3


def test_an_exr_that_takes_too_much_memory_is_not_called_damaged(tmp_path):
    write_exr(tmp_path / "a.exr", {"RGB": np.zeros((5000, 5000, 3), np.float32)})
    with pytest.raises(ImageError, match="needs more --limits-preflight-mb"):
        FencedSequence(tmp_path / "a.exr", replace(LIMITS, preflight_mb=700))
