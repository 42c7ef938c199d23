"""The document of the case studies: tables and figures, put into blocks of a text that is written by hand.

A block stands between ``<!-- NAME -->`` and ``<!-- /NAME -->``. Its content is replaced, everything else
stays.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from enfilade.errors import InputError
from enfilade.files import whole_file
from studies.cases.blocks import BLOCKS, FIGURES
from studies.cases.case import Result
from studies.cases.runner import Results
from studies.cases.terms import Terms


def write_document(results: Results, terms: Terms, folder: Path, template: Path, target: Path) -> list[Path]:
    """Draw the figures and fill the blocks of which there are results.

    Parameters
    ----------
    results
    terms
        Stated in each block.
    folder
        Of the results, with the images of the examples.
    template
        The document whose text is taken.
    target
        The document that is written, with the figures beside it. May be the template.

    Returns
    -------
    list of Path
        The document and the figures.
    """
    text = template.read_text(encoding="utf-8")
    files: list[Path] = []
    for name, write in BLOCKS.items():
        if by_scene := results.get(name):
            values = {scene: result.value for scene, result in by_scene.items()}
            body, drawn = write(values, terms, folder, target.parent / FIGURES)
            files += drawn
            text = replaced(text, name, f"{body}\n\n{_origins(by_scene)}")
    with whole_file(target) as beside:
        beside.write_text(text, encoding="utf-8")
    return [target, *files]


def check_blocks(template: Path) -> None:
    """Check that a document has all blocks, before hours are spent on their content.

    Raises
    ------
    InputError
        The template lacks a block.
    """
    text = template.read_text(encoding="utf-8")
    for name in BLOCKS:
        replaced(text, name, "")


def _origins(by_scene: Mapping[str, Result]) -> str:
    origins = []
    for scene, result in by_scene.items():
        version = f"enfilade {result.made['enfilade']}"
        commit = f", {result.made['commit']}" if result.made["commit"] else ""
        origins.append(f"{scene.upper()} {result.made['date']} ({version}{commit})")
    return f"*Measured: {'; '.join(origins)}.*"


def replaced(text: str, name: str, body: str) -> str:
    """The text with another body in one of its blocks."""
    block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
    if not block.search(text):
        raise InputError(f"the document has no block <!-- {name} --> ... <!-- /{name} -->; restore it")
    return block.sub(lambda match: f"{match[1]}\n{body.strip()}\n\n{match[2]}", text)
