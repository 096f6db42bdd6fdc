#!/usr/bin/env bash
# Motion of a bead in new eyes of a synthetic species, whose eyes scatter: is it inside the 90 % band that a comparison of twelve eyes predicts? Ten new eyes for each comparison.
# The truth is the closed form of the law, so that no solver of the program makes the data. Eyes of one comparison share its band, so that their number varies more than that of independent ones.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin new-eyes
in_parts new-eyes "${COUNT:-20}" 5 "$python" "$root/campaigns/new-eyes/new_eyes.py" "$program" --seed 1
finish
