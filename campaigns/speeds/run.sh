#!/usr/bin/env bash
# Wall clock and processor time of whole commands, three runs each; on a machine that does nothing else.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin speeds

timed sample env VITREO_UQ_CACHE= "$program" sample --chains 32 --quiet
timed shapes "$program" shapes --quiet
# Reduced models are built where nothing is kept.
for seed in 4 7 13; do
    timed "challenge-new-$seed" env VITREO_UQ_CACHE= "$program" challenge new --out eye --seed "$seed" --quiet
done

# The apparatus's reduced models are built once in a laboratory: here, before any diagnosis is timed.
rm -rf "$raw/first" "$raw/first-study"
"$program" challenge new --out "$raw/first" --none --seed 5 --quiet >"$raw/make.txt"
"$program" diagnose "$raw/first" --out "$raw/first-study" --quiet >"$raw/make.txt" || (($? == 1))

# Records with each effect at 10 and 40 σ, their studies made by `compare` before the clock starts.
effects=$("$program" effects --json - --quiet | "$python" -c 'import json, sys; print(*(e["slug"] for e in json.load(sys.stdin)["effects"] if e["slug"] != "compressibility"))')
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
        note "$label" "$started" "${diagnose[@]}"
    done
done

"$python" campaigns/speeds/records.py "$raw/long"
timed compare-10000-200 "$program" compare "$raw/long/rows-10000-cycles-200" --out study --quiet
timed compare-100000-100 "$program" compare "$raw/long/rows-100000-cycles-100" --out study --quiet
timed diagnose-30000-100 "$program" diagnose "$raw/long/rows-30000-cycles-100" --out study --quiet
timed sample-200000-4 env VITREO_UQ_CACHE= "$program" sample "$raw/long/rows-200000-cycles-4" --out study --quiet

for bench in likelihood effects noise finite_elements; do
    run_in "bench-$bench" cargo bench --quiet --locked --bench "$bench"
done
rm -rf "$raw/work" "$raw/studies" "$raw/first" "$raw/first-study"
finish
