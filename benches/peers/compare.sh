#!/usr/bin/env bash
# Runs emcee, hammer-and-sample and vitreo-uq on the same posterior, one thread each, and prints a table. Needs Python 3.10 or newer (another one than
# python3: PYTHON=…), cargo and, the first time, the network. Everything is made under target/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

python=${PYTHON:-python3}
target=../../target
environment=$target/peers-venv
folder=$target/peers-data
stamp=$environment/installed

# The environment is current when it was made from the same requirements by the same Python; the stamp is written last.
wanted=$("$python" --version; cat requirements.txt)
if [[ ! -f $stamp || $(<"$stamp") != "$wanted" ]]; then
    rm -rf "$environment"
    mkdir -p "$target"
    "$python" -m venv "$environment"
    "$environment/bin/python" -m pip install --quiet --disable-pip-version-check --requirement requirements.txt
    printf '%s\n' "$wanted" >"$stamp"
fi

# The same target folder as the program's, so that its dependencies are not compiled twice.
cargo build --release --quiet --target-dir "$target"
mkdir -p "$folder"
"$target/release/peers" prepare "$folder"
# One thread for everyone; the arrays are too small for more to help.
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "$environment/bin/python" emcee_peer.py "$folder"
"$target/release/peers" compare "$folder"
