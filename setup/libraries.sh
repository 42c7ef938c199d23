#!/bin/sh
# See that the system libraries are there which no wheel brings: LLVM, 16 or newer, and libatomic. Install
# what is missing by apt. Exit 0: they are there. Exit 2: one is not, and what to do was said.
set -u
LEAST=16
NEWEST=22

# File names of the libraries in the places where the loader and Dr.Jit look.
libraries() {
    ls /usr/lib/*-linux-gnu/ /usr/lib/wsl/lib/ 2>/dev/null
    /sbin/ldconfig -p 2>/dev/null | sed -n 's/^[[:space:]]*\(lib[^ ]*\).*/\1/p'
}

# Major version of the newest LLVM; empty if there is none.
llvm_found() {
    libraries | sed -n 's/^libLLVM[-.][^0-9]*\([0-9][0-9]*\).*/\1/p' | sort -n | tail -n 1
}

has_llvm() {
    { [ -n "${DRJIT_LIBLLVM_PATH:-}" ] && [ -e "$DRJIT_LIBLLVM_PATH" ]; } || [ "$(llvm_found || true)" -ge "$LEAST" ] 2>/dev/null
}

has_atomic() {
    libraries | grep -q '^libatomic\.so\.1'
}

# The LLVM that the tests run with first, then the newest that apt knows.
llvm_package() {
    for version in 19 $(seq "$NEWEST" -1 "$LEAST"); do
        apt-cache show "libllvm$version" >/dev/null 2>&1 && echo "libllvm$version" && return
    done
}

missing=""
has_atomic || missing="libatomic1"
has_llvm || missing="$missing LLVM"
if [ -z "$missing" ]; then
    exit 0
fi

found=$(llvm_found)
wanted="$(has_atomic || printf 'libatomic1 ')$(has_llvm || printf 'libllvm19')"
echo "setup: missing:$(has_atomic || printf ' libatomic')$(has_llvm || printf ' LLVM %s or newer (found: %s)' "$LEAST" "${found:-none}")"
if ! command -v apt-get >/dev/null 2>&1; then
    echo "setup: install them with this system's package manager" >&2
    exit 2
fi
if [ "$(id -u)" -eq 0 ]; then
    as_root=""
elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
    as_root="sudo -n"
else
    echo "setup: this user may not install packages; run this once, then again what you ran:" >&2
    echo "       sudo apt-get install $wanted   (any LLVM from libllvm$LEAST on will do)" >&2
    exit 2
fi

llvm=$(has_llvm || llvm_package)
if ! has_llvm && [ -z "$llvm" ]; then
    $as_root apt-get update -qq || echo "setup: apt-get update failed, going on with what apt knows" >&2
    llvm=$(llvm_package)
fi
if ! has_llvm && [ -z "$llvm" ]; then
    echo "setup: apt knows no libllvm$LEAST to libllvm$NEWEST here; see https://apt.llvm.org" >&2
    exit 2
fi
packages="$(has_atomic || printf 'libatomic1 ')$llvm"
echo "setup: installing $packages"
# Word splitting is meant: one argument a package.
# shellcheck disable=SC2086
install() {
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y -o Dpkg::Use-Pty=0 --no-install-recommends $packages >/dev/null
}
install || { $as_root apt-get update -qq && install; } || {
    echo "setup: apt-get could not install $packages; its reason stands above" >&2
    exit 2
}
if ! has_llvm || ! has_atomic; then
    echo "setup: $packages was installed, but the libraries are not where the loader and Dr.Jit look" >&2
    exit 2
fi
