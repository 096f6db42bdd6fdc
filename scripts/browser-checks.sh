#!/usr/bin/env bash
# Tests the workbench in a real browser, and its page's types. Needs cargo, Node 20 or newer with npm, Chromium (CHROMIUM=… unless it is /usr/bin/chromium) and, the first time, the network.
# As root on Debian and Ubuntu, missing packages are installed. Pictures of every view go to target/browser-checks/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'browser-checks: %s\n' "$1" >&2
    exit 1
}

export CHROMIUM=${CHROMIUM:-/usr/bin/chromium}
packages=()
command -v npm >/dev/null || packages+=(nodejs npm)
[[ -x $CHROMIUM ]] || packages+=(chromium fonts-dejavu-core)
if ((${#packages[@]} > 0)); then
    if [[ $(id -u) != 0 ]] || ! command -v apt-get >/dev/null; then
        fail "install ${packages[*]}"
    fi
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${packages[@]}" >/dev/null
fi

# Made again if the lock file has changed.
place=target/browser-checks
mkdir -p "$place/pictures"
if ! cmp -s tests/browser/package-lock.json "$place/package-lock.json"; then
    cp tests/browser/package.json tests/browser/package-lock.json "$place/"
    (cd "$place" && npm ci --silent --no-audit --no-fund) || fail "cannot install tests/browser/package.json; the network is needed the first time"
fi
cp tests/browser/workbench.test.mjs tests/browser/tsconfig.json "$place/"
# Paths in the copy lead to the same page.
"$place/node_modules/.bin/tsc" --project "$place/tsconfig.json"

cargo build --quiet --examples --bins
COHORT=$PWD/data/cohort VITREO_UQ=$PWD/target/debug/vitreo-uq PICTURES=$PWD/$place/pictures node --test "$place/workbench.test.mjs"
