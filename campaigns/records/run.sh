#!/usr/bin/env bash
# Measured records, where ../shared/data is there: the base laws against closed forms by least squares. They are read and never copied into the project.
# Needs NumPy: PYTHON=target/python-checks-venv/bin/python.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
measured keizer-2022-cycles
begin records
run_in records "$python" "$root/campaigns/records/records.py" "$program" "$data" --work "$raw/work" --json "$raw/records.json"
rm -rf "$raw/work"
finish
