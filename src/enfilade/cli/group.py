"""The ``enfilade`` command: its sub-commands, loaded when used, and the messages and exit codes of errors."""

from __future__ import annotations

import importlib
import keyword
import shlex
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import click

from enfilade import __version__
from enfilade.errors import EnfiladeError, InputError

COMMANDS = ("render", "import", "work", "farm", "encode", "plan", "compare", "report", "doctor")
FAILURE = 1
WRONG_INPUT = 2
INTERRUPTED = 130
TERMINATED = 143

_ARGUMENTS = "enfilade.arguments"
_DEBUG = "enfilade.debug"
_RESUMABLE = "enfilade.resumable"


class Failure(click.ClickException):
    """A failure as the user sees it: one message, no traceback."""

    exit_code = FAILURE


class WrongInput(click.ClickException):
    """Wrong input as the user sees it: one message, no traceback."""

    exit_code = WRONG_INPUT


class EnfiladeGroup(click.Group):
    """A group that loads a command's module when it is used and turns errors into exit codes.

    Parameters
    ----------
    modules
        The module of each command, by its name; it has the command as ``command``.
    attributes
        Of a click group.
    """

    def __init__(self, *, modules: Mapping[str, str] | None = None, **attributes: Any) -> None:
        super().__init__(**attributes)
        self._modules = modules or {name: f"enfilade.cli.{_module(name)}" for name in COMMANDS}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of use."""
        del ctx
        return list(self._modules)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Load the module of one command."""
        del ctx
        if cmd_name not in self._modules:
            return None
        command: click.Command = importlib.import_module(self._modules[cmd_name]).command
        return command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the arguments as typed: the same line continues the job."""
        ctx.meta[_ARGUMENTS] = tuple(args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; an expected error becomes one message and an exit code."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            click.echo(_interruption(ctx), err=True)
            ctx.exit(INTERRUPTED)
        except BrokenPipeError:
            raise
        except (EnfiladeError, OSError, MemoryError) as error:
            if ctx.meta.get(_DEBUG):
                raise
            kind = WrongInput if isinstance(error, InputError) else Failure
            raise kind(_message(error)) from error


def _module(name: str) -> str:
    return f"{name}_" if keyword.iskeyword(name) else name


def mark_resumable(ctx: click.Context) -> None:
    """Mark the running command as resumable: typed again, it continues where it stopped."""
    ctx.meta[_RESUMABLE] = True


@contextmanager
def ending_on_sigterm() -> Iterator[None]:
    """End the command by SystemExit on SIGTERM, so that temporary files are removed, as on ^C."""

    def end(number: int, _frame: object) -> None:
        signal.signal(number, signal.SIG_IGN)  # a second one, as `timeout` sends, would end the clean-up
        raise SystemExit(TERMINATED)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _message(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    if isinstance(error, MemoryError):
        return "out of memory; a smaller --size, or --set limits.paths_in_flight, needs less"
    return str(error)


def _interruption(ctx: click.Context) -> str:
    if not ctx.meta.get(_RESUMABLE):
        return "\nInterrupted."
    line = f"{ctx.find_root().info_name} {shlex.join(ctx.meta[_ARGUMENTS])}"
    return f"\nInterrupted. What is finished stays in the run folder; to continue:\n  {line}"


def _set_debug(ctx: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if value:
        ctx.meta[_DEBUG] = True


debug_option = click.option(
    "--debug",
    is_flag=True,
    expose_value=False,
    callback=_set_debug,
    help="Show the traceback of an error.",
)


@click.group(
    cls=EnfiladeGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="`enfilade COMMAND --help` lists the options of a command.",
)
@click.version_option(__version__, prog_name="enfilade", help="Show the version and exit.")
@debug_option
def main() -> None:
    """Render camera walkthroughs of static scenes; light is reused from frame to frame."""
