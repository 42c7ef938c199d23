"""The validation command: figures, targets, exit status, plots; one slow run with real measurements."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import spearmanr

from enfilade.monitor import Silence
from studies.__main__ import main
from studies.observers import flicker, foley, modelfest, moving_texture, sensitivity
from studies.observers import validate as validation
from studies.observers.figures import FITTED, TARGETS, Figure, ModeResults, Target
from studies.observers.fits import Fit
from studies.observers.flicker import Pair
from studies.observers.foley import ANGLES_DEG, Masking
from studies.observers.gratings import STIMULI
from studies.observers.mode import MODERN
from studies.observers.modelfest import Thresholds
from studies.observers.moving_texture import Losses, conditions
from studies.observers.sensitivity import Sensitivities
from studies.observers.tables import read_columns, read_textures
from studies.observers.threshold import rms_db
from studies.observers.validate import Validation


def synthetic(mode, *, error_db=0.5, flicker_jnd=2.0, has_targets=True):
    """A mode with errors of this size and alternating sign."""
    error = error_db * np.array([1.0, -1.0] * 5)
    observers = np.linspace(20.0, 40.0, 10)
    rates = np.array([1.0] * 5 + [16.0] * 5)
    cpd = np.array([0.5, 1.0, 2.0, 4.0, 8.0] * 2)
    area = np.array([0.5, 4.0] * 5)
    csf = Sensitivities(cpd, rates, area, observers, observers * 10.0 ** (error / 20.0))
    masking = Masking(-observers, -observers, error - observers, 3.0)
    loss = np.arange(72.0)
    return ModeResults(
        mode=mode,
        has_targets=has_targets,
        thresholds=Thresholds(np.arange(10), observers, observers + error, np.ones(10)),
        masking=dict.fromkeys(ANGLES_DEG, masking),
        sensitivities=dict.fromkeys(STIMULI, csf),
        losses=Losses(conditions(), loss, np.ones(72), np.ones(72), loss + 1.0),
        flicker={"sparks": Pair(flicker_jnd, 1.0)},
    )


def run(monkeypatch, *arguments, **measured):
    modes = (synthetic("paper", error_db=9.0, has_targets=False), synthetic("modern", **measured))
    found = Validation(modes, (Fit("constant", "data", (0.5,), 1.25, 1.375, (0.25,), (0.5,)),))
    monkeypatch.setattr(validation, "validate", lambda _: found)
    return CliRunner().invoke(main, ["validate", "--quiet", *arguments])


def test_bounds_are_strict():
    assert Target(2.0).is_met(2.0)
    assert not Target(2.0).is_met(2.004)
    assert Target(0.9, is_least=True).is_met(0.9)
    assert not Target(0.9, is_least=True).is_met(0.897)
    assert not Target(2.0).is_met(float("nan"))


def test_a_recorded_miss_is_a_miss_but_no_failure_until_it_grows():
    target = Target(3.0, recorded=9.0)
    near, recorded, worse = (Figure("Robson 1966", "dB RMS", value, target) for value in (2.9, 9.0, 9.1))
    assert [figure.is_met for figure in (near, recorded, worse)] == [True, False, False]
    assert [figure.is_failed for figure in (near, recorded, worse)] == [False, False, True]
    assert [figure.status for figure in (near, recorded, worse)] == ["ok", "missed, as recorded", "FAILED"]
    assert Target(0.9, is_least=True, recorded=0.8).is_failed(0.79)
    assert not Target(0.9, is_least=True, recorded=0.8).is_failed(0.8)
    assert target.is_failed(float("nan"))


def test_recorded_misses_miss_their_targets():
    recorded = {name: target for name, target in TARGETS.items() if target.recorded is not None}
    assert recorded
    assert not any(target.is_met(target.recorded) for target in recorded.values())


def test_a_figure_without_a_target_is_met():
    figure = Figure("gain", "dB", 99.0)
    assert figure.is_met
    assert not figure.is_failed
    assert figure.status == ""


def test_fitted_constants_are_named_for_every_experiment():
    names = {figure.name for figure in synthetic("modern").figures()}
    assert set(FITTED) == {name for name in names if not name.startswith("  ")}


def test_every_target_has_its_figure():
    names = [figure.name for figure in synthetic("modern").figures() if figure.target is not None]
    assert sorted(names) == sorted(TARGETS)


def test_the_papers_mode_has_no_targets():
    assert not Validation((synthetic("paper", error_db=9.0, has_targets=False),), ()).missed


def test_all_met_exits_with_0(monkeypatch):
    found = run(monkeypatch)
    assert found.exit_code == 0, found.output
    assert "missed" not in found.output
    assert "ModelFest Gabors" in found.output
    assert "castleCSF" in found.output
    assert "0.25 to 0.5" in found.output
    assert "1.375" in found.output


def test_a_missed_figure_is_named_and_exits_with_1(monkeypatch):
    found = run(monkeypatch, error_db=2.5)
    assert found.exit_code == 1
    assert "Targets missed: ModelFest, Foley masking." in found.output


def test_a_recorded_miss_is_named_and_exits_with_0(monkeypatch):
    monkeypatch.setitem(TARGETS, "ModelFest", Target(2.0, recorded=2.6))
    monkeypatch.setitem(TARGETS, "Foley masking", Target(2.0, recorded=2.6))
    found = run(monkeypatch, error_db=2.5)
    assert found.exit_code == 0, found.output
    assert "Targets missed, as recorded: ModelFest, Foley masking." in found.output


def test_flicker_must_be_scored_worse_than_blur(monkeypatch):
    found = run(monkeypatch, flicker_jnd=1.0)
    assert found.exit_code == 1
    assert "Targets missed: flicker against blur." in found.output


def test_json_has_figures_and_points(monkeypatch):
    found = json.loads(run(monkeypatch, "--json").stdout)
    assert found["missed"] == found["failed"] == []
    paper, modern = found["modes"]
    assert paper["mode"] == "paper"
    figures = {figure["name"]: figure for figure in modern["figures"]}
    assert figures["ModelFest"]["value"] == pytest.approx(0.5)
    assert figures["ModelFest"]["target"] == {"bound": 2.0, "is_least": False, "recorded": None}
    assert figures["ModelFest"]["status"] == "ok"
    assert "aperture" in figures["ModelFest"]["fitted"]
    assert list(modern["masking"]) == ["0", "45", "90"]
    assert len(modern["sensitivity"]["rovamo1993"]["observers"]) == 10
    assert len(modern["moving_texture"]["conditions"]) == 72


def test_plots_of_each_data_set(monkeypatch, tmp_path):
    found = run(monkeypatch, "--plots", str(tmp_path))
    assert found.exit_code == 0, found.output
    names = {file.name for file in tmp_path.iterdir()}
    assert names == {"modelfest.png", "masking.png", "sensitivity.png", "moving_texture.png"}


@pytest.mark.slow
def test_the_modern_mode_keeps_its_bounds():
    # Moving textures on one display and without the dark one; `make validate-metric` measures all.
    thresholds, laird = modelfest.measure(MODERN, Silence()), sensitivity.gratings("laird2006")
    measured = {
        "ModelFest": thresholds.rms_db,
        "ModelFest Gabors": thresholds.gabors_rms_db,
        "Foley masking": foley.measure(MODERN, Silence()).rms_db,
        "Laird 2006": rms_db(sensitivity.measure("laird2006", laird, MODERN, Silence()).error_db),
        "flicker against blur": min(pair.ratio for pair in flicker.measure(MODERN, Silence()).values()),
    }
    assert all(TARGETS[name].is_met(value) for name, value in measured.items()), measured
    listed, textures = conditions(), read_textures()
    chosen = [i for i, c in enumerate(listed) if c.display == "pc" and c.texture != "grass"]
    scores = [moving_texture.score(listed[i], textures[listed[i].texture], MODERN) for i in chosen]
    _, observers = read_columns("moving_texture.csv", "jnd")
    assert spearmanr(-observers["jnd"][chosen], scores).statistic > 0.94
