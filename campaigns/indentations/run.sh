#!/usr/bin/env bash
# Measured force-clamp indentations, where ../shared/data is there: laws fitted to the approach and two seconds of the hold, the last second predicted. The tips' shapes are not known, so that
# each record is taken as a sphere's and as a cone's. The same of the hold alone, by least squares, where a second retarded body is asked for, too. Records are read and never copied into the project.
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

# held LABEL EXPERIMENT ARGUMENTS…: the point estimate of the first two seconds of the hold, and how it predicts the last.
held() {
    local label=$1 experiment=$2
    shift 2
    run_in "$label" "$program" fit "$experiment" "$@" --prior generic --out "$raw/study.$label" --json "$raw/$label.json" --quiet
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
        hold=$raw/experiment.$label.hold
        mkdir -p "$hold"
        install -m 644 "$data/$record.csv" "$hold/force-clamp.csv"
        # The approach loads the gel, and is neither fitted nor predicted.
        sed 's/^cycle_starts_s = .*/cycle_starts_s = [0, 3, 5]\ncalibration_cycles = [2]\nheldout_cycles = [3]/' "$experiment/experiment.toml" >"$hold/experiment.toml"
        held "$label.hold.burgers" "$hold" --base burgers
        held "$label.hold.springpot" "$hold" --base "$own/springpot.toml"
        held "$label.hold.second-retardation" "$hold" --base burgers --with second-retardation
    done
done
rm -rf "$raw"/study.* "$raw"/experiment.*
finish
