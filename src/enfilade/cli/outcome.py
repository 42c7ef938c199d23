"""What a command leaves when it has finished: plots, and where everything is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from enfilade.errors import SettingsError

LEDGER = "ledger.jsonl"


def check_png(flag: str, file: Path | None) -> None:
    """Refuse a picture under a name that another format has, before any work.

    Raises
    ------
    SettingsError
    """
    if file is not None and file.suffix.lower() != ".png":
        raise SettingsError(f"{flag} {file}: it is written as .png")


def ledger_bytes(folder: Path) -> int:
    """How long the ledger of a run folder is; -1 where there is none. It grows by all that is done."""
    file = folder / LEDGER
    return file.stat().st_size if file.exists() else -1


def draw_plots(folder: Path, *, is_new: bool) -> list[Path]:
    """Draw what the run did, anew or where it is not drawn yet."""
    there = sorted((folder / "plots").glob("*.png"))
    if there and not is_new:
        return there
    from enfilade.reports.plots import plot_run

    return plot_run(folder)


def name_files(folder: Path, summary: dict[str, Any], plots: list[Path]) -> None:
    """Print where video, plots and run are."""
    for name, file in (
        ("video", folder / summary["video"]),
        *(("plot", plot) for plot in plots),
        ("run", folder),
    ):
        click.echo(f"{name:7} {file}")
