"""Every option has help, and help loads nothing heavy."""

import subprocess
import sys

import click
import pytest

import enfilade
from enfilade.cli import main
from enfilade.cli.group import COMMANDS

HEAVY = (
    "mitsuba", "drjit", "matplotlib", "av", "OpenEXR", "numpy", "scipy", "PIL", "rich", "jinja2", "ray",
)  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_has_a_sentence_of_help(name):
    command = main.get_command(click.Context(main), name)
    options = [p for p in command.params if isinstance(p, click.Option)]
    assert options
    for option in options:
        assert option.help, option.name
        assert option.help.split("  [")[0].rstrip().endswith("."), option.name
    assert command.help.rstrip().endswith(".")


@pytest.mark.parametrize("arguments", [(), *((name,) for name in COMMANDS)])
def test_help_answers(run, arguments):
    result = run(*arguments, "--help")
    assert result.exit_code == 0
    assert result.output.startswith("Usage: enfilade")


def test_render_has_at_most_30_flags():
    options = [
        p for p in main.get_command(click.Context(main), "render").params if isinstance(p, click.Option)
    ]
    assert len(options) <= 30


def test_version(run):
    assert run("--version").output == f"enfilade, version {enfilade.__version__}\n"


@pytest.mark.parametrize("arguments", ["[]", '["--help"]', '["render", "--help"]'])
def test_help_loads_nothing_heavy(arguments):
    # Modules are counted rather than seconds: a busy machine must not fail the test.
    code = f"""
import sys
from enfilade.cli import main
try:
    main({arguments} or ["--version"])
except SystemExit:
    pass
heavy = [name for name in {HEAVY!r} if name in sys.modules]
sys.exit(f"loaded: {{heavy}}" if heavy else 0)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr


def test_the_package_itself_loads_nothing():
    code = f"import enfilade, sys; sys.exit(bool([n for n in {(*HEAVY, 'click')!r} if n in sys.modules]))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0  # noqa: S603
