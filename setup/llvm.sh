#!/bin/sh
# See that LLVM's library, 16 or newer, is there; install it by apt where it is missing.
# Exit 0: it is there. Exit 2: it is not, and what to do was said.
set -u
LEAST=16
NEWEST=22

# Major version of the newest library in the places where Dr.Jit looks (and `ldconfig` knows); empty if none.
newest_found() {
    {
        ls -d /usr/lib/*-linux-gnu/libLLVM*.so* /usr/lib/wsl/lib/libLLVM*.so* 2>/dev/null
        /sbin/ldconfig -p 2>/dev/null | sed -n 's/^[[:space:]]*\(libLLVM[^ ]*\).*/\1/p'
    } | sed -n 's/.*libLLVM[-.][^0-9]*\([0-9][0-9]*\).*/\1/p' | sort -n | tail -n 1
}

is_enough() {
    [ -n "${1:-}" ] && [ "$1" -ge "$LEAST" ]
}

if [ -n "${DRJIT_LIBLLVM_PATH:-}" ] && [ -e "$DRJIT_LIBLLVM_PATH" ]; then
    echo "setup: LLVM as DRJIT_LIBLLVM_PATH says, $DRJIT_LIBLLVM_PATH"
    exit 0
fi
found=$(newest_found)
if is_enough "$found"; then
    echo "setup: LLVM $found is there"
    exit 0
fi

needed="LLVM $LEAST or newer is needed, found: ${found:-none}"
if ! command -v apt-get >/dev/null 2>&1; then
    echo "setup: $needed; install LLVM's shared library with this system's package manager" >&2
    exit 2
fi
if [ "$(id -u)" -eq 0 ]; then
    as_root=""
elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
    as_root="sudo -n"
else
    echo "setup: $needed, and this user may not install packages; run this once, then again what you ran:" >&2
    echo "       sudo apt-get install libllvm19   (any from libllvm$LEAST on will do)" >&2
    exit 2
fi

# The version that the tests run with first, then the newest that apt knows.
known() {
    for version in 19 $(seq "$NEWEST" -1 "$LEAST"); do
        apt-cache show "libllvm$version" >/dev/null 2>&1 && echo "libllvm$version" && return
    done
}
package=$(known)
if [ -z "$package" ]; then
    $as_root apt-get update -qq || echo "setup: apt-get update failed, going on with what apt knows" >&2
    package=$(known)
fi
if [ -z "$package" ]; then
    echo "setup: $needed, and apt knows no libllvm$LEAST to libllvm$NEWEST; see https://apt.llvm.org" >&2
    exit 2
fi
echo "setup: $needed; installing $package"
install() {
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$package" >/dev/null
}
install || { $as_root apt-get update -qq && install; } || {
    echo "setup: apt-get could not install $package; its reason stands above" >&2
    exit 2
}
is_enough "$(newest_found)" || {
    echo "setup: $package is installed, but no libLLVM of version $LEAST or newer is where Dr.Jit looks" >&2
    exit 2
}
