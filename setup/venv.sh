#!/bin/sh
# Make .venv with the versions of requirements.lock and this checkout, editable. Takes a folder as $1.
set -eu
cd "$(dirname "$0")/.."
folder=${1:-.venv}

python=$(sh setup/python.sh)
if ! "$folder/bin/python" -c 'import pip' >/dev/null 2>&1; then
    echo "setup: making $folder with $("$python" --version 2>&1)"
    "$python" -m venv --clear "$folder"
fi

export PIP_DISABLE_PIP_VERSION_CHECK=1
echo "setup: installing the locked versions (about 250 MB the first time)"
"$folder/bin/python" -m pip install --quiet --no-compile --requirement requirements.lock
echo "setup: installing enfilade"
"$folder/bin/python" -m pip install --quiet --no-deps --editable .
