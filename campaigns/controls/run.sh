#!/usr/bin/env bash
# Nothing is hidden: how often is an effect claimed, or something called unexplained? 400 records of each kind of noise, on two protocols.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin controls
count=${COUNT:-400}
seed=1000
for noise in ${KINDS:-white ou gain outliers lost ou-outliers}; do
    play "$noise" --only none --count "$count" --noise-kind "$noise" --seed $((seed += 1))
done
finish
