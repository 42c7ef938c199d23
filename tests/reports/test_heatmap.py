"""Heat maps: grey where no difference is seen, distinct without hue."""

import numpy as np
import pytest
from PIL import Image

from enfilade.errors import RunFolderError, SettingsError
from enfilade.reports import heatmap
from enfilade.reports.heatmap import HeatmapPainter, overlay
from enfilade.reports.scales import VISIBLE

LUMA = np.float32([0.2126, 0.7152, 0.0722])


def test_where_nothing_is_seen_the_image_is_grey():
    grey = np.linspace(0.0, 1.0, 40, dtype=np.float32).reshape(4, 10)
    for jnd in (0.0, 0.9 * heatmap.FAINT_JND):
        painted = overlay(np.full_like(grey, jnd), grey)
        assert np.ptp(painted, axis=2).max() < 1e-6
        assert (np.diff(painted[..., 0].ravel()) > 0).all()


def test_colors_grow_lighter_with_the_difference():
    # for grey prints and readers with colour vision deficiencies
    jnd = np.array([[j for j in VISIBLE.colors if j >= 0.5]], np.float32)
    luminance = overlay(jnd, np.full_like(jnd, 0.5)) @ LUMA
    assert (np.diff(luminance[0, 1:]) > 0.04).all()
    # without red-green vision: blue against yellow rises steadily from 1 JND on
    yellow = overlay(jnd, np.full_like(jnd, 0.5))[0, 1:] @ np.float32([0.5, 0.5, -1.0])
    assert (np.diff(yellow[:-1]) > 0.08).all()


def test_a_defect_is_colored_and_nothing_else():
    jnd = np.zeros((30, 600), np.float32)
    jnd[10:20, 100:140] = 3.0
    painter = HeatmapPainter(600, 30)
    picture = painter.paint(jnd, np.full_like(jnd, 0.5), "frame 0")
    is_colored = np.ptp(picture[:30].astype(int), axis=2) > 30
    np.testing.assert_array_equal(is_colored, jnd > 0)


@pytest.mark.parametrize("size", [(1, 1), (60, 40), (101, 75), (481, 33), (1920, 1080)])
def test_pictures_are_even_and_have_their_legend(size):
    width, height = size
    painter = HeatmapPainter(width, height)
    assert (painter.width % 2, painter.height % 2) == (0, 0)
    assert painter.width >= 480
    maps = np.zeros((height, width), np.float32)
    plain, other = (painter.paint(maps, maps, caption) for caption in ("frame 7", "frame 8"))
    assert plain.shape == (painter.height, painter.width, 3)
    scale = painter.width // width
    below = plain[height * scale :]
    assert below.max() > 200  # text
    assert np.ptp(below.astype(int), axis=2).max() > 100  # colours of the legend
    assert (plain != other).any()


def test_a_video_by_its_suffix(tmp_path):
    painter = HeatmapPainter(64, 48)
    maps = np.ones((48, 64), np.float32)
    pictures = [painter.paint(maps, maps, "a")] * 3
    size = painter.width, painter.height
    with pytest.raises(SettingsError, match=r"a\.gif: a heat map is written as \.mp4, \.mkv, \.mov"):
        heatmap.write_heatmap_video(tmp_path / "a.gif", pictures, size=size, fps=30.0)
    heatmap.write_heatmap_video(tmp_path / "a.mp4", pictures, size=size, fps=30.0)
    assert (tmp_path / "a.mp4").stat().st_size > 1000


def test_images(tmp_path):
    picture = np.zeros((20, 20, 3), np.uint8)
    heatmap.write_heatmap_images(tmp_path / "maps", [("0", picture), ("1", picture)])
    assert sorted(file.name for file in (tmp_path / "maps").iterdir()) == ["0.png", "1.png"]
    with Image.open(tmp_path / "maps" / "0.png") as written:
        assert written.size == (20, 20)
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="can't write"):
        heatmap.write_heatmap_images(tmp_path / "file" / "maps", [("0", picture)])
