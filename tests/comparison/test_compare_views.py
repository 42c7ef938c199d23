"""Frames of a run are compared as its video shows them, with the view of its configuration."""

import json

import numpy as np
import pytest
from PIL import Image

from enfilade.kernels.tone import srgb_encode
from support.sequences import Notes, compared, textured, write_run
from support.views import WHITE, write_config

pytest.importorskip("PyOpenColorIO")


@pytest.fixture
def run(tmp_path):
    """Writes the folder of a run with the view, or with that of a file."""

    def written(name, images, ocio=None):
        folder = write_run(tmp_path / name, images, range(1, len(images) + 1))
        video = {"codec": "h264", "ocio": write_config(tmp_path) if ocio is None else ocio, "view": "Soft"}
        table = {
            "viewing": {"exposure_ev": 1.0},
            "video": video if video["ocio"] else {"ocio": "", "view": ""},
        }
        (folder / "job.json").write_text(json.dumps({"settings": table}))
        return folder

    return written


def test_highlights_that_the_view_shows_are_compared(run):
    """Exposed values of 2 and 4 are both clipped by the sRGB curve."""
    dim, bright = np.ones_like(textured()), 2.0 * np.ones_like(textured())
    found = compared(run("t", [dim]), run("r", [bright]), notes := Notes())
    assert found.score > 1.0
    (said,) = [text for text in notes.said if text.startswith("view: ")]
    assert "the test and the reference: the view Soft of " in said


def test_a_run_looks_like_its_video_and_frames_beside_it_like_the_run(run, sequence, tmp_path):
    images = [textured(level=2.0)]
    soft = run("soft", images)
    shown = srgb_encode(2.0 * images[0] / np.float32(WHITE))
    Image.fromarray(np.round(255.0 * shown).astype(np.uint8)).save(tmp_path / "shown.png")
    assert compared(tmp_path / "shown.png", soft).psnr_db > 50.0
    plain = sequence("plain", images)
    assert compared(soft, plain).is_identical
    assert compared(plain, soft).is_identical


def test_two_runs_have_each_its_own_view(run):
    images = [textured(level=0.2)]
    found = compared(run("soft", images), run("srgb", images, ocio=""), notes := Notes())
    assert not found.is_identical
    assert found.score > 1.0
    assert any(text.startswith("view: the test: the view Soft") for text in notes.said)


def test_references_are_averaged_before_the_view(run, sequence):
    random = np.random.default_rng(1)
    scales = (random.uniform(0.8, 1.2, textured().shape).astype(np.float32) for _ in range(3))
    images = [textured(level=1.5) * scale for scale in scales]
    runs = [run(f"run{i}", [image]) for i, image in enumerate(images)]
    shown = [sequence(f"shown{i}", [image * np.float32(2.0 / WHITE)]) for i, image in enumerate(images)]
    seen, wanted = (compared(of[0], of[1], second_reference=of[2]) for of in (runs, shown))
    # Encoded and decoded again in float32, and by the tables of OpenColorIO
    assert seen.score == pytest.approx(wanted.score, rel=1e-3)
    assert seen.noise_floor.score == pytest.approx(wanted.noise_floor.score, rel=1e-3)


def test_a_configuration_that_is_gone_is_told(run, tmp_path):
    images = [textured()]
    gone = run("gone", images, ocio=str(tmp_path / "gone.ocio"))
    for other in (run("srgb", images, ocio=""), run("soft", images)):
        found = compared(gone, other, notes := Notes())
        assert found.is_identical
        (said,) = [text for text in notes.said if text.startswith("view: ")]
        assert "all sides: the sRGB curve, clipped at white, since the view Soft of " in said
        assert "gone.ocio" in said
