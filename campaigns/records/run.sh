#!/usr/bin/env bash
# Measured records, where ../shared/data is there: the base laws against closed forms by least squares. They are read and never copied into the project.
# Needs NumPy: PYTHON=target/python-checks-venv/bin/python.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
data=$root/../shared/data
if [[ ! -d $data/keizer-2022-cycles ]]; then
    echo "measured records are not here ($data): nothing was run" >&2
    exit 0
fi
begin records
run_in records "$python" "$root/campaigns/records/records.py" "$program" "$data" --work "$raw/work" --json "$raw/records.json"
rm -rf "$raw/work"
finish
