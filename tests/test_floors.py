"""Imports only go down the floors: import-linter's contracts hold."""

from pathlib import Path

from importlinter.api import read_configuration
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def test_the_contracts_hold():
    assert lint_imports(config_filename=str(PROJECT), no_cache=True) == EXIT_STATUS_SUCCESS


def test_every_module_has_a_floor():
    layers = read_configuration(str(PROJECT))["contracts_options"][0]
    assert layers["type"] == "layers"
    assert layers["exhaustive"]
