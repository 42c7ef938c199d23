"""View transforms: sRGB, and OpenColorIO where it is installed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from enfilade.errors import SettingsError
from enfilade.images.view import files_of_view, open_view, view_identity, white_of
from enfilade.kernels.tone import compressed, srgb_encode
from enfilade.settings import VideoSettings

CONFIG = """ocio_profile_version: 2
search_path: ""
roles: {{default: raw, scene_linear: lin_rec709}}
displays:
  {display}:
    - !<View> {{name: Plain, colorspace: encoded}}
    - !<View> {{name: Raw, colorspace: raw}}
active_displays: []
active_views: []
colorspaces:
  - !<ColorSpace> {{name: raw, isdata: true}}
  - !<ColorSpace> {{name: {linear}}}
  - !<ColorSpace>
    name: encoded
    from_scene_reference: !<ExponentWithLinearTransform> {{gamma: 2.4, offset: 0.055, direction: inverse}}
"""


def config(tmp_path, display="sRGB", linear="lin_rec709"):
    file = tmp_path / "config.ocio"
    file.write_text(CONFIG.format(display=display, linear=linear))
    return str(file)


def test_srgb_has_the_numbers_of_the_standard():
    linear = np.float32([[[0.0, 0.0031308, 0.18]], [[0.5, 1.0, 9.0]]])
    view = open_view(VideoSettings(), 0.0)
    np.testing.assert_allclose(view.encode(linear).ravel(), (0, 0.04045, 0.4614, 0.7354, 1, 1), atol=1e-4)
    assert view.transfer == 13
    np.testing.assert_allclose(open_view(VideoSettings(), 1.0).encode(linear / 2), view.encode(linear))


@pytest.mark.parametrize(("display", "transfer"), [("sRGB", 13), ("Rec.1886 Rec.709 - Display", 1)])
def test_opencolorio_gives_the_view_of_the_configuration(tmp_path, display, transfer):
    pytest.importorskip("PyOpenColorIO")
    linear = np.random.default_rng(0).random((5, 7, 3), np.float32)
    before, file = linear.copy(), config(tmp_path, display)
    view = open_view(VideoSettings(ocio=file), 1.0)
    expected = open_view(VideoSettings(), 1.0).encode(linear)
    np.testing.assert_allclose(view.encode(linear), expected, atol=1e-3)
    np.testing.assert_array_equal(linear, before)
    assert view.transfer == transfer
    raw = open_view(VideoSettings(ocio=file, view="Raw"), 0.0)
    np.testing.assert_allclose(raw.encode(linear), linear, atol=1e-6)
    identity = view_identity(VideoSettings(ocio=file))
    assert identity.keys() == {"opencolorio", "processor"}
    assert identity != view_identity(VideoSettings(ocio=file, view="Raw"))
    assert view_identity(VideoSettings()) == {}


def test_the_white_of_a_view(tmp_path):
    pytest.importorskip("PyOpenColorIO")
    assert white_of(VideoSettings()) == white_of(VideoSettings(ocio=config(tmp_path))) == 1.0
    # A view with a tone curve of its own, as a table up to its white.
    file, white = Path(config(tmp_path)), 8.0
    curve = srgb_encode(compressed(np.linspace(0.0, white, 8193), white))
    rows = "\n".join(f"{value:.7f}" for value in curve)
    (tmp_path / "curve.spi1d").write_text(
        f"Version 1\nFrom 0.0 {white}\nLength {len(curve)}\nComponents 1\n{{\n{rows}\n}}\n"
    )
    text = file.read_text().replace(
        "active_displays", "    - !<View> {name: Soft, colorspace: soft}\nactive_displays", 1
    )
    soft = "  - !<ColorSpace> {name: soft, from_scene_reference: !<FileTransform> {src: curve.spi1d}}\n"
    file.write_text(text + soft)
    assert white_of(VideoSettings(ocio=str(file), view="Soft")) == white


def test_a_display_by_its_name(tmp_path):
    pytest.importorskip("PyOpenColorIO")
    more = "  Rec.1886:\n    - !<View> {name: Raw, colorspace: raw}\n  P3: []\nactive_displays"
    file = Path(config(tmp_path))
    file.write_text(file.read_text().replace("active_displays", more))
    linear = np.full((1, 1, 3), 0.25, np.float32)
    view = open_view(VideoSettings(ocio=str(file), display="Rec.1886"), 0.0)
    assert view.transfer == 1
    np.testing.assert_allclose(view.encode(linear), linear, atol=1e-6)
    with pytest.raises(SettingsError, match=r"no display 'P3' for sRGB or Rec\.709; it has: sRGB, Rec.1886"):
        open_view(VideoSettings(ocio=str(file), display="P3"), 0.0)
    with pytest.raises(SettingsError, match=r"display = 'sRGB' needs a configuration"):
        open_view(VideoSettings(display="sRGB"), 0.0)


def test_a_configuration_that_lacks_something(tmp_path):
    pytest.importorskip("PyOpenColorIO")
    with pytest.raises(SettingsError, match="no view 'Filmic' of 'sRGB'; it has: Plain, Raw"):
        open_view(VideoSettings(ocio=config(tmp_path), view="Filmic"), 0.0)
    with pytest.raises(SettingsError, match=r"no display for sRGB or Rec\.709; it has: P3 HDR"):
        open_view(VideoSettings(ocio=config(tmp_path, "P3 HDR")), 0.0)
    with pytest.raises(SettingsError, match=r"OpenColorIO can't use|no colour space"):
        open_view(VideoSettings(ocio=config(tmp_path, linear="acescg")), 0.0)


LOOK = """looks:
  - !<Look> {name: Dark, process_space: raw, transform: !<MatrixTransform> {offset: [-0.1, -0.1, -0.1, 0]}}
  - !<Look> {name: Mapped, process_space: raw, transform: !<FileTransform> {src: half.spi1d}}
colorspaces"""
HALF = "Version 1\nFrom 0.0 1.0\nLength 2\nComponents 1\n{\n0.0\n0.5\n}\n"


def test_a_look_comes_before_the_view(tmp_path):
    pytest.importorskip("PyOpenColorIO")
    file = Path(config(tmp_path))
    file.write_text(file.read_text().replace("colorspaces", LOOK))
    (tmp_path / "half.spi1d").write_text(HALF)
    linear = np.full((1, 1, 3), 0.5, np.float32)
    dark = VideoSettings(ocio=str(file), view="Raw", look="Dark")
    np.testing.assert_allclose(open_view(dark, 0.0).encode(linear), linear - 0.1, atol=1e-6)
    assert view_identity(dark) != view_identity(VideoSettings(ocio=str(file), view="Raw"))
    assert files_of_view(dark) == [file]
    mapped = VideoSettings(ocio=str(file), view="Raw", look="Mapped")
    np.testing.assert_allclose(open_view(mapped, 0.0).encode(linear), linear / 2, atol=1e-3)
    assert files_of_view(mapped) == [file, tmp_path / "half.spi1d"]
    with pytest.raises(SettingsError, match="no look 'Punchy'; it has: Dark, Mapped"):
        open_view(VideoSettings(ocio=str(file), look="Punchy"), 0.0)


def test_opencolorio_that_is_not_installed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "PyOpenColorIO", None)
    with pytest.raises(SettingsError, match=r"pip install opencolorio"):
        open_view(VideoSettings(ocio=config(tmp_path)), 0.0)
