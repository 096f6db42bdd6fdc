#!/usr/bin/env bash
# Laws that no list holds: records of gels one of whose quantities depends on a state, drawn and stepped by a program of its own (examples/hidden_laws.rs), learnt by `learn`; and records where
# nothing depends on anything. Seeds from 4001 on were looked at while the learner was written; these were not.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin laws
count=${COUNT:-40}
controls=${CONTROLS:-$count}
# Learns from every record of a kind, which is drawn if it is not there; documents and truths in KIND-NUMBER.json and .truth.json.
learn_all() {
    local kind=$1 number=$2 record
    shift 2
    run_in "$kind" "$root/target/release/examples/hidden_laws" "$raw/$kind" "$number" "$@"
    for record in "$raw/$kind"/law-*; do
        local label=$kind-${record##*-}
        run_in "$label" "$program" learn "$record" --out "$raw/study" --json "$raw/$label.json" --quiet --no-report --force
        cp "$record/truth.json" "$raw/$label.truth.json"
        rm -rf "$raw/study"
    done
}
learn_all hidden "$count" 5001
learn_all none "$controls" 5002 none
# Effects of the library, hidden one at a time by full finite elements: does `learn` prefer the library's?
library=${LIBRARY:-$((count / 2))}
for ((number = 0; number < library; number++)); do
    label=library-$number
    place=$raw/library/$number
    run_in "$label.new" "$program" challenge new --out "$place" --seed $((5100 + number)) --quiet
    run_in "$label" "$program" learn "$place" --out "$raw/library-study/$number" --json "$raw/$label.json" --quiet --no-report --force
    run_in "$label.answer" "$program" challenge reveal "$place" --study "$raw/library-study/$number" --json "$raw/$label.answer.json" --quiet
done
finish
