"""Documents: files, flags, settings and links exist, and the examples run."""

import dataclasses
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from enum import Enum
from pathlib import Path

import click
import pytest

from enfilade.cli import main
from enfilade.settings import SECTIONS
from studies.__main__ import main as studies

ROOT = Path(__file__).parents[1]
DOCUMENTS = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "studies").rglob("*.md")),
]
FLAG = re.compile(r"(?<![\w!-])--[a-z][a-z0-9-]*")
FLAGS_OF_OTHER_PROGRAMS = {
    "podman": "--cap-drop --memory --network --pids-limit --read-only --rm --security-opt --tmpfs --volume",
    "openjd": "--run-dependencies",
    "make bench": "--scenes --keep --quick --sizes",
    "make case-studies": "--scenes --items --preset",
    "benchmarks/faults.py": "--count --quick",
}
BEGIN, END = "<!-- settings: written by tests/test_docs.py -->\n", "<!-- end of settings -->"
SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="5"/></integrator>
  <shape type="rectangle">
    <transform name="to_world"><scale value="3"/><translate z="-4"/></transform>
    <bsdf type="diffuse"/>
  </shape>
  <shape type="sphere"><point name="center" x="0" y="0" z="-3"/><float name="radius" value="0.7"/></shape>
  <emitter type="constant"/>
</scene>"""
CAMERA_PATH = """{
  "format": "enfilade-path", "fps": 24, "size": [64, 48],
  "keys": [
    {"time": 0.0, "eye": [0, 0, 0], "target": [0, 0, -3], "fov": 50},
    {"time": 0.125, "eye": [0.1, 0, 0], "target": [0, 0, -3]}
  ]
}"""


def parameters(command: click.Command) -> Iterator[click.Parameter]:
    yield from command.params
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below is not None
            yield from parameters(below)


@pytest.fixture(scope="module")
def flags() -> set[str]:
    options = [option for command in (main, studies) for option in parameters(command)]
    own = {flag for option in options for flag in (*option.opts, *option.secondary_opts)}
    return own | {"--help"} | {flag for named in FLAGS_OF_OTHER_PROGRAMS.values() for flag in named.split()}


def test_nothing_advises_to_install_enfilade_by_name() -> None:
    """No package index has it: ``pip install 'enfilade[extra]'`` fails, or installs something else."""
    texts = [*DOCUMENTS, ROOT / "CHANGELOG.md", *ROOT.glob("src/**/*.py"), *ROOT.glob("studies/**/*.py")]
    assert not [file for file in texts if re.search(r"enfilade\[|pip install '?enfilade", file.read_text())]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: str(d.relative_to(ROOT)))
def test_named_files_flags_and_settings_exist(document: Path, flags: set[str]) -> None:
    text = document.read_text()
    files = re.findall(r"`((?:tests|docs|benchmarks|setup|studies)/[\w/.-]*)`", text)
    assert not [name for name in files if not (ROOT / name).exists()]
    assert not set(FLAG.findall(text)) - flags
    known = {
        f"{section.table}.{option.name}" for section in SECTIONS for option in dataclasses.fields(section)
    }
    assert not set(re.findall(r"--set (\w+\.\w+)=", text)) - known
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)
    assert not [target for target in targets if not (document.parent / target).exists()]


def test_modules_on_the_map_of_the_paper_exist() -> None:
    rows = [line for line in (ROOT / "docs/paper.md").read_text().splitlines() if line.startswith("|")]
    named = {name for row in rows for name in re.findall(r"`([\w/]+(?:\.py|/))`", row)}
    assert len(named) > 30
    roots = (ROOT, ROOT / "src/enfilade")
    assert not [name for name in named if not any((root / name).exists() for root in roots)]


def settings_table() -> str:
    """The tables of all settings. ``UPDATE_DOCS=1 pytest tests/test_docs.py`` writes them."""
    lines = []
    for section in SECTIONS:
        lines += ["", f"**`[{section.table}]`**: {first_sentence(section)}", ""]
        lines += ["| name | default | meaning |", "| --- | --- | --- |"]
        for option in dataclasses.fields(section):
            choices = option.metadata["choices"] or [kind.value for kind in _kinds(option.default)]
            text = option.metadata["help"] + (f" One of {', '.join(choices)}." if choices else "")
            shown = getattr(option.default, "value", option.default)
            lines.append(f"| `{option.name}` | {'none' if shown == '' else shown} | {text} |")
    return "\n".join([*lines[1:], ""])


def _kinds(default: object) -> list[Enum]:
    return list(type(default)) if isinstance(default, Enum) else []


def first_sentence(section: type) -> str:
    return (section.__doc__ or "").partition("\n")[0]


def test_the_table_of_settings_is_that_of_the_code() -> None:
    file = ROOT / "docs/formats.md"
    before, _, rest = file.read_text().partition(BEGIN)
    written, _, after = rest.partition(END)
    if os.environ.get("UPDATE_DOCS"):
        file.write_text(before + BEGIN + settings_table() + END + after)
        return
    assert written == settings_table()


def test_examples_run(tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text(SCENE)
    (tmp_path / "camera_path.json").write_text(CAMERA_PATH)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(), re.DOTALL)
    blocks += re.findall(r"```python\n(.*?)```", (ROOT / "docs/metric.md").read_text(), re.DOTALL)
    assert len(blocks) > 7
    script = []
    for block in blocks:
        if name := re.match(r"# file: (\S+)\n", block):
            (tmp_path / name[1]).write_text(block)
        else:
            script.append(block)
    (tmp_path / "examples.py").write_text("\n".join(script))
    done = subprocess.run(
        [sys.executable, "examples.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "runs").glob("*/video.mp4"))) == 5
    assert "mean-error" in done.stdout
