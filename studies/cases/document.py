"""The document of the case studies: tables and figures put into blocks of a text that is written by hand.

A block stands between ``<!-- NAME -->`` and ``<!-- /NAME -->``; what is between is replaced, the rest stays.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from enfilade.errors import InputError
from enfilade.files import whole_file
from studies.cases.blocks import BLOCKS, FIGURES
from studies.cases.case import Measured
from studies.cases.terms import Terms

__all__ = ["check_blocks", "replaced", "write_document"]

Results = Mapping[str, Mapping[str, Measured]]  # by scene and item


def write_document(found: Results, terms: Terms, folder: Path, template: Path, target: Path) -> list[Path]:
    """Draw the figures and fill the blocks of which there are results.

    Parameters
    ----------
    found
        By scene and item, as ``runner.measure`` returns it.
    terms
        On which they were measured; said in each block.
    folder
        Of the results, with the images of the examples.
    template
        The document whose text is taken.
    target
        The document that is written; the figures come to lie beside it. May be the template.

    Returns
    -------
    list of Path
        The document and the figures.

    Raises
    ------
    InputError
        The template lacks a block.
    """
    text = template.read_text(encoding="utf-8")
    place = target.parent / FIGURES
    files: list[Path] = []
    for name, write in BLOCKS.items():
        measured = {scene: items[name] for scene, items in found.items() if name in items}
        if measured:
            results = {scene: one.result for scene, one in measured.items()}
            body, drawn = write(results, terms, folder, place)
            files += drawn
            text = replaced(text, name, f"{body}\n\n{_when(measured)}")
    with whole_file(target) as beside:
        beside.write_text(text, encoding="utf-8")
    return [target, *files]


def check_blocks(template: Path) -> None:
    """See that a document has all blocks, before hours are spent on what goes into them.

    Raises
    ------
    InputError
        The template lacks a block.
    """
    text = template.read_text(encoding="utf-8")
    for name in BLOCKS:
        replaced(text, name, "")


def _when(measured: Mapping[str, Measured]) -> str:
    said = (
        f"{scene.upper()} {one.date}{'' if one.is_current else ', by older code'}"
        for scene, one in measured.items()
    )
    return f"*Measured: {'; '.join(said)}.*"


def replaced(text: str, name: str, body: str) -> str:
    """The text with another body in one of its blocks.

    Raises
    ------
    InputError
        It has no such block.
    """
    block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
    if not block.search(text):
        raise InputError(f"the document has no block <!-- {name} --> ... <!-- /{name} -->; restore it")
    return block.sub(lambda match: f"{match[1]}\n{body.strip()}\n\n{match[2]}", text)
