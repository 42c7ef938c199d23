#!/bin/sh
# Write requirements.lock: versions of all dependencies for Python 3.11 to 3.13, with development tools.
set -eu
cd "$(dirname "$0")/.."
tool=$(mktemp -d)
trap 'rm -rf "$tool"' EXIT
"${1:-.venv}/bin/python" -m venv "$tool"
"$tool/bin/python" -m pip install --quiet uv
"$tool/bin/uv" pip compile --quiet --universal --python-version 3.11 --fork-strategy fewest --no-annotate --no-header --upgrade \
    --group dev --group studies --extra ocio --extra measures --extra cluster --extra farm --output-file requirements.lock pyproject.toml
