#!/usr/bin/env bash
# Hidden cohorts of 20 by finer finite elements: an effect at 2 σ in every record, at 4 σ in half of them, twice as large in one of two species, and in none. What does `diagnose` say of the
# cohort? COUNT cohorts of each sort.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin cohorts
count=${COUNT:-10}
records=${RECORDS:-20}
effects=(instantaneous-elasticity tracking-drift force-bias softening)
noises=(white ou gain outliers)
makers=$(nproc)

# cohort PLACE SEED SPECIES STRENGTH NUMBER…: records with these numbers; a strength of 0 hides nothing.
cohort() {
    local place=$1 seed=$2 species=$3 strength=$4 hidden number
    shift 4
    for number in "$@"; do
        local dir=$place/$species-$number
        [[ -e $dir/experiment.toml ]] && continue
        hidden=(--effect "$effect" --strength "$strength")
        if [[ $strength == 0 ]]; then
            hidden=(--none)
        fi
        while (($(jobs -rp | wc -l) >= makers)); do wait -n; done
        {
            "$program" challenge new --out "$dir" "${hidden[@]}" --noise-kind "$noise" --seed $((1000 * seed + number)) --quiet >>"$raw/made.log" 2>&1 || touch "$raw/broken"
            # The seal holds the data and the hash; whose eye it is stands in no seal.
            sed -i "s/^id = .*/id = \"$species-$number\"/; s/^species = .*/species = \"$species\"/" "$dir/experiment.toml"
        } &
    done
    wait
    [[ ! -e $raw/broken ]]
}

# diagnosed LABEL PLACE: the diagnosis, with what was hidden beside it.
diagnosed() {
    local label=$1 place=$2 dir
    run_in "$label" "$program" diagnose "$place" --out "$raw/out/$label" --json "$raw/$label.json" --quiet
    for dir in "$place"/*/; do
        "$program" challenge reveal "$dir" --json - --quiet 2>/dev/null
    done | "$python" -c 'import json, sys
text, at, found, decoder = sys.stdin.read(), 0, [], json.JSONDecoder()
while text[at:].strip():
    at += len(text[at:]) - len(text[at:].lstrip())
    document, at = decoder.raw_decode(text, at)
    found.append(document["truth"])
json.dump(found, sys.stdout)' >"$raw/$label.truth"
}

half=$((records / 2))
for ((k = 0; k < count; k++)); do
    effect=${effects[k % ${#effects[@]}]}
    noise=${noises[(k / ${#effects[@]} + k) % ${#noises[@]}]}
    all=$(seq "$records")
    place=$raw/made
    # shellcheck disable=SC2086
    cohort "$place/each-$k" $((100 + k)) porcine 2 $all
    diagnosed "each.$k" "$place/each-$k"
    # shellcheck disable=SC2046
    cohort "$place/half-$k" $((300 + k)) porcine 4 $(seq "$half")
    # shellcheck disable=SC2046
    cohort "$place/half-$k" $((300 + k)) porcine 0 $(seq $((half + 1)) "$records")
    diagnosed "half.$k" "$place/half-$k"
    # shellcheck disable=SC2046
    cohort "$place/twice-$k" $((500 + k)) bovine 8 $(seq "$half")
    # shellcheck disable=SC2046
    cohort "$place/twice-$k" $((500 + k)) human 4 $(seq $((half + 1)) "$records")
    diagnosed "twice.$k" "$place/twice-$k"
    # shellcheck disable=SC2046
    cohort "$place/alike-$k" $((700 + k)) bovine 4 $(seq "$half")
    # shellcheck disable=SC2046
    cohort "$place/alike-$k" $((700 + k)) human 4 $(seq $((half + 1)) "$records")
    diagnosed "alike.$k" "$place/alike-$k"
    # shellcheck disable=SC2086
    cohort "$place/none-$k" $((900 + k)) porcine 0 $all
    diagnosed "none.$k" "$place/none-$k"
done
finish
