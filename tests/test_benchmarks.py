"""The benchmarks that read a bench: what they ask of it, and what they look at."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from enfilade.images import write_exr


@pytest.fixture
def benchmark(monkeypatch):
    """Import a benchmark by name."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    return importlib.import_module


@pytest.mark.parametrize(
    ("mean", "kind", "is_met"),
    [
        (3.5, "equal", True),
        (3.5, "at least", True),
        (3.5, "at most", False),
        (3.5, None, False),
        (2.5, "at least", False),
    ],
)
def test_a_mean_that_is_bounded_from_above_alone_meets_nothing(benchmark, mean, kind, is_met):
    many = {"times": 40.0, "least": 40.0, "kind": "equal"}
    denoised = {"by_judge": {"aqm": many}, "geometric_mean": mean, "kind": kind, "least": 40.0}
    verdict = {"traced": {"traced-256": {"aqm": many}}, "denoised": denoised, "paper": {}}
    missed = importlib.import_module("studies.bench.__main__").judge("room", {"verdict": verdict})
    assert len(missed) == (0 if is_met else 1)
    assert all("3 times less CPU time than denoised" in text for text in missed)


def test_stability_and_sharpness_look_at_what_the_judges_see(benchmark, tmp_path):
    sharpness, stability = benchmark("sharpness"), benchmark("stability")
    values = np.random.default_rng(0).uniform(0.3, 0.6, (2, 16, 16, 3)).astype(np.float32)
    files = [tmp_path / name / "0001.exr" for name in "ab"]
    for file, value in zip(files, values, strict=True):
        file.parent.mkdir()
        write_exr(file, {"RGB": value})
    assert [sharpness.exposure_of(of) for of in ({}, {"exposure_ev": 2.0})] == [0.0, 2.0]
    # At two stops more all is white: nothing differs, and there is no detail.
    seen, white = (stability.broad_errors(files[:1] * 2, files[1:] * 2, 8, ev) for ev in (0.0, 2.0))
    assert seen[0] > 0.0
    assert white[0] == 0.0
    assert white[2] == seen[2]  # of the radiance
    assert np.abs(sharpness.spectra(files[0].parent, 1, 0.0)[0]).max() > 0.1
    assert np.abs(sharpness.spectra(files[0].parent, 1, 2.0)[0]).max() < 1e-4
