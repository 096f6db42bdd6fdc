#!/usr/bin/env bash
# The workbench in a browser, by the clock: first paint, sliders, long records, idling, and the whole loop. On a machine that does nothing else; what scripts/browser-checks.sh installs has to be there.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin workbench
cp "$root/campaigns/workbench/measure.mjs" "$root/target/browser-checks/"
run_in measured node "$root/target/browser-checks/measure.mjs" "$program"
finish
