#!/usr/bin/env bash
# Builds the program as one file that needs no system library, for clusters with old libraries and for containers. It uses musl if Rust's target is installed
# (`rustup target add x86_64-unknown-linux-musl`). `--gnu` links glibc statically, which needs its libc.a (Debian and Ubuntu: libc6-dev). `--if-possible` succeeds with a message if musl's
# target is missing. `--debug` builds as for the tests. As root, the program is then run in an empty directory by chroot.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'static-binary: %s\n' "$1" >&2
    exit 1
}

c_library=musl profile=(--release) directory=release if_possible=
for option in "$@"; do
    case $option in
    --gnu) c_library=gnu ;;
    --debug) profile=() directory=debug ;;
    --if-possible) if_possible=1 ;;
    *) fail "unknown option $option; there are --gnu, --debug and --if-possible" ;;
    esac
done
[[ $(uname -s) == Linux ]] || fail 'static programs are built on Linux'
target=$(uname -m)-unknown-linux-$c_library
if [[ ! -d $(rustc --print target-libdir --target "$target") ]]; then
    words="Rust's target $target is not installed: rustup target add $target"
    if [[ -n $if_possible ]]; then
        printf 'static-binary: SKIPPED: %s\n' "$words"
        exit 0
    fi
    fail "$words"
fi
if [[ $c_library == gnu ]]; then
    export RUSTFLAGS="${RUSTFLAGS:-} -C target-feature=+crt-static"
fi
cargo build --quiet --locked "${profile[@]}" --target "$target" --package vitreo-uq --bin vitreo-uq
program=target/$target/$directory/vitreo-uq
if ldd "$program" 2>/dev/null | grep -q '=>'; then
    fail "$program needs libraries: $(ldd "$program" | tr -s '[:space:]' ' ')"
fi
version=$("$program" --version)
if ((EUID == 0)); then
    empty=$(mktemp -d)
    trap 'rm -rf "$empty"' EXIT
    cp "$program" "$empty/"
    mkdir "$empty/tmp"
    [[ $(chroot "$empty" /vitreo-uq --version) == "$version" ]] || fail 'it does not run in an empty directory'
    chroot "$empty" /vitreo-uq fit --out /tmp/study --quiet >/dev/null || (($? == 1)) || fail 'it cannot fit the embedded replica in an empty directory'
    [[ -s $empty/tmp/study/fit.json || -n $(find "$empty/tmp/study" -name 'fit*.json') ]] || fail 'it wrote no fit'
fi
printf '%s: %s, %d bytes\n' "$program" "$version" "$(stat -c %s "$program")"
