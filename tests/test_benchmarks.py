"""Benchmarks that read a bench."""

import importlib
from pathlib import Path

import numpy as np

from enfilade.images import write_exr


def test_stability_and_sharpness_measure_frames_as_displayed(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    sharpness, stability = map(importlib.import_module, ("sharpness", "stability"))
    values = np.random.default_rng(0).uniform(0.3, 0.6, (2, 16, 16, 3)).astype(np.float32)
    files = [tmp_path / name / "frames" / "0001.exr" for name in "ab"]
    for file, value in zip(files, values, strict=True):
        file.parent.mkdir(parents=True)
        write_exr(file, {"RGB": value})
    # At two stops more all is white: nothing differs, and there is no detail.
    seen, white = (stability.broad_errors(files[:1] * 2, files[1:] * 2, 8, ev) for ev in (0.0, 2.0))
    assert seen[0] > white[0] == 0.0
    assert white[2] == seen[2]  # of the radiance
    assert np.abs(sharpness.spectra(tmp_path / "a", 1, 0.0)[0]).max() > 0.1
    assert np.abs(sharpness.spectra(tmp_path / "a", 1, 2.0)[0]).max() < 1e-4
