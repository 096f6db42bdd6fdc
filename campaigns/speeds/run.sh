#!/usr/bin/env bash
# Wall clock and processor time of whole commands, three runs each; on a machine that does nothing else.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin speeds

timed sample env VITREO_UQ_CACHE= "$program" sample --chains 32 --quiet
timed shapes "$program" shapes --quiet
for seed in 4 7 13; do
    timed "challenge-new-$seed" env VITREO_UQ_CACHE= "$program" challenge new --out eye --seed "$seed" --quiet
done

effects=$("$program" effects --json - --quiet | "$python" -c 'import json, sys; print(*(e["slug"] for e in json.load(sys.stdin)["effects"] if e["slug"] != "compressibility"))')
fields="inertia interface-slip liquefied-pocket outer-wall-compliance poroelasticity strain-stiffening shear-thinning yield-stress"

# Each effect hidden, nothing kept: full finite elements and whatever else the data take.
for effect in $effects; do
    timed "challenge-effect-$effect" env VITREO_UQ_CACHE= "$program" challenge new --out eye --effect "$effect" --strength 10 --seed 5 --quiet
done

# The apparatus's reduced models are built once in a laboratory: here, before any diagnosis is timed.
rm -rf "$raw/first" "$raw/first-study"
"$program" challenge new --out "$raw/first" --none --seed 5 --quiet >"$raw/make.txt"
"$program" diagnose "$raw/first" --out "$raw/first-study" --quiet >"$raw/make.txt" || (($? == 1))

# Each effect that changes the field, added to a record of it: full check included, the reduced models there.
for effect in $fields; do
    label=extend-$effect
    extend=("$program" extend "../records/extend-$effect" --with "$effect" --out study --quiet)
    if is_done "$label" "${extend[@]}"; then
        continue
    fi
    rm -rf "$raw/records/extend-$effect"
    mkdir -p "$raw/records"
    if "$program" challenge new --out "$raw/records/extend-$effect" --effect "$effect" --strength 10 --seed 5 --quiet >"$raw/make.txt" 2>&1; then
        timed "$label" "${extend[@]}"
    fi
done

# Records with each effect at 10 and 40 σ, their studies made by `compare` before the clock starts.
for effect in none $effects; do
    for strength in 10 40; do
        hide=(--effect "$effect" --strength "$strength")
        if [[ $effect == none ]]; then
            hide=(--none)
        fi
        label=diagnose-$effect-$strength
        diagnose=("$program" diagnose "studies/$effect-$strength" --quiet)
        if is_done "$label" "${diagnose[@]}"; then
            continue
        fi
        place=$raw/records/$effect-$strength
        rm -rf "$place" "$raw/studies/$effect-$strength" "$raw/$label.seconds"
        started=$(date +%s)
        mkdir -p "$raw/records"
        # Some effects cannot be made as strong as that.
        if ! "$program" challenge new --out "$place" "${hide[@]}" --seed 5 --quiet >"$raw/make.txt" 2>&1; then
            continue
        fi
        "$program" compare "$place" --out "$raw/studies/$effect-$strength" --quiet >"$raw/make.txt"
        (cd "$raw" && run_timed "$label" "${diagnose[@]}")
        # The same with an empty cache, so that every reduced model is built.
        rm -f "$raw/cold-$label.seconds"
        (cd "$raw" && run_timed "cold-$label" env VITREO_UQ_CACHE= "$program" diagnose "$place" --out "studies/cold-$effect-$strength" --quiet)
        note "$label" "$started" "${diagnose[@]}"
    done
done

"$python" campaigns/speeds/records.py "$raw/long"
timed compare-10000-200 "$program" compare "$raw/long/rows-10000-cycles-200" --out study --quiet
timed compare-100000-100 "$program" compare "$raw/long/rows-100000-cycles-100" --out study --quiet
timed diagnose-30000-100 "$program" diagnose "$raw/long/rows-30000-cycles-100" --out study --quiet
timed sample-200000-4 env VITREO_UQ_CACHE= "$program" sample "$raw/long/rows-200000-cycles-4" --out study --quiet

# Laws of a dashpot's and of a springpot's kind, on records of their own motion.
for rows in 800 10000; do
    timed "learn-$rows" "$program" learn "$raw/long/rows-$rows-cycles-4" --out study --quiet
    timed "learn-springpot-$rows" "$program" learn "$raw/long/rows-$rows-cycles-4" --base "$root/campaigns/indentations/springpot.toml" --out study --quiet
done

for bench in likelihood effects noise finite_elements; do
    run_in "bench-$bench" cargo bench --quiet --locked --bench "$bench"
done
rm -rf "$raw/work" "$raw/studies" "$raw/first" "$raw/first-study"
finish
