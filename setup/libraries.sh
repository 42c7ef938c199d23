#!/bin/sh
# Install system libraries that no wheel contains, by apt, if they are missing: LLVM 17 or newer, and libatomic.
# Exit status 0: both are installed. 2: one is missing, and a message says what to do.
set -u
LEAST=17
NEWEST=22

# File names of the libraries in the search paths of the loader and of Dr.Jit.
libraries() {
    ls /usr/lib/*-linux-gnu/ /usr/lib/wsl/lib/ 2>/dev/null
    /sbin/ldconfig -p 2>/dev/null | sed -n 's/^[[:space:]]*\(lib[^ ]*\).*/\1/p'
}

# Major version of the newest installed LLVM; empty without one.
llvm_found() {
    libraries | sed -n 's/^libLLVM[-.][^0-9]*\([0-9][0-9]*\).*/\1/p' | sort -n | tail -n 1
}

has_llvm() {
    { [ -n "${DRJIT_LIBLLVM_PATH:-}" ] && [ -e "$DRJIT_LIBLLVM_PATH" ]; } || [ "$(llvm_found || true)" -ge "$LEAST" ] 2>/dev/null
}

has_atomic() {
    libraries | grep -q '^libatomic\.so\.1'
}

# Package of the LLVM version used by the tests, else of the newest version in apt.
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
    echo "setup: this user cannot install packages; run the following, then repeat the command:" >&2
    echo "       sudo apt-get install $wanted   (libllvm$LEAST or any newer version)" >&2
    exit 2
fi

llvm=$(has_llvm || llvm_package)
if ! has_llvm && [ -z "$llvm" ]; then
    $as_root apt-get update -qq || echo "setup: apt-get update failed; continuing with the current package lists" >&2
    llvm=$(llvm_package)
fi
if ! has_llvm && [ -z "$llvm" ]; then
    echo "setup: apt has no package from libllvm$LEAST to libllvm$NEWEST; see https://apt.llvm.org" >&2
    exit 2
fi
packages="$(has_atomic || printf 'libatomic1 ')$llvm"
echo "setup: installing $packages"
# Word splitting is intended: one argument for each package.
# shellcheck disable=SC2086
install() {
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y -o Dpkg::Use-Pty=0 --no-install-recommends $packages >/dev/null
}
install || { $as_root apt-get update -qq && install; } || {
    echo "setup: apt-get could not install $packages (see above)" >&2
    exit 2
}
if ! has_llvm || ! has_atomic; then
    echo "setup: $packages was installed, but the libraries are not in the search paths of the loader and Dr.Jit" >&2
    exit 2
fi
