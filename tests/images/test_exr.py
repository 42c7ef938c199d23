"""Layers and OpenEXR files: exact round trips, and files that are cut off, damaged or foreign."""

from __future__ import annotations

import errno
import struct
from fractions import Fraction

import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from enfilade.errors import ImageError
from enfilade.files import is_passing
from enfilade.images import exr, read_attributes, read_exr, write_exr
from enfilade.images.exr import color_layers

KINDS = {"float16": np.float16, "float32": np.float32, "uint32": np.uint32}
HEADER = {"type": OpenEXR.scanlineimage}
NOISE = {"RGB": np.random.default_rng(1).random((64, 16, 3), np.float32)}


@st.composite
def layer_sets(draw):
    height, width = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    names = draw(st.lists(st.sampled_from(["RGB", "Z", "P", "N", "forward", "item", "a.b"]), min_size=1))
    depth = {"RGB": (3,), "P": (3,), "N": (3,), "forward": (2,)}
    kinds = st.sampled_from(sorted(KINDS))
    return {
        name: draw(arrays.arrays(KINDS[draw(kinds)], (height, width, *depth.get(name, ())), fill=st.just(0)))
        for name in names
    }


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(layers=layer_sets())
def test_every_layer_comes_back_bit_by_bit(tmp_path, layers):
    write_exr(tmp_path / "a.exr", layers)
    back = read_exr(tmp_path / "a.exr")
    assert back.keys() == layers.keys()
    for name, array in layers.items():
        assert back[name].dtype == array.dtype
        assert back[name].tobytes() == array.tobytes()


def test_channels_have_the_names_that_other_programs_expect(tmp_path):
    one, two, three = (np.zeros((4, 5, *s), np.float32) for s in ((), (2,), (3,)))
    layers = {"RGB": three, "Z": one, "P": three, "N": three, "albedo": three, "forward": two}
    write_exr(tmp_path / "a.exr", {**layers, "item": one.astype(np.uint32)}, is_portable=True)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as image:
        names = sorted(image.channels())
        assert image.header()["compression"] == OpenEXR.PXR24_COMPRESSION
    assert " ".join(names) == (
        "B G N.X N.Y N.Z P.X P.Y P.Z R Z albedo.B albedo.G albedo.R forward.u forward.v item"
    )
    assert "RGB" in read_exr(tmp_path / "a.exr")


def test_same_input_same_bytes_and_attributes(tmp_path):
    values = {"frame": 7, "scene": "Zimmer ü", "x": 0.5, "framesPerSecond": Fraction(24000, 1001)}
    write_exr(tmp_path / "a.exr", NOISE, attributes=values)
    write_exr(tmp_path / "b.exr", NOISE, attributes=dict(reversed(values.items())))
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert read_attributes(tmp_path / "a.exr") == values


def test_a_rate_over_zero_is_damage(tmp_path):
    file = tmp_path / "a.exr"
    write_exr(file, NOISE, attributes={"framesPerSecond": Fraction(24000, 1001)})
    rate = struct.pack("<iI", 24000, 1001)
    file.write_bytes(file.read_bytes().replace(rate, struct.pack("<iI", 24000, 0)))
    with pytest.raises(ImageError, match=r"a\.exr is cut off or damaged"):
        read_attributes(file)


