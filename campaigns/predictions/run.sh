#!/usr/bin/env bash
# Predictions and force plans for hidden gels: does the 90 % band contain the true motion of another robot under another force, and does a plan of 95 % arrive in 95 %?
# The truths come from finer elements. A random coverage of 90 % of 200 lies within 168 and 190 with a probability of 99 %.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin predictions
in_parts predictions "${COUNT:-200}" 20 "$root/target/release/examples/hidden_predictions" --seed 1
finish
