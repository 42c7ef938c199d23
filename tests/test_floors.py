"""Imports only go down the floors: import-linter's contracts hold."""

import ast
from pathlib import Path

import pytest
from importlinter.api import read_configuration
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def test_the_contracts_hold():
    assert lint_imports(config_filename=str(PROJECT), no_cache=True) == EXIT_STATUS_SUCCESS


def test_every_module_has_a_floor():
    layers = read_configuration(str(PROJECT))["contracts_options"][0]
    assert layers["type"] == "layers"
    assert layers["exhaustive"]


@pytest.mark.parametrize("folder", ["src/enfilade_blender", "blender_addon"])
def test_programs_inside_blender_import_nothing_of_ours(folder):
    """They are under the GPL, and exchange files with enfilade."""
    files = sorted((PROJECT.parent / folder).rglob("*.py"))
    assert len(files) > 1
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    named = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    named |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom) and not node.level}
    assert {name.partition(".")[0] for name in named}.isdisjoint({"enfilade", "mitsuba", "drjit"})
    assert all("SPDX-License-Identifier: GPL-3.0-or-later" in file.read_text()[:100] for file in files)
