#!/bin/sh
# Print the command of a usable Python 3.11 to 3.13; exit with status 2 and a message if there is none.
# PYTHON=/path/to/python3 selects one.
set -u

is_supported() {
    "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1
}

for candidate in ${PYTHON:-} python3.11 python3.12 python3.13 python3 python; do
    is_supported "$candidate" || continue
    if ! "$candidate" -c 'import venv, ensurepip' >/dev/null 2>&1; then
        version=$("$candidate" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        echo "setup: $candidate has no venv module; install it with:" >&2
        echo "       sudo apt-get install python$version-venv" >&2
        exit 2
    fi
    echo "$candidate"
    exit 0
done
echo "setup: Python 3.11, 3.12 or 3.13 is needed and was not found; install it with:" >&2
echo "       sudo apt-get install python3 python3-venv   (Debian 12 or Ubuntu 24.04 and newer)" >&2
echo "       or select one: make PYTHON=/path/to/python3.11 setup" >&2
exit 2
