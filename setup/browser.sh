#!/bin/sh
# See that Chromium is there, in which the tests open the page of `enfilade report`; install it by apt where
# it is missing. Exit 0 also where that can't be: then what to do was said, and those tests fail.
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
    echo "setup: Chromium is missing, and the tests of the report's page fail without it; install it once:" >&2
    echo "       sudo apt-get install chromium" >&2
    exit 0
fi
install() {
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y -o Dpkg::Use-Pty=0 --no-install-recommends chromium >/dev/null
}
echo "setup: installing chromium"
install || { $as_root apt-get update -qq && install; } || {
    echo "setup: apt-get could not install chromium; its reason stands above. The tests of the page will fail" >&2
}
exit 0
