#!/usr/bin/env bash
# Builds the Python wheel, with the module and the program, into target/wheels/. Needs Python 3.10 or newer (PYTHON=… for another than python3),
# cargo and, the first time, the network. `--debug` builds both as for the tests; VITREO_UQ=path uses an existing program.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'wheel: %s\n' "$1" >&2
    exit 1
}

source scripts/environment.sh

profile=(--release) directory=release
case ${1:-} in
"") ;;
--debug) profile=() directory=debug ;;
*) fail "unknown option $1; there is --debug" ;;
esac

python=${PYTHON:-python3}
environment=target/wheel-venv
requirements=crates/python/build-requirements.txt
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || fail "Python 3.10 or newer is needed; set PYTHON"
python_environment "$environment" "$requirements" || fail "cannot install $requirements; the network is needed the first time"

if [[ -z ${VITREO_UQ:-} ]]; then
    cargo build --quiet --locked "${profile[@]}" --package vitreo-uq --bin vitreo-uq
fi
program=${VITREO_UQ:-target/$directory/vitreo-uq}
[[ -x $program ]] || fail "VITREO_UQ=$program is not a program"
scripts=crates/python/vitreo_uq.data/scripts
mkdir -p "$scripts"
cp "$program" "$scripts/vitreo-uq"
# Function names are of no use to users and take half of a debug build.
if command -v strip >/dev/null; then strip "$scripts/vitreo-uq"; fi
"$environment/bin/maturin" build --quiet --locked "${profile[@]}" --manifest-path crates/python/Cargo.toml --out target/wheels
