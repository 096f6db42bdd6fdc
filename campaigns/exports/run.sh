#!/usr/bin/env bash
# Exports in the layouts of instruments and programs, written by files.py from records whose times, forces and positions are known. `init` reads each without an
# answer, or refuses it. A file counts as wrong if it is read with other numbers.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
source scripts/environment.sh
fail() {
    printf '%s\n' "$1" >&2
    exit 1
}
begin exports
python_environment target/exports-venv campaigns/exports/requirements.txt || fail 'cannot install campaigns/exports/requirements.txt; the network is needed the first time'
run_in exports target/exports-venv/bin/python campaigns/exports/files.py --program "$program" --seed 48 --out "$raw"
finish
