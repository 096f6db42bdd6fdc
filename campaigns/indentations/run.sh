#!/usr/bin/env bash
# Measured force-clamp indentations, where ../shared/data is there: laws fitted to the approach and two seconds of the hold, the last second predicted. The records are read and never
# copied into the project.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
data=$root/../shared/data/afm-force-clamp
if [[ ! -d $data ]]; then
    echo "measured indentations are not here ($data): nothing was run" >&2
    exit 0
fi
begin indentations
laws=$root/campaigns/indentations
for record in brain polymergel; do
    experiment=$raw/$record
    mkdir -p "$experiment"
    cp "$data/$record.csv" "$experiment/force-clamp.csv"
    sed "s/RECORD/$record/" "$laws/experiment.toml" >"$experiment/experiment.toml"
    for law in lethersich burgers two-element; do
        run_in "$record.$law" "$program" sample "$experiment" --base "$law" --prior generic --out "$raw/$record.$law" --json "$raw/$record.$law.json" --quiet
    done
    for law in springpot springpot-and-spring springpot-and-dashpot; do
        run_in "$record.$law" "$program" sample "$experiment" --base "$laws/$law.toml" --prior generic --out "$raw/$record.$law" --json "$raw/$record.$law.json" --quiet
    done
    run_in "$record.diagnose" "$program" diagnose "$experiment" --base "$laws/springpot.toml" --prior generic --out "$raw/$record.springpot" --json "$raw/$record.diagnose.json" --quiet
done
rm -rf "$raw"/*/
finish
