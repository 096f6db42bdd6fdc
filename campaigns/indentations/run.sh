#!/usr/bin/env bash
# Measured force-clamp indentations, where ../shared/data is there: laws fitted to the approach and two seconds of the hold, the last second predicted. The tips' shapes are not known, so that
# each record is taken as a sphere's and as a cone's. Records are read and never copied into the project.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
data=$root/../shared/data/afm-force-clamp
if [[ ! -d $data ]]; then
    echo "measured indentations are not here ($data): nothing was run" >&2
    exit 0
fi
begin indentations
own=$root/campaigns/indentations

# fitted LABEL EXPERIMENT ARGUMENTS…: a posterior of approach and two seconds of the hold, and how it predicts the last second.
fitted() {
    local label=$1 experiment=$2
    shift 2
    run_in "$label" "$program" sample "$experiment" "$@" --prior generic --out "$raw/study.$label" --json "$raw/$label.json" --quiet
}

for record in polymergel brain; do
    for tip in cone=2 sphere=1.5; do
        label=$record.${tip%=*}
        experiment=$raw/experiment.$label
        mkdir -p "$experiment"
        install -m 644 "$data/$record.csv" "$experiment/force-clamp.csv"
        sed "s/RECORD/$record/; s/EXPONENT/${tip#*=}/" "$own/experiment.toml" >"$experiment/experiment.toml"
        fitted "$label.lethersich" "$experiment"
        fitted "$label.burgers" "$experiment" --base burgers
        fitted "$label.springpot" "$experiment" --base "$own/springpot.toml"
    done
done
rm -rf "$raw"/study.* "$raw"/experiment.*
finish
