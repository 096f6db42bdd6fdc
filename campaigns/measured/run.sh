#!/usr/bin/env bash
# Measured records, where ../shared/data is there: what is said of them. They are read and never copied into the project.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
measured keizer-2022-cycles
begin measured
for command in sample diagnose; do
    run_in "$command" "$program" "$command" "$data/keizer-2022-cycles" --out "$raw/keizer" --json "$raw/$command.json" --quiet
done
# Its authors take the chromatin for a Rouse polymer: a springpot of the order one half, which is left free here.
rouse=("$data/keizer-2022-cycles" --base "$root/campaigns/measured/rouse.toml" --prior generic --out "$raw/rouse" --quiet)
run_in rouse.diagnose "$program" diagnose "${rouse[@]}" --json "$raw/rouse.diagnose.json"
run_in rouse.extend "$program" extend "$raw/rouse" --with softening --json "$raw/rouse.extend.json" --quiet
# What the data write by themselves: from the first nine cycles, and from the first five.
learn=(learn "$raw/rouse" --from m0 --quiet)
run_in rouse.learn "$program" "${learn[@]}" --json "$raw/rouse.learn.json"
run_in rouse.learnt "$program" extend "$raw/rouse" --from m0 --with "$raw/rouse/m0/learned-effect.toml" --json "$raw/rouse.learnt.json" --quiet
run_in rouse.learn-of-five "$program" "${learn[@]}" --first-cycles 5 --json "$raw/rouse.learn-of-five.json"
rm -rf "$raw/keizer" "$raw/rouse"
finish
