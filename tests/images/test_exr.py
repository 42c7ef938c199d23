"""Layers and OpenEXR files: exact round trips, and files that are cut off, damaged or foreign."""

from __future__ import annotations

import errno
import hashlib
from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from enfilade.errors import ImageError, NoSpaceError, RunFolderError
from enfilade.files import sweep
from enfilade.images import read_attributes, read_exr, write_exr
from enfilade.images.exr import color_layers

KINDS = {"float16": np.float16, "float32": np.float32, "uint32": np.uint32}


@st.composite
def layer_sets(draw):
    height, width = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    names = draw(st.lists(st.sampled_from(["RGB", "Z", "P", "N", "forward", "item", "a.b"]), min_size=1))
    depth = {"RGB": (3,), "P": (3,), "N": (3,), "forward": (2,)}
    return {
        name: draw(
            arrays.arrays(
                KINDS[draw(st.sampled_from(sorted(KINDS)))],
                (height, width, *depth.get(name, ())),
                fill=st.just(0),
            )
        )
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
    layers = {"": three, "Z": one, "P": three, "N": three, "albedo": three, "forward": two}
    write_exr(tmp_path / "a.exr", {**layers, "item": one.astype(np.uint32)}, is_portable=True)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as image:
        names = set(image.channels())
        assert image.header()["compression"] == OpenEXR.PXR24_COMPRESSION
    assert ".".join(sorted(names)) == (
        "B.G.N.X.N.Y.N.Z.P.X.P.Y.P.Z.R.Z.albedo.B.albedo.G.albedo.R.forward.u.forward.v.item"
    )
    assert "RGB" in read_exr(tmp_path / "a.exr")


def test_same_input_same_bytes_and_attributes(tmp_path):
    layers = {"RGB": np.random.default_rng(1).random((20, 30, 3), np.float32)}
    write_exr(tmp_path / "a.exr", layers, attributes={"frame": 7, "scene": "Zimmer ü", "x": 0.5})
    write_exr(tmp_path / "b.exr", layers, attributes={"x": 0.5, "scene": "Zimmer ü", "frame": 7})
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert read_attributes(tmp_path / "a.exr") == {"frame": 7, "scene": "Zimmer ü", "x": 0.5}
    digest = hashlib.sha256((tmp_path / "a.exr").read_bytes())
    assert sorted(f.name for f in tmp_path.iterdir()) == ["a.exr", "b.exr"], digest


@pytest.mark.parametrize("part", range(24))
def test_a_cut_off_file_is_refused_by_name(tmp_path, part, capsys):
    whole, cut = tmp_path / "whole.exr", tmp_path / "cut.exr"
    write_exr(whole, {"RGB": np.random.default_rng(1).random((64, 16, 3), np.float32)})
    data = whole.read_bytes()
    cut.write_bytes(data[: len(data) * part // 24])
    with pytest.raises(ImageError, match=r"cut\.exr"):
        read_exr(cut)
    assert capsys.readouterr().out == ""


def test_the_last_byte_counts(tmp_path):
    write_exr(tmp_path / "a.exr", {"Z": np.random.default_rng(1).random((64, 16), np.float32)})
    (tmp_path / "a.exr").write_bytes((tmp_path / "a.exr").read_bytes()[:-1])
    with pytest.raises(ImageError, match=r"a\.exr"):
        read_exr(tmp_path / "a.exr")


@pytest.mark.parametrize("data", [b"", b"x" * 1000, b"\x76\x2f\x31\x01", b"\x76\x2f\x31\x01" + b"\xff" * 99])
def test_garbage_is_refused_by_name(tmp_path, data):
    (tmp_path / "a.exr").write_bytes(data)
    with pytest.raises(ImageError, match=r"a\.exr"):
        read_exr(tmp_path / "a.exr")


def test_too_little_memory_is_no_damage(tmp_path, monkeypatch):
    write_exr(tmp_path / "a.exr", {"Z": np.zeros((10, 20), np.float32)})

    def scarce(*_arguments, **_options):
        raise MemoryError

    monkeypatch.setattr("enfilade.images.exr.OpenEXR.File", scarce)
    with pytest.raises(MemoryError):
        read_exr(tmp_path / "a.exr")


def test_missing_files_and_folders_are_refused(tmp_path):
    for file in (tmp_path / "none.exr", tmp_path):
        with pytest.raises(ImageError, match=str(file)):
            read_exr(file)


def test_a_file_that_is_too_large_is_refused_before_it_is_read(tmp_path):
    write_exr(tmp_path / "a.exr", {"Z": np.zeros((10, 20), np.float32)})
    with pytest.raises(ImageError, match="20x10 pixels; at most 199"):
        read_exr(tmp_path / "a.exr", max_pixels=199)


def test_foreign_names_mixed_types_and_windows(tmp_path):
    plane = np.arange(6, dtype=np.float32).reshape(2, 3)
    header = {
        "type": OpenEXR.tiledimage,
        "tiles": OpenEXR.TileDescription(),
        "compression": OpenEXR.PIZ_COMPRESSION,
        "dataWindow": (np.array([1, 0], np.int32), np.array([3, 1], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([2, 3], np.int32)),
    }
    names = {"View Layer.Combined.R": plane, "View Layer.Combined.G": plane, "View Layer.Combined.B": plane}
    alpha = {"View Layer.Combined.A": plane, "R": plane.astype(np.float16), "G": plane, "B": plane}
    with OpenEXR.File(header, {**names, **alpha}) as image:
        image.write(str(tmp_path / "a.exr"))
    layers = read_exr(tmp_path / "a.exr")
    assert set(layers) == {"View Layer.Combined", "View Layer.Combined.A", "RGB"}
    assert layers["RGB"].dtype == np.float32  # half and float together
    assert color_layers(tmp_path / "a.exr") == ("RGB", "View Layer.Combined")
    expected = np.zeros((4, 3), np.float32)
    expected[:2, 1:] = plane[:, :2]
    np.testing.assert_array_equal(layers["View Layer.Combined"][..., 1], expected)


def test_parts_come_together(tmp_path):
    plane = np.ones((2, 3), np.float32)
    parts = [
        OpenEXR.Part({"name": name, "type": OpenEXR.scanlineimage}, {"Z": plane * k})
        for k, name in enumerate(("left", "right"))
    ]
    with OpenEXR.File(parts) as image:
        image.write(str(tmp_path / "a.exr"))
    layers = read_exr(tmp_path / "a.exr")
    assert (layers["left.Z"].max(), layers["right.Z"].max()) == (0, 1)


def test_layers_of_parts_have_the_names_of_their_parts(tmp_path):
    plane = np.ones((2, 3), np.float32)
    parts = {
        "albedo": dict.fromkeys("RGB", plane),
        "beauty": dict.fromkeys("RGBA", plane * 2),
        "rest": {**dict.fromkeys(("light.R", "light.G", "light.B"), plane), "N.X": plane, "R": plane},
    }
    header = {"type": OpenEXR.scanlineimage}
    with OpenEXR.File([OpenEXR.Part({"name": n, **header}, c) for n, c in parts.items()]) as image:
        image.write(str(tmp_path / "a.exr"))
    layers = read_exr(tmp_path / "a.exr")
    assert set(layers) == {"albedo", "beauty", "beauty.A", "light", "N.X", "rest.R"}
    assert (layers["albedo"].max(), layers["beauty"].max()) == (1, 2)
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
def test_what_can_not_be_written_is_said(tmp_path, layers):
    with pytest.raises(ValueError, match=r"can be written|no way"):
        write_exr(tmp_path / "a.exr", layers)
    with pytest.raises(ValueError, match="for itself: type"):
        write_exr(tmp_path / "a.exr", {"Z": np.zeros((4, 4), np.float32)}, attributes={"type": "x"})
    assert not list(tmp_path.iterdir())


def test_nothing_partial_is_left_where_writing_fails(tmp_path, monkeypatch):
    file = tmp_path / "a.exr"
    layers = {"Z": np.zeros((4, 4), np.float32)}
    write_exr(file, layers)
    before = file.read_bytes()
    (tmp_path / "flat").write_text("")
    with pytest.raises(RunFolderError, match=r"flat/a\.exr.*run the same command"):
        write_exr(tmp_path / "flat" / "a.exr", layers)

    def torn(self, data):
        really(self, data[:40])
        raise OSError(errno.ENOSPC, "No space left on device")

    really = Path.write_bytes
    monkeypatch.setattr(Path, "write_bytes", torn)
    with pytest.raises(NoSpaceError, match="No space left"):
        write_exr(file, layers)
    assert file.read_bytes() == before
    assert sorted(f.name for f in tmp_path.iterdir()) == ["a.exr", "flat"]


def test_a_full_disk_is_said():
    with pytest.raises(RunFolderError, match="can't write /dev/full/a"):
        write_exr(Path("/dev/full/a.exr"), {"Z": np.zeros((4, 4), np.float32)})


def test_what_a_killed_process_left_is_swept(tmp_path):
    write_exr(tmp_path / "sub" / "a.exr", {"Z": np.zeros((4, 4), np.float32)})
    left = tmp_path / "sub" / ".0001.writing-123-abcd.exr"
    left.write_bytes(b"x")
    assert sweep(tmp_path) == [left]
    assert [f.name for f in (tmp_path / "sub").iterdir()] == ["a.exr"]


def test_a_rate_is_a_rational(tmp_path):
    rate = Fraction(24000, 1001)
    write_exr(tmp_path / "a.exr", {"Z": np.zeros((2, 3), np.float32)}, attributes={"framesPerSecond": rate})
    assert read_attributes(tmp_path / "a.exr") == {"framesPerSecond": rate}


def test_channels_whose_names_are_no_text_are_refused(tmp_path):
    file = tmp_path / "a.exr"
    write_exr(file, {"Zeta": np.ones((4, 4), np.float32)})
    file.write_bytes(file.read_bytes().replace(b"Zeta\0", b"Z\xd2ta\0", 1))
    for read in (read_exr, color_layers, read_attributes):
        with pytest.raises(ImageError, match="damaged"):
            read(file)
