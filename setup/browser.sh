#!/bin/sh
# Install Chromium by apt if it is missing; the tests of `enfilade report` open the report in it. The exit status
# is always 0: if the installation fails, a message says what to do, and those tests fail.
set -u

has_browser() {
    command -v chromium >/dev/null 2>&1 || command -v chromium-browser >/dev/null 2>&1
}

has_browser && exit 0
as_root=""
if [ "$(id -u)" -ne 0 ]; then
    as_root="sudo -n"
    if ! command -v sudo >/dev/null 2>&1 || ! sudo -n true 2>/dev/null; then
        as_root="none"
    fi
fi
if [ "$as_root" = none ] || ! command -v apt-get >/dev/null 2>&1; then
    echo "setup: Chromium is missing; the tests of the report need it. Install it with:" >&2
    echo "       sudo apt-get install chromium" >&2
    exit 0
fi
install() {
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y -o Dpkg::Use-Pty=0 --no-install-recommends chromium >/dev/null
}
echo "setup: installing chromium"
install || { $as_root apt-get update -qq && install; } || {
    echo "setup: apt-get could not install chromium (see above); the tests of the report will fail" >&2
}
exit 0
