#!/bin/sh
# Create a virtual environment (folder $1, .venv by default) with the versions of requirements.lock and an
# editable installation of this checkout.
set -eu
cd "$(dirname "$0")/.."
folder=${1:-.venv}

python=$(sh setup/python.sh)
if ! "$folder/bin/python" -c 'import pip' >/dev/null 2>&1; then
    echo "setup: creating $folder with $("$python" --version 2>&1)"
    "$python" -m venv --clear "$folder"
fi

# Run pip with one line of output for each package.
install() {
    status=$(mktemp)
    {
        "$folder/bin/python" -m pip install --disable-pip-version-check --progress-bar off "$@" || echo $? >"$status"
    } | sed -u -n 's/^Collecting \([^ ]*\).*/setup:   \1/p; s/^Installing collected.*/setup:   unpacking/p'
    failed=$(cat "$status")
    rm -f "$status"
    return "${failed:-0}"
}

echo "setup: installing the locked versions (about 250 MB the first time)"
install --no-compile --requirement requirements.lock
echo "setup: installing enfilade"
install --no-deps --editable .
