"""``enfilade doctor``: check of the installation: requirements, the variant that will run, and remedies."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from enfilade.cli.group import FAILURE, debug_option
from enfilade.cli.options import device_option, json_option

if TYPE_CHECKING:
    from enfilade.device import Choice
    from enfilade.installation import Check


@click.command("doctor", short_help="Check the installation, with remedies for missing parts.")
@device_option
@click.option(
    "--install-blender",
    "is_blender_wanted",
    is_flag=True,
    help="First install Blender, as the module bpy in an environment of its own (374 MB).",
)
@json_option
@debug_option
@click.pass_context
def command(ctx: click.Context, /, *, device: Choice, is_blender_wanted: bool, as_json: bool) -> None:
    """List the installed requirements, the variant that will run, and remedies for missing parts."""
    from enfilade.installation import examine

    if is_blender_wanted:
        from enfilade.scene.blender.install import install

        install(lambda line: click.echo(line, err=True))
    checks = examine(device)
    missing = [check for check in checks if check.is_required and not check.is_ok]
    if as_json:
        report = {"is_ready": not missing, "checks": [check.to_dict() for check in checks]}
        click.echo(json.dumps(report, indent=2))
    else:
        _show(checks)
        names = ", ".join(check.name for check in missing)
        click.echo(f"Missing: {names}." if missing else "Ready to render.")
    if missing:
        ctx.exit(FAILURE)


def _show(checks: list[Check]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("", "what", "found, or how to get it"):
        table.add_column(heading, overflow="fold")
    for check in checks:
        mark = "ok" if check.is_ok else ("MISSING" if check.is_required else "none")
        table.add_row(mark, check.name, Text("; ".join(filter(None, (check.found, check.remedy)))))
    Console().print(table)
