#!/usr/bin/env bash
# Hidden cohorts of 20 by finer finite elements: an effect at 2 σ in every record, at 4 σ in half of them, twice as large in one of two species (at 4 σ typically in the other), as large in both, and in none. What does `diagnose`
# say of the cohort? COUNT cohorts of each sort, NONE without anything; effects and noises take turns. Effects that change the displacement field, of which a record takes a minute, are hidden once each: in one species, and not in the other.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin cohorts
count=${COUNT:-40}
nones=${NONE:-200}
first=${FIRST:-10000}
records=20
effects=(instantaneous-elasticity tracking-drift force-bias softening force-asymmetry second-retardation clock-offset fractional-damping force-gradient actuator-lag)
fields=(interface-slip poroelasticity outer-wall-compliance liquefied-pocket strain-stiffening inertia)
noises=(white ou gain outliers)

# cohort PLACE SEED SPECIES STRENGTH COUNT: so many records below PLACE, of a signal (`4σ`) or a size; 0 hides nothing.
cohort() {
    local place=$1 seed=$2 species=$3 strength=$4 number=$5 hidden dir
    [[ -e $place/$species-$strength.made ]] && return
    case $strength in
    0) hidden=(--none) ;;
    *σ) hidden=(--effect "$effect" --strength "${strength%σ}") ;;
    *) hidden=(--effect "$effect" --size "$strength") ;;
    esac
    rm -rf "$place/new" "$place/$species-$strength"-*
    "$program" challenge new --out "$place/new" --count "$number" "${hidden[@]}" --noise-kind "$noise" --seed "$((1000 * seed))" --quiet >>"$raw/made.log"
    for dir in "$place"/new/*/; do
        # The seal holds the data and the hash; whose eye it is stands in no seal.
        local own=$species-$strength-$(basename "$dir")
        sed -i "s/^id = .*/id = \"$own\"/; s/^species = .*/species = \"$species\"/" "$dir/experiment.toml"
        mv "$dir" "$place/$own"
    done
    rmdir "$place/new"
    touch "$place/$species-$strength.made"
}

# diagnosed LABEL PLACE: the diagnosis, with what was hidden beside it.
diagnosed() {
    local label=$1 place=$2 dir
    is_done "$label" "$program" diagnose "$place" --out "$raw/out/$label" --json "$raw/$label.json" --quiet && return
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

# typical SEED: the size at which a record of the effect typically shows by 4 σ: the median of ten.
typical() {
    local place=$raw/made/typical-$k
    if [[ ! -e $place.size ]]; then
        rm -rf "$place"
        "$program" challenge new --out "$place" --count 10 --effect "$effect" --strength 4 --seed "$1" --quiet >>"$raw/made.log"
        for dir in "$place"/*/; do
            "$program" challenge reveal "$dir" --json - --quiet 2>/dev/null
        done | "$python" "$root/campaigns/cohorts/typical.py" >"$place.size"
    fi
    cat "$place.size"
}

half=$((records / 2))
place=$raw/made
for ((k = 0; k < count; k++)); do
    effect=${effects[k % ${#effects[@]}]}
    noise=${noises[(k + k / ${#effects[@]}) % ${#noises[@]}]}
    cohort "$place/each-$k" $((first + 1000 + k)) porcine 2σ "$records"
    diagnosed "each.$k" "$place/each-$k"
    cohort "$place/half-$k" $((first + 2000 + k)) porcine 4σ "$half"
    cohort "$place/half-$k" $((first + 3000 + k)) porcine 0 $((records - half))
    diagnosed "half.$k" "$place/half-$k"
    size=$(typical $((1000 * (first + k))))
    cohort "$place/twice-$k" $((first + 4000 + k)) bovine "$("$python" -c "print(2 * $size)")" "$half"
    cohort "$place/twice-$k" $((first + 5000 + k)) human "$size" $((records - half))
    diagnosed "twice.$k" "$place/twice-$k"
    cohort "$place/alike-$k" $((first + 6000 + k)) bovine "$size" "$half"
    cohort "$place/alike-$k" $((first + 7000 + k)) human "$size" $((records - half))
    diagnosed "alike.$k" "$place/alike-$k"
done
for ((k = 0; k < nones; k++)); do
    noise=${noises[k % ${#noises[@]}]}
    cohort "$place/none-$k" $((first + 8000 + k)) porcine 0 "$records"
    diagnosed "none.$k" "$place/none-$k"
done
for ((k = 0; k < ${#fields[@]}; k++)); do
    effect=${fields[k]}
    noise=${noises[k % ${#noises[@]}]}
    cohort "$place/field-$k" $((first + 9000 + k)) bovine 4σ "$half"
    cohort "$place/field-$k" $((first + 9500 + k)) human 0 $((records - half))
    diagnosed "field.$k" "$place/field-$k"
done
finish
