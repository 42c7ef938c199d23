"""Fidelity of the corpus of files from Blender: ``python -m studies blender``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from enfilade.device import activate
from studies.blender.measures import Fidelity, compare, displayed

if TYPE_CHECKING:
    from enfilade.runs.fidelity import CheckedFrame

ROOT = Path(__file__).resolve().parents[2]
CORPUS = ROOT / "tests" / "blender" / "corpus"


@click.command("blender", short_help="Scenes from Blender, against Cycles.")
@click.option("--blender", default=str(ROOT / ".venv-blender" / "bin" / "python"), help="A Python with bpy.")
@click.option("--only", multiple=True, help="Name of a file; all by default.")
@click.option("--spp", default=256, help="Paths a pixel of each renderer, in two halves.")
@click.option("--source", type=click.Path(path_type=Path, exists=True), help="A .blend file of your own.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/blender"))
def command(blender: str, only: tuple[str, ...], spp: int, source: Path | None, out: Path) -> None:
    """Render each file by Cycles and, imported, by Mitsuba; print differences, and write both pictures."""
    activate("cpu")
    if source:
        files = [source]
    else:
        names = [*only] or _corpus(blender, "--list").split()
        _corpus(blender, str(out / "files"), *names)
        files = [out / "files" / f"{name}.blend" for name in names]
    click.echo(f"{'file':20} {'mean %':>7} {'1-SSIM':>7}  notes")
    for file in files:
        fidelity, notes = measure(file, blender, spp, out)
        click.echo(f"{file.stem:20} {fidelity.mean_percent:7.2f} {fidelity.structure:7.3f}  {notes}")


def measure(file: Path, blender: str, spp: int, out: Path) -> tuple[Fidelity, str]:
    """Fidelity of the first frame of a file, and the kinds of its notes."""
    from enfilade.camera import load_path
    from enfilade.monitor import Silence
    from enfilade.runs.fidelity import check_import
    from enfilade.scene.blender.find import find_blender
    from enfilade.scene.blender.importer import import_file
    from enfilade.scene.blender.source import Choices
    from enfilade.settings import LimitSettings

    limits, choices, monitor = LimitSettings(), Choices(), Silence()
    imported = import_file(file, out / file.stem, choices, limits, monitor, program=blender)
    first = load_path(imported.checked_path()).numbers[0]
    program = find_blender(blender)
    made = check_import(imported, file, program, choices, limits, monitor, numbers=(first,), spp=spp)
    (frame,) = made.frames
    _write_pictures(out / f"{file.stem}.png", frame)
    kinds = [note.kind for note in imported.notes]
    notes = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    return compare(frame.cycles, frame.imported), notes


def _corpus(blender: str, *arguments: str) -> str:
    """Run the scripts that make the corpus; returns what they print."""
    done = subprocess.run([blender, str(CORPUS), *arguments], capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        sys.exit(f"{CORPUS}: {done.stderr[-2000:]}")
    return done.stdout


def _write_pictures(file: Path, frame: CheckedFrame) -> None:
    """Cycles, ours, and the displayed difference, times four about mid grey."""
    from PIL import Image

    a, b = (displayed(0.5 * (one + other)) for one, other in (frame.cycles, frame.imported))
    row = np.concatenate([a, b, np.clip(0.5 + 4.0 * (b - a), 0.0, 1.0)], axis=1)
    picture = Image.fromarray(np.rint(row * 255.0).astype(np.uint8))
    picture.resize((row.shape[1] * 3, row.shape[0] * 3), Image.Resampling.NEAREST).save(file)
