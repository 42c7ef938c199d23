"""Textured emitters of which Mitsuba samples a part only."""

import mitsuba as mi
import numpy as np
import pytest

from enfilade.device import active
from support.mitsuba_scene import opened, write_square


def notes_of(folder, low, high):
    """Notes on a square that shines like a picture, with texture coordinates in a range."""
    mi.set_variant(active().variant)
    uv = [f"{low} {low}", f"{high} {low}", f"{high} {high}", f"{low} {high}"]
    write_square(folder / "square.ply", ("u", "v"), uv)
    picture = np.float32(np.random.default_rng(0).uniform(0.5, 1.0, (16, 16, 3)))
    mi.Bitmap(picture).write(str(folder / "picture.exr"))
    radiance = '<string name="filename" value="picture.exr"/><boolean name="raw" value="true"/>'
    light = f'<emitter type="area"><texture type="bitmap" name="radiance">{radiance}</texture></emitter>'
    shape = f'<shape type="ply" id="screen"><string name="filename" value="square.ply"/>{light}</shape>'
    (folder / "scene.xml").write_text(f'<scene version="3.0.0">{shape}</scene>')
    return opened(folder / "scene.xml").describe().notes


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (0.2, 0.7)])
def test_emitters_within_their_texture_are_sampled_whole(tmp_path, low, high):
    assert notes_of(tmp_path, low, high) == ()


@pytest.mark.parametrize(("low", "high", "share"), [(0.0, 2.0, 0.25), (0.5, 1.5, 0.25)])
def test_emitters_beyond_their_texture_are_named_with_the_light_that_is_sampled(tmp_path, low, high, share):
    (note,) = notes_of(tmp_path, low, high)
    assert note.startswith("Mitsuba samples ")
    assert int(note.split()[2].rstrip("%")) == pytest.approx(100 * share, abs=2)
    assert "emitter screen" in note
