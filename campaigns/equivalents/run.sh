#!/usr/bin/env bash
# Records with a hidden effect that their diagnosis cannot tell from others: does `predict` name it where the answer depends on which of them is true? Each equivalent effect gets a study
# of its own, by which the answer is judged. Records whose class has one member count as such and are not predicted.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin equivalents
in_parts equivalents "${COUNT:-40}" 5 "$python" "$root/campaigns/equivalents/equivalents.py" "$program" --seed 1
finish
