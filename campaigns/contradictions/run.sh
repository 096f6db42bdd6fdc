#!/usr/bin/env bash
# Records that contradict their description, and records that do not, through the checks that stand before every fit: how many are found, how many are called falsely.
# A minute of one core; `COUNT=10` for a look.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin contradictions
count=${COUNT:-100}
run_in counted "$root/target/release/examples/contradictions" "$count" $((4 * count)) 1
finish
