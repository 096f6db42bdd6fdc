#!/usr/bin/env bash
# Records of an instrument, clean with four kinds of noise or with a misfit of 5 or 10 standard deviations that `sample` may not see: how often is a clean record told of a pattern, and how often
# are parameters trusted that are wrong by more than three of their standard deviations?
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin trust
in_parts trust "${COUNT:-1200}" 60 "$python" "$root/campaigns/trust/trust.py" "$program" --seed 1
finish
