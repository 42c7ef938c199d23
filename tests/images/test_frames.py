"""Records and OpenEXR files: exact ones come back bit by bit, delivered ones stay in range."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from enfilade.errors import ImageError
from enfilade.images import (
    read_exr,
    read_frame,
    read_light,
    read_parts,
    read_shading,
    write_exr,
    write_frame,
    write_light,
    write_parts,
    write_result,
    write_shading,
)
from enfilade.records import Frame, Shading

sizes = st.tuples(st.integers(1, 24), st.integers(1, 24))
RELAXED = settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@RELAXED
@given(data=st.data(), size=sizes, dropped=st.integers(0, 2**40))
def test_shading_comes_back_exactly(tmp_path, data, size, dropped):
    color, variance = (
        data.draw(arrays.arrays(np.float32, shape, fill=st.just(1))) for shape in ((*size, 3), size)
    )
    write_shading(tmp_path / "a.exr", Shading(color, variance, dropped))
    back = read_shading(tmp_path / "a.exr")
    assert back.color.tobytes() == color.tobytes()
    assert back.variance.tobytes() == variance.tobytes()
    assert back.dropped == dropped


def test_light_comes_back_exactly(tmp_path):
    rng = np.random.default_rng(1)
    direct, indirect = (
        Shading(*(rng.random(shape).astype(np.float32) for shape in ((5, 7, 3), (5, 7))), 3) for _ in "ab"
    )
    is_known = rng.random((5, 7)) < 0.5
    write_light(tmp_path / "a.exr", direct, indirect, is_known)
    back = read_light(tmp_path / "a.exr")
    np.testing.assert_array_equal(back[2], is_known)
    for got, put in zip(back[:2], (direct, indirect), strict=True):
        assert (got.color.tobytes(), got.variance.tobytes()) == (put.color.tobytes(), put.variance.tobytes())
        assert got.dropped == 3


@pytest.mark.parametrize("layers", [1, 2])
def test_parts_are_what_was_said_when_they_were_written(tmp_path, layers):
    rng = np.random.default_rng(2)
    seen, color = (rng.random((5, 7, 3)).astype(np.float32) for _ in "ab")
    seen[0, 0] = 1e9  # beyond half floats
    scattered = [Shading(color * k, k * rng.random((5, 7)).astype(np.float32)) for k in range(1, layers + 1)]
    source = rng.integers(0, 5, (5, 7)).astype(np.uint8)
    said = write_parts(tmp_path / "a.exr", seen, scattered, source, 4)
    back = read_parts(tmp_path / "a.exr")
    np.testing.assert_array_equal(back[0], said[0])
    assert len(back[1]) == len(said[1]) == layers
    for read, written, given_ in zip(back[1], said[1], scattered, strict=True):
        np.testing.assert_array_equal(read.color, written.color)
        np.testing.assert_array_equal(read.variance, written.variance)
        np.testing.assert_allclose(read.color, given_.color, rtol=1e-3, atol=1e-6)
        assert read.dropped == 4
    np.testing.assert_array_equal(back[2], source)
    assert np.isfinite(back[0]).all()
    np.testing.assert_allclose(back[0][1:], seen[1:], rtol=1e-3)


@RELAXED
@given(data=st.data(), size=sizes)
def test_frames_come_back_exactly(tmp_path, data, size):
    color = data.draw(arrays.arrays(np.float32, (*size, 3), fill=st.just(1)))
    source = data.draw(arrays.arrays(np.uint8, size))
    write_frame(tmp_path / "a.exr", Frame(color, source))
    back = read_frame(tmp_path / "a.exr")
    assert back.color.tobytes() == color.tobytes()
    assert back.source.tobytes() == source.tobytes()


def test_a_file_of_something_else_is_refused(tmp_path):
    file = tmp_path / "a.exr"
    write_exr(file, {"RGB": np.zeros((4, 4, 3), np.float16)})
    for read in (read_frame, read_shading):
        with pytest.raises(ImageError, match=r"a\.exr has no layer 'RGB' of float32"):
            read(file)
    write_exr(file, {"RGB": np.zeros((4, 4, 3), np.float32), "variance": np.zeros((4, 4), np.float32)})
    with pytest.raises(ImageError, match="dropped"):
        read_shading(file)


def test_the_delivered_frame(tmp_path):
    rng = np.random.default_rng(3)
    height, width = 6, 9
    three, two = rng.random((height, width, 3), np.float32), rng.random((height, width, 2), np.float32)
    item = rng.integers(0, 2**32, (height, width), dtype=np.uint32)
    source = np.ones((height, width), np.uint32)
    color = three.copy()
    color[0, 0] = (1e9, -1e9, 65504)
    put = {"Z": three[..., 0].copy(), "P": three, "N": three, "albedo": three, "item": item}
    put |= {"forward": -two, "backward": two, "source": source}
    write_result(tmp_path / "a.exr", color, put, attributes={"frame": 12})
    layers = read_exr(tmp_path / "a.exr")
    np.testing.assert_array_equal(layers["RGB"][0, 0], (65504, -65504, 65504))
    np.testing.assert_array_equal(layers["RGB"][1:], color[1:].astype(np.float16))
    for name, array in {"item": item, "source": source}.items():
        np.testing.assert_array_equal(layers[name], array)
    rounded = {"Z": put["Z"], "P": three, "forward": -two, "backward": two}
    for name, array in rounded.items():
        np.testing.assert_allclose(layers[name], array, rtol=2.0**-16)
    assert {name: str(a.dtype) for name, a in layers.items()} == {
        "RGB": "float16", "N": "float16", "albedo": "float16", "Z": "float32", "P": "float32",
        "forward": "float32", "backward": "float32", "item": "uint32", "source": "uint32",
    }  # fmt: skip
    with OpenEXR.File(str(tmp_path / "a.exr"), header_only=True) as image:
        assert image.header()["frame"] == 12
