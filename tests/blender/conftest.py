"""Blender's Python, and files that it makes; tests without it are skipped."""

import json
import subprocess
from pathlib import Path

import mitsuba as mi
import pytest

from enfilade.device import active

ROOT = Path(__file__).parents[2]
PYTHON = ROOT / ".venv-blender" / "bin" / "python"
EXPORTER, CORPUS = ROOT / "src" / "enfilade_blender", Path(__file__).parent / "corpus"


def pytest_collection_modifyitems(items):
    if not PYTHON.exists():
        skip = pytest.mark.skip(reason="there is no .venv-blender: make blender")
        for item in items:
            if "blender" in item.keywords and item.path.is_relative_to(Path(__file__).parent):
                item.add_marker(skip)


@pytest.fixture(autouse=True, scope="session")
def variant():
    mi.set_variant(active().variant)


class Blender:
    """Runs scripts in Blender's Python."""

    def __init__(self, folder):
        self.folder = folder

    def run(self, *arguments):
        line = [str(PYTHON), "-I", *map(str, arguments)]
        return subprocess.run(line, capture_output=True, text=True, check=False, timeout=300)  # noqa: S603

    def make(self, *names):
        """Files of the corpus."""
        done = self.run(CORPUS, self.folder / "files", *names)
        assert done.returncode == 0, done.stderr[-2000:]
        return [self.folder / "files" / f"{name}.blend" for name in names]

    def job(self, source, name, **keys):
        """Run a job; exit code, folder, and its ``import.json``, ``cycles.json`` or ``error.json``."""
        out = self.folder / name
        out.mkdir()
        file = self.folder / f"{name}.json"
        job = {"task": "export", "source": str(source), "out": str(out), "bake_px": 64, "bake_samples": 1}
        file.write_text(json.dumps(job | keys))
        done = self.run(EXPORTER, file)
        results = [out / f"{kind}.json" for kind in ("error", "import", "cycles")]
        result = next((r for r in results if r.exists()), None)
        assert result is not None, done.stderr[-2000:]
        return done.returncode, out, json.loads(result.read_text())


@pytest.fixture(scope="session")
def blender(tmp_path_factory):
    return Blender(tmp_path_factory.mktemp("blender"))
