#!/usr/bin/env bash
# Measured force-clamp indentations, where ../shared/data is there: laws fitted to the approach and two seconds of the hold, the last second predicted. The tips' shapes are not known, so that
# each record is taken as a sphere's and as a cone's. The same of the hold alone, by least squares, where a second retarded body is asked for, too. Records are read and never copied into the project.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
measured afm-force-clamp
begin indentations
own=$root/campaigns/indentations

# fitted COMMAND LABEL EXPERIMENT ARGUMENTS…: a posterior (`sample`) or a point estimate (`fit`), and how it predicts the last second.
fitted() {
    local command=$1 label=$2 experiment=$3
    shift 3
    run_in "$label" "$program" "$command" "$experiment" "$@" --prior generic --out "$raw/study.$label" --json "$raw/$label.json" --quiet
}

for record in polymergel brain; do
    for tip in cone=2 sphere=1.5; do
        label=$record.${tip%=*}
        experiment=$raw/experiment.$label
        mkdir -p "$experiment"
        install -m 644 "$data/afm-force-clamp/$record.csv" "$experiment/force-clamp.csv"
        sed "s/RECORD/$record/; s/EXPONENT/${tip#*=}/" "$own/experiment.toml" >"$experiment/experiment.toml"
        fitted sample "$label.lethersich" "$experiment"
        fitted sample "$label.burgers" "$experiment" --base burgers
        fitted sample "$label.springpot" "$experiment" --base "$own/springpot.toml"
        hold=$raw/experiment.$label.hold
        mkdir -p "$hold"
        install -m 644 "$data/afm-force-clamp/$record.csv" "$hold/force-clamp.csv"
        # The approach loads the gel, and is neither fitted nor predicted.
        sed 's/^cycle_starts_s = .*/cycle_starts_s = [0, 3, 5]\ncalibration_cycles = [2]\nheldout_cycles = [3]/' "$experiment/experiment.toml" >"$hold/experiment.toml"
        fitted fit "$label.hold.burgers" "$hold" --base burgers
        fitted fit "$label.hold.springpot" "$hold" --base "$own/springpot.toml"
        fitted fit "$label.hold.second-retardation" "$hold" --base burgers --with second-retardation
    done
done
rm -rf "$raw"/study.* "$raw"/experiment.*
finish
