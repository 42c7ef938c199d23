"""The document of the case studies: tables and figures in blocks of a handwritten text.

A block stands between ``<!-- NAME -->`` and ``<!-- /NAME -->``. Only its content is
replaced.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from enfilade.errors import InputError
from enfilade.files import whole_file
from studies.cases.blocks import BLOCKS, FIGURES
from studies.cases.case import Result
from studies.cases.extent import Extent
from studies.cases.runner import Results


def write_document(
    results: Results, extent: Extent, folder: Path, template: Path, target: Path
) -> list[Path]:
    """Draw the figures and fill the blocks that have results.

    Parameters
    ----------
    results
    extent
        Extent of the results, stated in each block.
    folder
        Folder of the results, with the images of the examples.
    template
        The document that provides the text.
    target
        The document to write, with the figures beside it. May be the template.

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
            body, drawn = write(values, extent, folder, target.parent / FIGURES)
            files += drawn
            text = replaced(text, name, f"{body}\n\n{_origins(by_scene)}")
    with whole_file(target) as beside:
        beside.write_text(text, encoding="utf-8")
    return [target, *files]


def check_blocks(template: Path) -> None:
    """Check that a document has all blocks, before they are measured.

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
        version = f"enfilade {result.origin['enfilade']}"
        commit = f", {result.origin['commit']}" if result.origin["commit"] else ""
        origins.append(f"{scene.upper()} {result.origin['date']} ({version}{commit})")
    return f"*Measured: {'; '.join(origins)}.*"


def replaced(text: str, name: str, body: str) -> str:
    """The text with a new body in one of its blocks."""
    block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
    if not block.search(text):
        raise InputError(f"the document has no block <!-- {name} --> ... <!-- /{name} -->; restore it")
    return block.sub(lambda match: f"{match[1]}\n{body.strip()}\n\n{match[2]}", text)
