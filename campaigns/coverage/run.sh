#!/usr/bin/env bash
# 90 % intervals of effects whose posteriors may have two modes: how many hold the truth? Sizes from the priors, where the effect shows at all; data from the reduced
# model, since this calibrates an algorithm. A random coverage of 90 % of 240 lies within 203 and 228 with a probability of 99 %.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin coverage
in_parts coverage "${COUNT:-240}" 20 "$root/target/release/examples/interval_coverage" --seed 1
finish
