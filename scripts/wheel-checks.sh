#!/usr/bin/env bash
# Builds the wheel (without optimisation for release), installs it with pip into an environment of its own under target/, and runs tests/python/wheel/*.py
# there, outside the source tree. Needs Python 3.10 or newer (PYTHON=…), cargo and the network. VITREO_UQ=path uses an existing program.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

root=$PWD
environment=$root/target/wheel-checks-venv
# Built like the other checks: the program alone would compile dependencies once more, with fewer features.
if [[ -z ${VITREO_UQ:-} ]]; then
    cargo build --quiet --examples --bins
    export VITREO_UQ=$root/target/debug/vitreo-uq
fi
rm -rf target/wheels "$environment" "$environment-newest"
scripts/wheel.sh --debug
"${PYTHON:-python3}" -m venv "$environment"
# The module must work without ArviZ and PyTensor, in a plain installation.
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check target/wheels/vitreo_uq-*.whl
cd "$(mktemp -d)"
trap 'rm -rf "$PWD"' EXIT
export MPLBACKEND=Agg PYTHONDONTWRITEBYTECODE=1 VITREO_UQ_SOURCE=$root PATH=$environment/bin:$PATH
# Each check runs in a directory of its own.
run() {
    mkdir "$1"
    printf '%s: ' "$1"
    (cd "$1" && python "$root/tests/python/wheel/$1.py" </dev/null)
}
run clean_installation
python -m pip install --quiet --disable-pip-version-check --requirement "$root/tests/python/wheel/requirements.txt"
for script in module_and_program notebook pymc_ten_lines; do
    run "$script"
done
mypy --strict --no-error-summary --ignore-missing-imports --package vitreo_uq

# The other generation of ArviZ and PyMC, which needs Python 3.12.
newest=$(for name in python3.14 python3.13 python3.12 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.1[2-4].*/bin/python3; do "$name" -c 'import sys; print(sys.executable)' 2>/dev/null && break; done || true)
if [[ -z $newest ]]; then
    echo "ArviZ 1 and PyMC 6: not checked, for no Python from 3.12 on is installed"
    exit 0
fi
"$newest" -m venv "$environment-newest"
PATH=$environment-newest/bin:$PATH
python -m pip install --quiet --disable-pip-version-check "$root"/target/wheels/vitreo_uq-*.whl \
    --requirement "$root/tests/python/wheel/requirements-newest.txt"
mkdir newest
cd newest
for script in module_and_program pymc_ten_lines; do
    run "$script"
done
