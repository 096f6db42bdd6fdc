#!/usr/bin/env bash
# Runs every tests/python/*.py against common Python tools (ArviZ, VTK, corner, emcee, UM-Bridge), in an environment of its own
# under target/. Needs Python 3.9 or newer (PYTHON=… for another one than python3), cargo and, the first time, the network.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

python=${PYTHON:-python3}
requirements=tests/python/requirements.txt
environment=target/python-checks-venv

fail() {
    printf 'python-checks: %s\n' "$1" >&2
    exit 1
}

source scripts/environment.sh

command -v "$python" >/dev/null || fail "$python is not installed; install Python 3.9 or newer, or set PYTHON"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 9))' || fail "$("$python" --version) is too old; set PYTHON to 3.9 or newer"

python_environment "$environment" "$requirements" || fail "cannot install $requirements; the network is needed the first time"

# Drawing needs no window system, and no byte code stays in the source tree.
export MPLBACKEND=Agg PYTHONDONTWRITEBYTECODE=1
# Compiled once here, so no check's time or output includes it.
cargo build --quiet --examples --bins
# Checks run this program. Building it alone would compile dependencies once more, with fewer features.
export VITREO_UQ=$PWD/target/debug/vitreo-uq

passed=0 failed=0
for script in tests/python/*.py; do
    # Other checks import this file.
    [[ $script == */small_experiment.py ]] && continue
    printf '%s: ' "${script##*/}"
    if "$environment/bin/python" "$script" </dev/null; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        printf '%s FAILED\n' "${script##*/}" >&2
    fi
done
printf '%d passed, %d failed\n' "$passed" "$failed"
[[ $failed -eq 0 && $passed -gt 0 ]]
