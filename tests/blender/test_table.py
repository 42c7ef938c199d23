"""The table of what is carried over is that of the exporter (UPDATE_DOCS=1 writes it)."""

import os
from pathlib import Path

from support.carried_over import markdown

DOCS = Path(__file__).parents[2] / "docs" / "blender.md"
BEGIN, END = "<!-- mapping: written by tests/blender -->\n", "<!-- end of mapping -->"


def test_the_documentation_has_the_exporters_tables():
    before, _, rest = DOCS.read_text().partition(BEGIN)
    written, _, after = rest.partition(END)
    if os.environ.get("UPDATE_DOCS"):
        DOCS.write_text(before + BEGIN + markdown() + END + after)
        return
    assert written == markdown()


def test_the_tables_have_three_columns():
    rows = [line for line in markdown().splitlines() if line]
    assert all(line.count("|") == 4 for line in rows)
