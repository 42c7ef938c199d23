"""Documents name files and settings that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.name)
def test_files_that_a_document_names_exist(document: Path) -> None:
    named = re.findall(r"`((?:tests|docs|benchmarks|setup)/[\w/.-]*)`", document.read_text())
    missing = [name for name in named if not (ROOT / name).exists()]
    assert not missing


def test_the_map_of_the_paper_names_modules_that_exist() -> None:
    rows = [line for line in (ROOT / "docs/paper.md").read_text().splitlines() if line.startswith("|")]
    named = {name for row in rows for name in re.findall(r"`([\w/]+(?:\.py|/))`", row)}
    assert len(named) > 30
    missing = [n for n in named if not any((root / n).exists() for root in (ROOT, ROOT / "src/enfilade"))]
    assert not missing


def test_links_between_documents_lead_somewhere() -> None:
    for document in DOCUMENTS:
        for target in re.findall(r"\]\(([^)#:]+)\)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name} links to {target}"
