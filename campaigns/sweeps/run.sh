#!/usr/bin/env bash
# Oscillations of a rheometer of known truth, written by a program of its own (play.py): claims where nothing is hidden, and laws that lack a body.
# Ten seconds of one core a record; `COUNT=5` for a look.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin sweeps
count=${COUNT:-50}
for kind in plain stated spring body; do
    for ((first = 0; first < count; first += 10)); do
        run_in "$kind.$first" "$python" "$root/campaigns/sweeps/play.py" "$program" "$kind" "$first" $((first + 10 < count ? first + 10 : count))
    done
done
finish
