#!/usr/bin/env bash
# Records whose hidden effect the diagnosis cannot tell from others: how many designed records does it take until one effect is left, and is it the true one? The truth of a designed record comes
# from full finite elements. Records whose class has one member count as such.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin sequences
in_parts sequences "${COUNT:-40}" 5 "$python" "$root/campaigns/sequences/sequences.py" "$program" --seed 7
finish
