#!/usr/bin/env bash
# Nothing is hidden: how often is an effect claimed, or something called unexplained? 400 records of each kind of noise, on two protocols.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin controls
count=${COUNT:-400}
seed=1000
for noise in white ou gain outliers lost ou-alone ou-outliers; do
    # Each kind keeps its seed, whichever kinds are asked for.
    seed=$((seed + 1))
    if [[ -n ${KINDS:-} && " $KINDS " != *" $noise "* ]]; then
        continue
    fi
    # Slow errors alone are of unknown size: laboratories that have them do not know what white noise is beneath.
    known=yes
    if [[ $noise == ou-* ]]; then
        known=no
    fi
    play "$noise" "$count" --only none --noise-kind "$noise" --noise-known "$known" --seed "$seed"
done
finish