def test_a_file_that_is_cut_off_is_refused_by_name(tmp_path, capsys):
    file = tmp_path / "cut.exr"
    write_exr(file, NOISE)
    data = file.read_bytes()
    for end in (*range(0, len(data), len(data) // 24), -1):
        file.write_bytes(data[:end])
        with pytest.raises(ImageError, match=r"cut\.exr"):
            read_exr(file)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("data", [None, b"", b"x" * 1000, exr.MAGIC, exr.MAGIC + b"\xff" * 99, b"Z\xd2ta\0"])
def test_missing_files_and_garbage_are_refused_by_name(tmp_path, data):
    file = tmp_path / "a.exr"
    if data == b"Z\xd2ta\0":  # a channel whose name is no text
        write_exr(file, {"Zeta": np.ones((4, 4), np.float32)})
        data = file.read_bytes().replace(b"Zeta\0", data, 1)
    if data is not None:
        file.write_bytes(data)
    for read in (read_exr, color_layers, read_attributes):
        with pytest.raises(ImageError, match=r"a\.exr"):
            read(file)


def test_errors_of_the_disk_and_too_little_memory_are_no_damage(tmp_path, monkeypatch):
    file = tmp_path / "a.exr"
    write_exr(file, NOISE)

    def failing(*_arguments, **_options):
        raise errors[0]

    def broken(self, *how):
        opened.append(self)
        if len(opened) > 1:  # the first bytes are read
            raise OSError(errno.EIO, "Input/output error")
        return really(self, *how)

    really, opened, errors = type(file).open, [], [RuntimeError("OpenEXR gives no reason")]
    monkeypatch.setattr(OpenEXR, "File", failing)
    with pytest.raises(ImageError, match="cut off or damaged"):
        read_exr(file)
    monkeypatch.setattr(type(file), "open", broken)
    with pytest.raises(ImageError, match=r"can't read .*Input/output error") as caught:
        read_exr(file)
    assert is_passing(caught.value.__cause__)
    opened.clear()
    errors[0] = MemoryError()
    with pytest.raises(MemoryError):
        read_exr(file)


def test_a_size_in_the_header_is_checked_first(tmp_path, monkeypatch):
    write_exr(tmp_path / "a.exr", {"Z": np.zeros((10, 20), np.float32)})
    monkeypatch.setattr(exr, "MAX_PIXELS", 199)
    with pytest.raises(ImageError, match="20x10 pixels; at most 199"):
        read_exr(tmp_path / "a.exr")


@pytest.mark.parametrize("left", [1, 7])  # the data window reaches beyond the display window, or lies outside
def test_foreign_names_mixed_types_and_windows(tmp_path, left):
    plane = np.arange(6, dtype=np.float32).reshape(2, 3)
    header = {
        "type": OpenEXR.tiledimage,
        "tiles": OpenEXR.TileDescription(),
        "compression": OpenEXR.PIZ_COMPRESSION,
        "dataWindow": (np.array([left, -1], np.int32), np.array([left + 2, 0], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([2, 3], np.int32)),
    }
    names = dict.fromkeys([f"View Layer.Combined.{c}" for c in "RGBA"], plane)
    with OpenEXR.File(header, {**names, "R": plane.astype(np.float16), "G": plane, "B": plane}) as image:
        image.write(str(tmp_path / "a.exr"))
    layers = read_exr(tmp_path / "a.exr")
    assert set(layers) == {"View Layer.Combined", "View Layer.Combined.A", "RGB"}
    assert layers["RGB"].dtype == np.float32  # half and float together
    assert color_layers(tmp_path / "a.exr") == ("RGB", "View Layer.Combined")
    expected = np.zeros((4, 3), np.float32)
    expected[:1, left:] = plane[1:, : max(3 - left, 0)]
    np.testing.assert_array_equal(layers["View Layer.Combined"][..., 1], expected)


def test_layers_of_parts_have_the_names_of_their_parts(tmp_path):
    plane = np.ones((2, 3), np.float32)
    parts = {
        "albedo": {**dict.fromkeys("RGB", plane), "Z": plane * 0},
        "beauty": {**dict.fromkeys("RGBA", plane * 2), "Z": plane},
        "rest": {**dict.fromkeys(("light.R", "light.G", "light.B"), plane), "N.X": plane, "R": plane},
    }
    with OpenEXR.File([OpenEXR.Part({"name": n, **HEADER}, c) for n, c in parts.items()]) as image:
        image.write(str(tmp_path / "a.exr"))
    layers = read_exr(tmp_path / "a.exr")
    assert set(layers) == {"albedo", "albedo.Z", "beauty", "beauty.A", "beauty.Z", "light", "N.X", "rest.R"}
    assert [layers[n].max() for n in ("albedo", "beauty", "albedo.Z", "beauty.Z")] == [1, 2, 0, 1]
    assert color_layers(tmp_path / "a.exr") == ("albedo", "beauty", "light")


@pytest.mark.parametrize(
    "layers",
    [
        {},
        {"Z": np.zeros((0, 4), np.float32)},
        {"Z": np.zeros((4, 4))},
        {"Z": np.zeros((4, 4, 4), np.float32)},
        {"RGB": np.zeros((4, 4, 2), np.float32)},
        {"Z": np.zeros((4, 4), np.float32), "item": np.zeros((4, 5), np.uint32)},
    ],
)
def test_layers_that_can_not_be_written(tmp_path, layers):
    with pytest.raises(ValueError, match=r"can be written|can't be written|same size"):
        write_exr(tmp_path / "a.exr", layers)
    with pytest.raises(ValueError, match="itself writes: type"):
        write_exr(tmp_path / "a.exr", NOISE, attributes={"type": "x"})
    assert not list(tmp_path.iterdir())
