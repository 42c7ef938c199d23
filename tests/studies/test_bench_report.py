"""Pictures and tables of a made-up bench."""

import numpy as np
import pytest

from enfilade.images import write_exr
from enfilade.kernels.tone import srgb_decode
from printed import as_text
from studies.bench import pictures as bench_pictures
from studies.bench.pictures import write_differences
from studies.bench.tables import bench_tables

GREY, DARK = 0.1, 0.05  # of the reference, and of the contestant


@pytest.fixture
def held(tmp_path):
    """What ``bench.json`` holds of one contestant and one frame, and the folder with both images."""
    for place, value in (("references/reference-box", GREY), ("contestants/traced-4", DARK)):
        frames = tmp_path / place / "frames"
        frames.mkdir(parents=True)
        write_exr(frames / "0001.exr", {"RGB": np.full((8, 8, 3), value, np.float32)})
    one = {"name": "traced-4", "family": "traced", "pixel_filter": "box", "scores": {}}
    return {"size": [8, 8], "fps": 24.0, "frames": [1], "contestants": [one], "judges": {}}, tmp_path


@pytest.mark.parametrize(
    ("stops", "times"), [({}, 1.0), ({"exposure_ev": 2.0}, 4.0), ({"exposure_ev": 9.0}, 512.0)]
)
def test_pictures_show_what_the_judges_see(held, monkeypatch, stops, times):
    found, folder = held
    shown = []
    monkeypatch.setattr(bench_pictures, "encode_video", lambda _file, frames, **_: shown.extend(frames))
    write_differences(found | stops, folder)
    np.testing.assert_allclose(shown[0][:, :8], min(DARK * times, 1.0), rtol=1e-3)
    if times > 20.0:  # both are white, which do not differ
        np.testing.assert_allclose(shown[0][:, 8:], srgb_decode(np.float32(0.5)), rtol=1e-3)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ({"kind": "equal"}, "judges 3.50"),
        ({"kind": "at least"}, "judges ≥ 3.50"),
        ({"kind": "at most"}, "judges ≤ 3.50"),
        ({"kind": None}, "judges 3.50, of bounds both ways"),
        ({}, "judges 3.50"),  # an older file
    ],
)
def test_the_mean_over_the_judges_has_its_sign(kind, text):
    ratio = {"times": 3.5, "least": 3.5, "kind": "equal"}
    found = {
        "scene": "room",
        "size": [8, 8],
        "frames": [1],
        "judges": {"aqm": {"title": "AQM", "unit": "JND"}},
        "contestants": [],
        "reference": {"spp": 4, "filters": {}, "floor": {}},
        "verdict": {
            "traced": {},
            "denoised": {"by_judge": {"aqm": ratio}, "geometric_mean": 3.5, "least": 3.5, **kind},
            "paper": {},
        },
    }
    words = " ".join(as_text(bench_tables(found)[1]).split())
    assert words.endswith(f"geometric mean over the {text}")
