#!/usr/bin/env bash
# Designed records of hidden gels: is the standard deviation of each parameter, sampled from both records, the one that the design expected?
# The truth is the closed form of the law at the compliance of the finest elements, so that no solver of the program makes the data.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin designs
in_parts designs "${COUNT:-200}" 10 "$python" "$root/campaigns/designs/hidden.py" "$program" --seed 1
finish
